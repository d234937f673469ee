"""Recorded runs in rosbag 1, rosbag 2 and MCAP files, through the optional ``rosbags``."""

import contextlib
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import check_regular, is_folder, reading
from closedrooms.core.pose import Pose2
from closedrooms.core.remarks import Remark
from closedrooms.mapping.logs.bags.bag_files import bag_paths
from closedrooms.mapping.logs.bags.bag_limits import limited
from closedrooms.mapping.logs.bags.bag_messages import (
    MAX_SCANS,
    BagMessages,
    choose_connections,
    read_messages,
    stamp_of,
)
from closedrooms.mapping.logs.bags.bag_options import BagOptions
from closedrooms.mapping.logs.bags.bag_scans import (
    count_beyond,
    mark_of_nothing,
    ranges_of,
    scan_of,
    sector_of,
    sweep_of,
)
from closedrooms.mapping.logs.bags.transform_tree import (
    CORRECTED_FRAMES,
    LEVEL,
    Mount,
    TransformTree,
    clean_name,
    last_name,
)
from closedrooms.mapping.logs.clocks import Times, forward, scan_and_odometry_times
from closedrooms.mapping.logs.recorded_odometry import bridge_jumps, jump_remarks, odometry_at
from closedrooms.mapping.logs.recorded_run import RecordedRun

LONGEST_SWEEP = 1.1
"""Time from the first beam of a sweep to its last against that from one sweep to the next: more cannot be."""

MOST_BEYOND = 0.1
"""Share of the ranges that may lie beyond what the scans state as the longest."""


def read_bag(path: Path, options: BagOptions) -> RecordedRun:
    """Read laser scans, and the odometry interpolated at their times.

    Odometry comes from ``nav_msgs/Odometry``, else from the transforms, else there is none. Where the lidar sits comes
    from the transforms between it and the frame that the odometry moves.

    Args:
        path: A ``.bag``, ``.mcap`` or ``.db3`` file, or a rosbag 2 folder.
        options: What to take where it holds several, and the mounting where it does not say.

    Raises:
        InvalidInputError: ``rosbags`` is not installed, a broken bag, a topic missing or ambiguous, a mounting that is
            unknown or not level.
    """
    remarks: list[Remark] = []
    with opened_bag(path, remarks) as reader:
        wanted, chosen = choose_connections(reader.connections, options)
        messages = read_messages(reader, wanted)
    with reading(path, "a rosbag"):
        return _resolved(messages, options, [*remarks, *chosen])


