"""SLAM and nothing else: scans and odometry in, poses, the map and closed doors out; ``mapper`` is where to begin.

- A scan: ``beams``, ``scan_preparation``, ``visibility``; where it fits: ``matching/``.
- How the robot moved: ``motion/``; what befell it on the way: ``mapping_events``.
- Surroundings: ``local_map``, ``lattice``, ``growing_array``; poses of keyframes: ``graph/``.
- The map: ``map_drawing``, ``log_odds_grid`` and its ``fading``, ``door_fusion``; panes in it: ``glass/``.
- Recorded runs: ``logs/`` reads them (rosbags too), ``map_builder`` maps them, ``trajectory`` measures their error.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.mapping.config import LoopConfig as LoopConfig
    from closedrooms.mapping.config import MapperConfig as MapperConfig
    from closedrooms.mapping.config import MatcherConfig as MatcherConfig
    from closedrooms.mapping.config import RecoveryConfig as RecoveryConfig
    from closedrooms.mapping.graph.keyframe import Keyframe as Keyframe
    from closedrooms.mapping.mapper import Mapper as Mapper
    from closedrooms.mapping.scan_preparation import PreparedScan as PreparedScan
    from closedrooms.mapping.scan_preparation import prepare_scans as prepare_scans
    from closedrooms.mapping.trajectory import align as align
    from closedrooms.mapping.trajectory import ate as ate

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "config": ("LoopConfig", "MapperConfig", "MatcherConfig", "RecoveryConfig"),
        "graph.keyframe": ("Keyframe",),
        "mapper": ("Mapper",),
        "scan_preparation": ("PreparedScan", "prepare_scans"),
        "trajectory": ("align", "ate"),
    },
)
