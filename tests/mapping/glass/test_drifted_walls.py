"""Walls that are seen from poses which drifted are no glass: what ends a little behind them met the same wall."""

import pytest

from closedrooms.core.pose import Pose2
from closedrooms.mapping.beams import clean
from closedrooms.mapping.config import MapperConfig
from closedrooms.mapping.glass.met_surfaces import Glimpse
from closedrooms.mapping.glass.panes import Panes
from closedrooms.mapping.graph.keyframe import Keyframe
from closedrooms.mapping.log_odds_grid import EvidenceGrid
from tests.conftest import SegmentWorld

HALL_WITH_A_PIER = [
    (0.0, 0.0, 12.0, 0.0), (12.0, 0.0, 12.0, 8.0), (12.0, 8.0, 0.0, 8.0), (0.0, 8.0, 0.0, 0.0),
    (6.0, 0.0, 6.0, 5.0), (6.15, 0.0, 6.15, 5.0), (6.0, 5.0, 6.15, 5.0),
]  # fmt: skip


@pytest.mark.parametrize("route", [[(2.0, 2.0), (2.0, 6.0), (10.0, 6.0)], [(10.0, 2.0), (8.0, 5.8), (4.5, 6.0)]])
@pytest.mark.parametrize("drift", [-0.45, -0.25, 0.25, 0.45])
def test_a_wall_seen_from_poses_that_drifted_is_no_pane(drift: float, route: list[tuple[float, float]]) -> None:
    # Round the end of the pier, and all that comes after half the way is drawn at this distance from where it belongs.
    drive = SegmentWorld(HALL_WITH_A_PIER).drive([*route, (route[-1][0], 2.0)], noise=0.01, beams=720)
    panes, evidence, keyframes = Panes(0.05), EvidenceGrid(MapperConfig()), list[Keyframe]()
    for scan, odometry in zip(drive.scans[::6], drive.odometry[::6], strict=True):
        drifted = Pose2(drift if scan.stamp > drive.scans[-1].stamp / 2.0 else 0.0, 0.0, 0.0)
        beams, pose = clean(scan, max_range=20.0), drifted @ Pose2(*odometry)
        keyframe = Keyframe(len(keyframes), scan.stamp, pose, beams, beams.points, beams.points, 0.0)
        keyframes.append(keyframe)
        panes.glimpse(Glimpse(keyframe.index, Pose2(0.0, 0.0, 0.0), beams.points, beams.origin))
        evidence.add(beams, pose)
    evidence.grid()
    panes.update(keyframes, evidence, moved=False, last=True)
    assert not len(panes.segments)
