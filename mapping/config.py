"""Settings of the mapper: grid, scan matching, keyframes, loop closure."""

from dataclasses import dataclass, field

from closedrooms.core.numbers import COARSEST, FINEST
from closedrooms.core.runtime.options import check_magnitudes


@dataclass(frozen=True, kw_only=True)
class MatcherConfig:
    """Settings of scan matching; one set of values for every sensor and noise level."""

    field_sigma: float = 0.08
    """Standard deviation of the likelihood around a mapped hit [m]: sensor noise and half a cell together."""

    new_surface: float = 0.6
    """Hits whose likelihood is at least this are on a known surface and do not stamp the field again [0..1]; keeps
    walls as sharp as they were first seen."""

    point_spacing: float = 0.10
    """Distance along the scan between the points that are matched [m]; evens out near and far walls."""

    max_points: int = 320
    """Most points of a scan that are matched."""

    range_margin: float = 1.0
    """Distance before the longest range from which points are not matched [m]: along a hall that is longer than the
    sensor sees, they lie beyond the walls known so far and draw each scan back to where those end."""

    min_points: int = 20
    """Fewest points worth matching."""

    lost_score: float = 0.15
    """Mean likelihood [0..1] below which a scan fits nowhere and odometry is kept."""

    iterations: int = 6
    """Most Gauss-Newton steps of a refinement."""

    prior_weight: float = 0.005
    """Weight of the odometry against the likelihood of one point at one sigma."""

    min_score: float = 0.45
    """Mean likelihood [0..1] below which a refinement is doubted and a search is made."""

    doubt: float = 0.9
    """Share of the usual score below which a refinement is doubted and a search is made."""

    sure_angle: float = 0.02
    """Standard deviation of the odometry's heading above which headings are searched before a refinement [rad]."""

    poor: float = 0.7
    """Share of the usual score below which a match is not trusted: the next window widens, keyframes wait."""

    window_sigmas: float = 3.0
    """Half width of the search window in standard deviations of the odometry."""

    max_window: float = 0.60
    """Largest half width of the search window [m]."""

    max_window_angle: float = 0.60
    """Largest half width of the search window [rad]."""

    odometry_distance: float = 0.08
    """Standard deviation of the odometry after 1 m [m]; its variance grows with the distance."""

    odometry_turn_per_metre: float = 0.07
    """Standard deviation of the odometry's heading after 1 m [rad]."""

    odometry_turn: float = 0.20
    """Standard deviation of the odometry's heading after one radian of turning [rad]; 8 % of a full turn, its
    variance linear in the turn."""

    odometry_floor: float = 0.004
    """Standard deviation of the odometry that is left when the robot hardly moves [m] and, halved, [rad]."""

    def __post_init__(self) -> None:
        check_magnitudes(
            self, owner="matcher", positive=("point_spacing", "max_points", "iterations"), field_sigma=(0.01, 0.5)
        )


@dataclass(frozen=True, kw_only=True)
class LoopConfig:
    """Settings of place recognition, loop closure and the pose graph's solver."""

    enabled: bool = True
    """Close loops."""

    horizon: float = 20.0
    """Path length along the pose graph [m] within which keyframes are taken as consistent with the present: only they
    are matched against, what lies beyond is a candidate for a loop."""

    interval: float = 1.0
    """Travelled distance between two attempts to close a loop [m]."""

    window: float = 0.30
    """Half width of the search window without any drift [m]."""

    drift: float = 0.025
    """Drift for which the search window grows, per metre along the pose graph [m/m]."""

    max_window: float = 4.0
    """Largest half width of the search window [m]."""

    window_angle: float = 0.06
    """Half width of the search window without any drift [rad]."""

    drift_angle: float = 0.003
    """Growth of the angular window per metre along the pose graph [rad/m]."""

    overlap: float = 3.0
    """Distance beyond the drift up to which two keyframes see the same surfaces well enough [m]."""

    max_distance: float = 7.0
    """Largest distance of two keyframes that are tried [m]."""

    surroundings: float = 8.0
    """Distance around the older keyframe from which surfaces are taken [m]."""

    recent_distance: float = 3.0
    """Distance travelled before the present keyframe whose surfaces are matched with it [m]."""

    max_points: int = 500
    """Most points that are matched."""

    min_score: float = 0.60
    """Mean likelihood [0..1] of the recent path on the older surfaces that a loop must reach."""

    max_rival: float = 0.9
    """Score of the best other place in the window, as a share of the loop's, above which the loop is ambiguous and not
    taken: loops of the aces log have 0.52 to 0.83, a wrong one in a row of 25 equal rooms had 0.97."""

    kernel: float = 4.0
    """Mahalanobis error at which a loop has half its weight."""

    min_weight: float = 0.15
    """Weight [0..1] after optimisation below which a loop contradicts the rest and is taken back."""

    link_distance: float = 2.5
    """Distance up to which an edge also joins the present keyframe to an older one that it was matched against [m]."""

    link_interval: float = 1.0
    """Distance travelled between two such edges [m]."""

    point_information: float = 2.0
    """Information of a match per unit of the field's curvature; gives about 1.5 cm in a room."""

    def __post_init__(self) -> None:
        check_magnitudes(self, owner="loops", positive=("max_points", "kernel"))


