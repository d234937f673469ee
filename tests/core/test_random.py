from closedrooms.core.random import stream


def test_streams_depend_on_seed_and_name_only() -> None:
    first = stream(3, "odometry").random(4)
    stream(3, "lidar").random(100)
    assert (stream(3, "odometry").random(4) == first).all()
    assert (stream(4, "odometry").random(4) != first).all()
    assert (stream(3, "lidar").random(4) != first).all()
