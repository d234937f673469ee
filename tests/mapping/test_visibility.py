import numpy as np
import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import Beams, clean
from closedrooms.mapping.visibility import _passed_through, conflict


def beams_at(world, pose: Pose2):  # type: ignore[no-untyped-def]
    return clean(world.scan(pose, noise=0.02, rng=np.random.default_rng(1)), max_range=25.0)


A, B = Pose2(2.5, 4.0, 0.4), Pose2(2.9, 3.7, 0.9)


def test_two_scans_at_their_true_poses_do_not_contradict_each_other(office) -> None:  # type: ignore[no-untyped-def]
    share = conflict(beams_at(office, A), beams_at(office, B), A.inverse() @ B)
    assert share is not None
    assert share < 0.05


@pytest.mark.parametrize("off", [Pose2(0.8, 0.0, 0.0), Pose2(-0.6, 0.6, 0.0), Pose2(0.0, 0.0, 0.7)])
def test_a_wrong_pose_puts_walls_where_beams_passed(office, off: Pose2) -> None:  # type: ignore[no-untyped-def]
    share = conflict(beams_at(office, A), beams_at(office, B), A.inverse() @ B @ off)
    assert share is not None
    assert share > 0.2


def test_a_room_that_was_not_seen_before_contradicts_nothing(office) -> None:  # type: ignore[no-untyped-def]
    corridor, room = Pose2(1.0, 1.0, 0.0), Pose2(2.45, 2.4, 1.57)
    share = conflict(beams_at(office, corridor), beams_at(office, room), corridor.inverse() @ room)
    assert share is None or share < 0.1


def test_scans_far_apart_say_nothing_about_each_other(office) -> None:  # type: ignore[no-untyped-def]
    assert conflict(beams_at(office, A), beams_at(office, B), Pose2(100.0, 0.0, 0.0)) is None


def circle(radius: float, bearings: np.ndarray) -> np.ndarray:
    return radius * np.column_stack((np.cos(bearings), np.sin(bearings)))


def view(radius: float, origin: tuple[float, float] = (0.0, 0.0)) -> Beams:
    """A sensor that sees as far as ``radius`` over half a turn ahead."""
    ends = circle(radius, np.linspace(-1.5, 1.5, 61)) + origin
    return Beams(ends, np.vstack(([origin], ends)), np.array(origin))


@pytest.mark.parametrize("origin", [(0.0, 0.0), (0.4, -0.3)])
@pytest.mark.parametrize(
    ("distances", "share"),
    [
        ([3.7] * 40, 1.0),
        ([3.8] * 40, 0.0),
        ([4.2] * 40, 0.0),
        # Beyond what was seen: of those in view at least 15 count.
        ([4.3] * 40, None),
        ([4.3] * 25 + [3.0] * 15, 1.0),
        ([4.3] * 26 + [3.0] * 14, None),
        ([3.0] * 10 + [4.0] * 30, 0.25),
    ],
)
def test_surfaces_lie_where_beams_passed_a_quarter_of_a_metre_before_their_ends(
    distances: list[float], share: float | None, origin: tuple[float, float]
) -> None:
    bearings = np.linspace(-1.4, 1.4, len(distances))
    points = np.vstack([circle(r, np.array([b])) for r, b in zip(distances, bearings, strict=True)]) + origin
    found = _passed_through(view(4.0, origin), points)
    assert found == (None if share is None else pytest.approx(share))


def test_nothing_is_known_beside_the_view_and_without_beams() -> None:
    # Within 0.25 m of the sensor all is in view.
    assert _passed_through(view(4.0), circle(2.0, np.linspace(1.6, 3.0, 40))) is None
    assert _passed_through(view(4.0), circle(2.0, np.linspace(-3.0, -1.6, 40))) is None
    assert _passed_through(view(4.0), np.empty((0, 2))) is None
    nothing = np.empty((0, 2))
    assert _passed_through(Beams(nothing, np.zeros((1, 2)), np.zeros(2)), circle(2.0, np.linspace(-1, 1, 40))) is None
    one = Beams(nothing, np.array([[0.0, 0.0], [4.0, 0.0]]), np.zeros(2))
    assert _passed_through(one, circle(2.0, np.linspace(-1, 1, 40))) is None


def test_between_two_beams_only_what_both_crossed_is_free() -> None:
    # One beam of 4 m between others of 2 m.
    bearings = np.linspace(-0.4, 0.4, 9)
    ends = np.array([(4.0 if k == 4 else 2.0) for k in range(9)])[:, None] * circle(1.0, bearings)
    beams = Beams(ends, np.vstack(([[0.0, 0.0]], ends)), np.zeros(2))
    near = circle(1.0, np.linspace(-0.35, 0.35, 20))
    assert _passed_through(beams, near) == 1.0
    assert _passed_through(beams, circle(3.0, np.linspace(-0.05, 0.05, 20))) is None


def test_the_larger_share_of_both_ways_counts() -> None:
    # The second scan sees the first one's surfaces halfway; the first sees none of the second's.
    wide, short = view(4.0), view(2.0)
    assert conflict(wide, short, Pose2()) == 1.0
    assert conflict(short, wide, Pose2()) == 1.0
    assert conflict(wide, wide, Pose2()) == 0.0
    shift = np.array([2.0, 0.0])
    ways = (_passed_through(wide, short.points + shift), _passed_through(short, wide.points - shift))
    assert conflict(wide, short, Pose2(2.0, 0.0, 0.0)) == max(share for share in ways if share is not None)