@dataclass(frozen=True, kw_only=True)
class RecoveryConfig:
    """Settings of recovery: what happens when a match contradicts the map because the odometry failed."""

    enabled: bool = True
    """Look for contradictions, search wide windows and start submaps."""

    check_below: float = 0.8
    """Share of the usual score below which a match is checked for contradictions, as every keyframe is."""

    max_conflict: float = 0.20
    """Share of the surfaces [0..1] that a scan and the keyframe before may see through before the pose is taken for
    wrong: 99 % of the right poses of the aces log are below 0.18, half of those after a lost step above 0.42."""

    reach: float = 0.9
    """Half width of the window in which a lost robot is searched, all headings [m]."""

    max_reach: float = 1.5
    """Largest half width of that window, where the steps from scan to scan are long [m]."""

    min_score: float = 0.7
    """Share of the usual score that a pose found there must reach."""

    advantage: float = 0.05
    """Mean likelihood by which it must beat the match in doubt."""

    max_rival: float = 0.9
    """Score of the best other pose there, as a share of the found one's, above which none is taken."""

    submap_after: int = 10
    """Scans in a row that fit nowhere after which a new submap is started."""

    lost_distance: float = 2.5
    """Distance from the last keyframe after which it is started in any case [m]."""

    break_length: float = 60.0
    """How far apart two submaps are taken to be along the pose graph [m]: beyond the horizon."""

    break_distance: float = 1.0
    """Standard deviation of the distance between two submaps before a loop joins them [m]."""

    break_angle: float = 1.0
    """Standard deviation of their heading [rad]."""

    join_window: float = 2.0
    """Half width of the window in which a submap is sought in an older one, all headings [m]."""

    possible_speed: float = 5.0
    """Speed beyond which a step of the odometry is an error [m/s]: no robot indoors is as fast."""

    possible_turn_rate: float = 8.0
    """Turn rate beyond which a step of the odometry is an error [rad/s]."""

    def __post_init__(self) -> None:
        check_magnitudes(self, owner="recovery", positive=())


@dataclass(frozen=True, kw_only=True)
class MapperConfig:
    """Settings of mapping, from scans to a map."""

    resolution: float = 0.05
    """Cell size of the map [m]."""

    keyframe_distance: float = 0.35
    """Travelled distance after which a scan becomes a keyframe and enters the map [m]."""

    keyframe_angle: float = 0.40
    """Turn after which a scan becomes a keyframe and enters the map [rad]."""

    poor_spacing: float = 2.5
    """How many times farther than usual the robot moves before a keyframe is taken at a pose that fits poorly."""

    max_range: float = 25.0
    """Longest range that is mapped [m]; longer ones clear the cells up to here."""

    log_odds_hit: float = 3.2
    """Evidence of one hit for a cell being occupied (natural log-odds): more than two misses, less than three."""

    log_odds_miss: float = 1.45
    """Evidence of one miss (a beam passes) for a cell being free (natural log-odds): once is enough for p < 0.196."""

    log_odds_limit: float = 12.0
    """Largest evidence either way that a cell reports (natural log-odds)."""

    undistort: bool = True
    """Straighten sweeps that took time by the odometry's motion; scans of one instant stay as they are."""

    glass: bool = True
    """Find panes of glass, which only come into view near their normal, and map nothing that is seen through them."""

    matcher: MatcherConfig = field(default_factory=MatcherConfig)
    """Scan matching."""

    loops: LoopConfig = field(default_factory=LoopConfig)
    """Loop closure."""

    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    """Failing odometry."""

    def __post_init__(self) -> None:
        positive = ("keyframe_distance", "keyframe_angle", "max_range", "log_odds_limit")
        check_magnitudes(self, owner="mapper", positive=positive, resolution=(FINEST, COARSEST))
