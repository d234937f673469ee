"""Predict rooms that were erased from maps of real, furnished places, and compare with what was erased.

    python benchmarks/quality/real_maps.py ../shared/data/maps [--pictures FOLDER] [--maps NAME ...]

The maps (goldleaf3i/declutter-reconstruct, MIT) are not part of this repository; no picture of them is either. What is
erased stands in ``ROOMS``, in pixels of each picture (x to the right, y down), measured by eye on the maps:

- ``door``: the two jambs of the doorway that is given to the predictor;
- ``walls``: further gaps through which the room is open, shut by a wall, since a closed room has none;
- ``seed``: a place inside.

A room is what is free and connected with the seed once the door and these walls are drawn (two cells thick), with the
furniture that it surrounds. It becomes unknown, and so does what only it shows: occupied cells within 0.4 m of it that
no other free cell comes near. The door's leaf and the walls stay as a robot in front of the closed door sees them.

Each room is erased by itself and all of a map at once; ``paper`` with both structures and ``best`` predict it, on the
map as it is and after the clutter filter (``predictor.clutter``). IoU is over cells, with the erased room as truth.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from closedrooms.core.arrays import BoolArray
from closedrooms.core.door import ClosedDoor, Point
from closedrooms.core.files.rosmap import read_map
from closedrooms.core.grid import OCCUPIED, UNKNOWN, GridFrame, OccupancyGrid
from closedrooms.core.room import Room
from closedrooms.experiments.evaluation.scoring.scores import iou, room_masks
from closedrooms.predictor.methods import predict
from closedrooms.predictor.structure.clutter import filter_clutter

Pixel = tuple[int, int]
Gap = tuple[Pixel, Pixel]
# What a room's furniture may be apart from its free cells, and how far from a room its own walls lie [m].
CLOSING, BESIDE = 0.15, 0.4
# Free areas below this are specks [square metres].
SPECK = 0.5
METHODS = ("paper", "rose", "best")


@dataclass(frozen=True)
class Erased:
    """Room to erase, in pixels of the picture."""

    map: str
    name: str
    door: Gap
    seed: Pixel
    walls: tuple[Gap, ...] = ()


ROOMS = (
    Erased("g4s_y2", "classroom-a", ((521, 124), (495, 157)), (430, 60)),
    Erased("g4s_y2", "classroom-b", ((475, 178), (448, 209)), (400, 110)),
    Erased("g4s_y2", "classroom-d", ((396, 270), (380, 288)), (300, 240), (((361, 309), (350, 322)),)),
    Erased("g4s_y2", "office-f", ((227, 462), (238, 450)), (165, 420),
           (((180, 479), (196, 494)), ((196, 494), (213, 477)))),
    Erased("g4s_y2", "office-g", ((217, 528), (205, 541)), (260, 510),
           (((250, 490), (267, 472)), ((267, 472), (284, 488)))),
    Erased("g4s_y2", "office-h", ((565, 72), (555, 86)), (560, 40)),
    Erased("g4s_y2", "lobby-i", ((565, 72), (590, 103)), (600, 70)),
    Erased("movecare_map", "side-room", ((335, 368), (335, 383)), (360, 375)),
    Erased("UMA_236", "laboratory-1", ((219, 852), (219, 868)), (150, 890),
           (((81, 880), (81, 897)), ((189, 934), (238, 936)), ((236, 866), (236, 938)))),
    Erased("UMA_236", "laboratory-2", ((220, 997), (220, 1014)), (160, 970),
           (((107, 998), (107, 1019)), ((189, 934), (238, 936)))),
    Erased("aaf-15", "closet", ((449, 1908), (448, 1924)), (463, 1920),
           (((450, 1880), (450, 1896)), ((448, 1936), (447, 1952)))),
    Erased("aaf-15", "stairs", ((282, 994), (298, 994)), (310, 960), (((301, 994), (317, 994)),)),
    Erased("aaf-15", "office", ((483, 2711), (498, 2711)), (500, 2740)),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ErasedCase:
    """Map with rooms erased: what the predictor gets, and the cells of each erased room by its door."""

    name: str
    grid: OccupancyGrid
    doors: tuple[ClosedDoor, ...]
    truth: dict[str, BoolArray]


def open_map(folder: Path, name: str) -> OccupancyGrid:
    """Read a map of the folder; a picture without a YAML is taken at 0.05 m."""
    path = folder / f"{name}.yaml"
    if path.exists():
        return read_map(path)
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch) / "map.yaml"
        picture = (folder / f"{name}.pgm").resolve()
        made.write_text(f"image: {picture}\nresolution: 0.05\norigin: [0, 0, 0]\n")
        return read_map(made)


def cell_of(frame: GridFrame, pixel: Pixel) -> tuple[int, int]:
    return frame.rows - 1 - pixel[1], pixel[0]


def point_of(frame: GridFrame, pixel: Pixel) -> Point:
    x, y = frame.to_points(np.array(cell_of(frame, pixel)))
    return float(x), float(y)


def gap_cells(frame: GridFrame, gap: Gap) -> BoolArray:
    """Find the cells of a wall two cells thick between two pixels."""
    import cv2

    drawn = np.zeros(frame.shape, dtype=np.uint8)
    (row_a, col_a), (row_b, col_b) = cell_of(frame, gap[0]), cell_of(frame, gap[1])
    cv2.line(drawn, (col_a, row_a), (col_b, row_b), 1, 2)
    return drawn.astype(np.bool_)


def room_cells(grid: OccupancyGrid, shut: BoolArray, seed: tuple[int, int]) -> BoolArray:
    """Find the room around a seed: free, connected, with the furniture that it surrounds."""
    import cv2
    from scipy.ndimage import binary_fill_holes

    _, labels = cv2.connectedComponents((grid.free & ~shut).astype(np.uint8), connectivity=4)
    if labels[seed] == 0:
        raise ValueError(f"the seed {seed} is not free")
    room = labels == labels[seed]
    size = 2 * round(CLOSING / grid.frame.resolution) + 1
    closed = cv2.morphologyEx(room.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((size, size), dtype=np.uint8))
    other = grid.free & ~room
    return np.asarray(binary_fill_holes(closed.astype(np.bool_) & ~other & ~shut), dtype=np.bool_)


def large_parts(mask: BoolArray, resolution: float) -> BoolArray:
    """Remove the specks of a mask: free cells in and behind a wall that a noisy range put there."""
    import cv2

    _, labels, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    large = figures[:, cv2.CC_STAT_AREA] >= SPECK / resolution**2
    large[0] = False
    return np.asarray(large[labels], dtype=np.bool_)


def erase_rooms(grid: OccupancyGrid, rooms: Sequence[Erased], name: str) -> ErasedCase:
    """Erase some rooms of the map and shut their doors."""
    import cv2

    frame = grid.frame
    shut = np.zeros(frame.shape, dtype=np.bool_)
    for room in rooms:
        for gap in (room.door, *room.walls):
            shut |= gap_cells(frame, gap)
    truth = {room.name: room_cells(grid, shut, cell_of(frame, room.seed)) for room in rooms}
    gone = np.any(list(truth.values()), axis=0)
    left = large_parts(grid.free & ~gone & ~shut, frame.resolution)
    size = 2 * round(BESIDE / frame.resolution) + 1
    kernel = np.ones((size, size), dtype=np.uint8)
    near_gone, near_left = (cv2.dilate(mask.astype(np.uint8), kernel).astype(np.bool_) for mask in (gone, left))
    cells = np.array(grid.cells)
    cells[gone | (near_gone & ~near_left)] = UNKNOWN
    cells[shut & near_left] = OCCUPIED
    doors = []
    for room in rooms:
        a, b = (point_of(frame, pixel) for pixel in room.door)
        width = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        doors.append(ClosedDoor(room.name, ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), (a, b), width))
    return ErasedCase(name, OccupancyGrid(frame, cells), tuple(doors), truth)


def erased_cases(folder: Path, names: Sequence[str]) -> Iterator[ErasedCase]:
    """Yield every room by itself, then all of a map at once."""
    for name in names:
        grid = open_map(folder, name)
        rooms = [room for room in ROOMS if room.map == name]
        for room in rooms:
            yield erase_rooms(grid, [room], f"{name}: {room.name}")
        if len(rooms) > 1:
            yield erase_rooms(grid, rooms, f"{name}: all {len(rooms)}")


def compare_rooms(case: ErasedCase, predicted: Sequence[Room]) -> dict[str, float]:
    """Measure the IoU of each erased room with the room predicted behind its door, 0 without one."""
    frame = case.grid.frame
    grown = frame
    for room in predicted:
        grown = grown.covering(*room.polygon.bounds)
    masks = dict(zip((room.doors[0] for room in predicted), room_masks(predicted, grown), strict=True))
    by_door = {door: masks[room.doors[0]] for room in predicted for door in room.doors}
    figures = {}
    for door, truth in case.truth.items():
        held = OccupancyGrid(frame, truth.astype(np.int8)).on(grown).cells == 1
        figures[door] = iou(held, by_door[door]) if door in by_door else 0.0
    return figures


def draw_case(path: Path, case: ErasedCase, predicted: dict[str, Sequence[Room]]) -> None:
    """Draw the erased map, the truth (green) and what each method predicts (outlines)."""
    import cv2
    import shapely

    frame = case.grid.frame
    shown = np.full((*frame.shape, 3), 200, dtype=np.uint8)
    for mask in case.truth.values():
        shown[mask] = (170, 235, 170)
    shown[case.grid.free], shown[case.grid.occupied] = (255, 255, 255), (0, 0, 0)
    inside = np.argwhere(np.any(list(case.truth.values()), axis=0))
    low, high = np.maximum(inside.min(axis=0) - 100, 0), inside.max(axis=0) + 100
    scale = max(1, round(900 / int((high - low).max())))
    panels = []
    for method, rooms in predicted.items():
        panel = cv2.resize(shown[low[0] : high[0], low[1] : high[1]], None, fx=scale, fy=scale, interpolation=0)
        for room in rooms:
            for part in shapely.get_parts(room.polygon):
                corners = (frame.to_corners(np.array(part.exterior.coords)) - low[::-1]) * scale
                cv2.polylines(panel, [corners.round().astype(np.int32)], True, (200, 60, 0), 2)
        for door in case.doors:
            assert door.segment is not None
            ends = (frame.to_corners(np.array(door.segment)) + 0.5 - low[::-1]) * scale
            cv2.line(panel, *(tuple(int(v) for v in end) for end in ends), (0, 0, 230), 3)
        panel = np.ascontiguousarray(panel[::-1])
        cv2.putText(panel, method, (6, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 160), 2)
        panels.append(np.pad(panel, ((2, 2), (2, 2), (0, 0))))
    cv2.imwrite(str(path), np.hstack(panels))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pictures", type=Path, help="folder for one picture a case")
    parser.add_argument("--maps", nargs="*", default=list(dict.fromkeys(room.map for room in ROOMS)))
    options = parser.parse_args()
    columns = [(method, clean) for method in METHODS for clean in (False, True)]
    heads = [f"{method}{', filtered' if clean else ''}" for method, clean in columns]
    print(
        f"| map | erased | m2 | {' | '.join(heads)} | CPU s |\n| --- | --- | {'---: | ' * (len(heads) + 2)}", flush=True
    )
    totals: dict[bool, list[list[float]]] = {False: [], True: []}
    for case in erased_cases(options.folder, options.maps):
        start = time.process_time()
        tidy = filter_clutter(case.grid)
        outcomes = {}
        for head, (method, clean) in zip(heads, columns, strict=True):
            outcomes[head] = predict(tidy if clean else case.grid, case.doors, method)
        scores = {head: compare_rooms(case, outcome.rooms) for head, outcome in outcomes.items()}
        name, what = case.name.split(": ")
        several = len(case.doors) > 1
        for door, truth in case.truth.items():
            row = [scores[head][door] for head in heads]
            totals[several].append(row)
            area = truth.sum() * case.grid.frame.resolution**2
            cpu = f"{time.process_time() - start:.1f}" if door == next(iter(case.truth)) else ""
            label = f"{door} ({what})" if several else door
            print(f"| {name} | {label} | {area:.1f} | {' | '.join(f'{v:.2f}' for v in row)} | {cpu} |", flush=True)
        for head, outcome in outcomes.items():
            for door, reason in outcome.failures.items():
                print(f"<!-- {case.name}, {head}: {door} not predicted: {reason} -->")
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            draw_case(options.pictures / f"{case.name.replace(': ', '-').replace(' ', '-')}.png", case,
                 {head: outcome.rooms for head, outcome in outcomes.items()})  # fmt: skip
    for several, rows in totals.items():
        if rows:
            text = "mean, all of a map at once" if several else "mean, one at a time"
            print(f"| {text} | {len(rows)} | | {' | '.join(f'{v:.2f}' for v in np.mean(rows, axis=0))} | |")


if __name__ == "__main__":
    main()