@contextlib.contextmanager
def opened_bag(path: Path, remarks: list[Remark]) -> Iterator[Any]:
    """Open a bag of any kind.

    Args:
        path: As of :func:`read_bag`.
        remarks: Told which of its files were left out or read although nothing names them.

    Raises:
        InvalidInputError: ``rosbags`` is not installed, or a broken bag.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InvalidInputError(
            "bags need the optional package rosbags", expected="pip install 'closedrooms[bags]'", where=path
        ) from error
    for file in path.iterdir() if is_folder(path) else [path]:
        check_regular(file, "a rosbag")
    with (
        reading(path, "a rosbag"),
        limited(path),
        bag_paths(path, remarks) as paths,
        # Bags of ROS 2 before Iron do not carry the definitions of their messages.
        AnyReader(paths, default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader,
    ):
        yield reader


def _resolved(messages: BagMessages, options: BagOptions, remarks: list[Remark]) -> RecordedRun:
    """Put scans, motion and mounting of the messages together to a run, on one clock."""
    remarks = [*remarks, *_reading_remarks(messages)]
    if not messages.scans:
        return RecordedRun((), np.empty((0, 3)), None, tuple(remarks))
    frames = Counter(clean_name(message.header.frame_id) for message, _ in messages.scans)
    lidar = frames.most_common(1)[0][0]
    track, base, found = _motion(messages, lidar, options)
    ordered = [frame for frame, _ in frames.most_common()]
    mounts, mount_remarks = _mounts(messages.tree, base, ordered, options, measured=track is not None)
    scan_times = Times(*np.array([(stamp_of(message), at) for message, at in messages.scans]).T)
    times = None if track is None else Times(track[:, 0], track[:, 1])
    stamps, odometry_stamps, clock_remarks = scan_and_odometry_times(scan_times, times)
    remarks += [*found, *mount_remarks, *clock_remarks, *_put_in_order(messages, stamps)]
    sweeps, sweep_remarks = _sweeps(messages, stamps)
    remarks += sweep_remarks
    # A message's stamp is that of its first beam, a scan's that of its latest.
    stamps += np.maximum(sweeps, 0.0)
    if track is None:
        poses, known = np.zeros((len(stamps), 3)), np.ones(len(stamps), dtype=np.bool_)
    else:
        order = np.argsort(odometry_stamps, kind="stable")
        odometry_stamps, moved = odometry_stamps[order], track[order, 2:]
        moved, jumps = bridge_jumps(odometry_stamps, moved)
        poses, known, lost = odometry_at(np.column_stack((odometry_stamps, moved)), stamps)
        remarks += [*jump_remarks(jumps), *lost]
    return _run(messages, known, poses, stamps, sweeps, mounts, remarks, has_odometry=track is not None)


def _sweeps(messages: BagMessages, stamps: FloatArray) -> tuple[FloatArray, list[Remark]]:
    """Read how long each sweep took [s]; 0 for all where that is more than there is from one to the next."""
    sweeps = np.array([sweep_of(message) for message, _ in messages.scans])
    longest = LONGEST_SWEEP * float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    longer = int((np.abs(sweeps) > longest).sum())
    if 2 * longer <= sweeps.size:
        return sweeps, []
    why = "longer than from one scan to the next; the scans are taken to be of one instant each"
    return np.zeros(sweeps.size), [Remark(action="repaired", what="times between beams", why=why, count=longer)]


def _put_in_order(messages: BagMessages, stamps: FloatArray) -> list[Remark]:
    """Sort the scans, and their stamps in place, by time: networks deliver some of them late."""
    late = int((np.diff(stamps) < 0.0).sum())
    if not late:
        return []
    order = np.argsort(stamps, kind="stable")
    stamps[:] = stamps[order]
    messages.scans[:] = [messages.scans[i] for i in order.tolist()]
    return [Remark(action="repaired", what="scans", why="recorded out of order; sorted by their time", count=late)]


def _run(
    messages: BagMessages,
    known: Any,
    poses: FloatArray,
    stamps: FloatArray,
    sweeps: FloatArray,
    mounts: dict[str, Mount],
    remarks: list[Remark],
    *,
    has_odometry: bool,
) -> RecordedRun:
    """Put the scans that have odometry together."""
    scans, rows, broken, echoes, measured, beyond = [], [], 0, 0, 0, 0
    mended: Counter[str] = Counter()
    unplaced: Counter[str] = Counter()
    for row, i in enumerate(np.flatnonzero(known).tolist()):
        message = messages.scans[i][0]
        frame = clean_name(message.header.frame_id)
        if frame not in mounts:
            unplaced[frame] += 1
            continue
        try:
            ranges, dropped = ranges_of(message)
            scan = scan_of(message, ranges, mounts[frame], float(sweeps[i]))
            repair = sector_of(message, ranges.size)[2]
        except InvalidInputError:
            broken += 1
            continue
        echoes += dropped
        measured += int(np.isfinite(ranges).sum())
        beyond += count_beyond(ranges, scan.range_max)
        mended.update([repair] if repair else [])
        scans.append(scan)
        rows.append(row)
    for frame, count in unplaced.items():
        why = f"no transform says where {frame or 'a lidar without a frame'} sits on the robot"
        remarks.append(Remark(action="dropped", what="scans", why=why, count=count, loss=True))
    if broken:
        why = "no finite angles, no ranges, or no sense in their limits"
        remarks.append(Remark(action="dropped", what="scans", why=why, count=broken, loss=True))
    remarks += [
        Remark(action="repaired", what="angles of scans", why=how, count=count) for how, count in mended.items()
    ]
    if echoes:
        remarks.append(Remark(action="dropped", what="echoes", why="the first of each beam is mapped", count=echoes))
    if beyond > MOST_BEYOND * measured:
        why = "beyond the range_max that the scans state, though they differ: a wrong header"
        remarks.append(Remark(action="dropped", what="ranges", why=why, count=beyond, loss=True))
    nothing = mark_of_nothing(scans)
    if nothing is not None:
        scans = [replace(scan, range_max=min(scan.range_max, nothing)) for scan in scans]
        why = f"{nothing:.6g} m, just below range_max, stands in many beams; taken to mean that they met nothing"
        remarks.append(Remark(action="guessed", what="ranges", why=why))
    forwards, backwards = forward(stamps[np.flatnonzero(known)[rows]] if rows else np.zeros(0))
    swept = tuple(replace(scan, stamp=float(stamp)) for scan, stamp in zip(scans, forwards, strict=True))
    return RecordedRun(swept, poses[rows].reshape(-1, 3), None, (*remarks, *backwards), has_odometry)


def _reading_remarks(messages: BagMessages) -> list[Remark]:
    """Say which messages were broken, too many, or changed what should not change."""
    remarks = [
        Remark(action="dropped", what=what, why="broken in the bag", count=count, loss=what == "scans")
        for what, count in messages.broken.items()
    ]
    if messages.tree.changed:
        why, names = "published as static with different values; the last are taken", tuple(messages.tree.changed)
        remarks.append(Remark(action="guessed", what="transforms", why=why, names=names, count=len(names)))
    if messages.surplus:
        why = f"more than {MAX_SCANS}"
        remarks.append(Remark(action="dropped", what="scans", why=why, count=messages.surplus, loss=True))
    return remarks


def _motion(
    messages: BagMessages, lidar: str, options: BagOptions
) -> tuple[FloatArray | None, str | None, list[Remark]]:
    """Read odometry as ``header stamp, recording time, x, y, yaw``; says which frame moves and what was guessed."""
    odometry = np.array(messages.odometry, dtype=np.float64).reshape(-1, 5)
    odometry = odometry[np.isfinite(odometry).all(axis=1)]
    moving = messages.tree.odometry(lidar)
    # Simulators and drivers without wheels publish an odometry that stands still beside transforms that move.
    stands = options.odometry_topic is None and len(odometry) > 0 and not np.ptp(odometry[:, 2:], axis=0).any()
    better = moving is not None and bool(np.ptp(moving.track[:, 2:], axis=0).any())
    outside = last_name(messages.frame).startswith(CORRECTED_FRAMES) and options.odometry_topic is None
    if len(odometry) and not (better and (stands or outside)):
        told = Remark(action="guessed", what="odometry", why=f"poses in {messages.frame} are taken for it")
        base = messages.base or messages.tree.base_of(lidar)
        if messages.base or base is None:
            return odometry, base, [told] if outside else []
        why = f"the odometry does not say what it moves; taken to be {base}"
        return odometry, base, [Remark(action="guessed", what="frame of the robot", why=why)]
    if moving is not None:
        what = "nav_msgs/Odometry never changes" if stands else "no nav_msgs/Odometry"
        what = f"nav_msgs/Odometry holds poses in {messages.frame}" if outside and len(odometry) else what
        why = f"{what}; taken from the transforms {moving.frame} to {moving.base}"
        return moving.track, moving.base, [Remark(action="guessed", what="odometry", why=why)]
    if options.odometry_topic is not None:
        raise InvalidInputError(
            f"no odometry on {options.odometry_topic}", expected="transforms from odom to the robot's base"
        )
    corrected = messages.tree.corrected
    beside = f" (poses in {', '.join(corrected)} are no odometry)" if corrected else ""
    why = f"no odometry in the bag{beside}; found by matching scans alone"
    return None, messages.tree.base_of(lidar), [Remark(action="guessed", what="motion", why=why)]


def _mounts(
    tree: TransformTree, base: str | None, frames: list[str], options: BagOptions, *, measured: bool
) -> tuple[dict[str, Mount], list[Remark]]:
    """Find where each frame of the scans sits on the robot.

    Without odometry it does not matter for the map; the lidar is taken to be the robot where nobody says more.

    Args:
        tree: The transforms.
        base: Frame of the robot.
        frames: Of the scans, the one of most scans first.
        options: The mounting, where it was given.
        measured: Whether there is odometry.

    Returns:
        The mountings that are known.

    Raises:
        InvalidInputError: That of most scans is not.
    """
    if options.mount is not None or options.upside_down:
        given = Mount(Pose2(*(options.mount or (0.0, 0.0, 0.0))), options.upside_down)
        return _given_mounts(tree, base, frames, given)
    if not measured and base is None and len(frames) == 1:
        why = "no transform to the lidar; it is taken to hang upright in the middle of the robot"
        level = Mount(Pose2(), upside_down=False)
        return dict.fromkeys(frames, level), [Remark(action="guessed", what="mounting", why=why)]
    remarks = []
    for frame in (*frames, base or ""):
        found = tree.find(frame)
        if frame and found is not None and found != clean_name(frame):
            why = f"{frame} is not among the transforms; taken to be {found}"
            remarks.append(Remark(action="guessed", what="frame", why=why))
    mounts = {frames[0]: tree.mount(base or "", frames[0])}
    for frame in frames[1:]:
        with contextlib.suppress(InvalidInputError):
            mounts[frame] = tree.mount(base or "", frame)
    for frame, mount in mounts.items():
        if mount.tilt > LEVEL:
            why = f"{frame} is tilted by {math.degrees(mount.tilt):.0f} degrees; taken to be level"
            remarks.append(Remark(action="guessed", what="mounting", why=why))
    return mounts, remarks


def _given_mounts(
    tree: TransformTree, base: str | None, frames: list[str], given: Mount
) -> tuple[dict[str, Mount], list[Remark]]:
    """Take the mounting that was given; of several lidars it is that of those which no transform tells of."""
    mounts = dict.fromkeys(frames, given)
    if len(frames) == 1:
        return mounts, []
    for frame in frames:
        with contextlib.suppress(InvalidInputError):
            mounts[frame] = tree.mount(base or "", frame)
    told = tuple(frame for frame in frames if mounts[frame] is given)
    where = f"the one that was given is taken for {', '.join(told) or 'none'}, for the others that of the transforms"
    why = f"scans of several lidars on one topic; {where}"
    return mounts, [Remark(action="guessed", what="mountings", why=why, names=tuple(frames), count=len(frames))]
