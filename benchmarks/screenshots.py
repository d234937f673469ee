"""Pictures of a recording as the viewer shows it, one a tab: ``python benchmarks/screenshots.py run.rrd OUT``.

Needs no screen and no GPU (Debian: ``mesa-vulkan-drivers libvulkan1``). Unlike ``rerun --screenshot-to`` it waits for
the recording to be loaded, and it goes through all tabs, tabs within tabs too, at any number of times. Says which
views are empty: what a view shows between its frame and its title is one colour.
"""

import contextlib
import itertools
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import tyro
from PIL import Image
from rerun.experimental import ViewerClient, ViewerState

# A view is empty when fewer of its pixels are drawn, of a million: a robot that has seen one corridor fills thousands,
# an empty map none.
LEAST_DRAWN = 100
# Drawn is what differs from the commonest colour by so much in any channel; in plots, whose axes are grey, what has
# colour: channels apart by so much.
DIFFERS, COLOURED = 24, 48
# Columns of a plot with colour in them, at least: the mark of a legend takes ten; a curve along the upper edge shows
# only its rise [pixels].
LEAST_COLUMNS = 14
# Three dots in the upper right corner of a view say that it is still being loaded [pixels].
LOADING = (64, 24)
# The headless window: menu, bar of tabs or title of a view, collapsed time panel, and what of a view may
# belong to the line between two [pixels].
MENU, BAR, TIME_PANEL, EDGE = 38, 28, 29, 4
# How often a picture is asked for before the viewer counts as gone, and how many show an empty view before it is one.
TRIES, LEAST_PICTURES = 20, 10
# How long a viewer may take to start and to load [s], and between two questions.
LONGEST_START, PAUSE = 300.0, 0.2
Area = tuple[float, float, float, float]
T = TypeVar("T")
PLOTS = {"TimeSeries", "BarChart", "StateTimeline"}


@dataclass(frozen=True, kw_only=True)
class ScreenshotConfig:
    """Options of the pictures."""

    recording: Annotated[Path, tyro.conf.Positional]
    """The ``.rrd`` file."""
    out: Annotated[Path, tyro.conf.Positional]
    """Folder for ``<tab>.png``."""
    tabs: tuple[str, ...] = ()
    """Names of the tabs; all by default."""
    unchanging: tuple[str, ...] = ()
    """Names of the tabs that show the same at all moments: one picture each of both timelines."""
    sim_times: tuple[float, ...] = ()
    """Times of the simulation to go to [s]; the end by default."""
    stages: tuple[int, ...] = ()
    """Steps of the timeline ``stage`` to go to."""
    patience: float = 10.0
    """How long a view may stay empty before it counts as empty [s]."""
    window: tuple[int, int] = (1920, 1080)
    """Width and height of the window [pixels]; without a GPU a picture takes time by its size."""
    width: int = 1400
    """Width of the pictures [pixels]; wider ones are made smaller."""
    port: int = 0
    """Port of the viewer that is started; a free one by default: at a port in use it would be another one's."""


@dataclass(frozen=True, slots=True)
class Shot:
    """Picture of one tab at one moment.

    Attributes:
        tab: Names of the tabs that it shows, from the outermost.
        moment: ``sim_time`` or ``stage`` with its value, or ``end``.
        path: The file.
        empty: Names of views that show nothing.
    """

    tab: str
    moment: str
    path: Path
    empty: tuple[str, ...]


def take(config: ScreenshotConfig) -> list[Shot]:
    """Start a viewer, open the recording, take one picture a tab and moment."""
    config.out.mkdir(parents=True, exist_ok=True)
    shots = []
    with _open_viewer(config) as viewer:
        blueprint = _insist(viewer.get_blueprint).blueprint
        for name, choices in list(_tabs(blueprint)):
            if config.tabs and name.split(" - ")[0] not in config.tabs:
                continue
            for container, tab in choices:
                blueprint[container]["ContainerBlueprint"]["active_tab"] = tab
            _insist(lambda: viewer.set_blueprint(blueprint, of="recording"))
            for moment, where in _moments(config, unchanging=name.split(" - ")[0] in config.unchanging):
                if where:
                    _insist(partial(viewer.set_time, play_state="paused", **where))
                picture, empty = _take_full_picture(viewer, blueprint, config.patience)
                path = config.out / f"{_file_name(name)}-{moment}.png"
                shots.append(Shot(name, moment, path, empty))
                picture.thumbnail((config.width, config.width))
                picture.save(path)
    return shots


def _moments(config: ScreenshotConfig, *, unchanging: bool) -> list[tuple[str, dict[str, Any]]]:
    """List the moments to go to, with their names; of a tab that does not change the first of each timeline."""
    most = 1 if unchanging else None
    moments: list[tuple[str, dict[str, Any]]] = [
        *((f"t{at:05.0f}", {"timeline": "sim_time", "duration": at}) for at in config.sim_times[:most]),
        *((f"stage{at:02d}", {"timeline": "stage", "sequence": at}) for at in config.stages[:most]),
    ]
    return moments or [("end", {})]


@contextlib.contextmanager
def _open_viewer(config: ScreenshotConfig) -> Iterator[ViewerClient]:
    """Start a viewer of its own without a window, with the recording loaded."""
    port = config.port or _free_port()
    size = "x".join(map(str, config.window))
    command = [_viewer(), "--headless", "--hide-welcome-screen", "--port", str(port), "--window-size", size]
    # The launcher leaves its viewer behind unless both are ended.
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        viewer = _connect(f"rerun+http://127.0.0.1:{port}/proxy")
        _insist(lambda: viewer.open(str(config.recording.resolve())))
        _wait_until(lambda: _is_loaded(_insist(viewer.get_state)))
        yield viewer
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _is_loaded(state: ViewerState) -> bool:
    return bool(state.views) and not state.loading


def _connect(address: str) -> ViewerClient:
    """Connect to a viewer that is just being started."""
    found: list[ViewerClient] = []

    def answers() -> bool:
        with contextlib.suppress(Exception):  # the client raises several kinds while nobody listens yet
            viewer = ViewerClient(address)
            viewer.get_state()
            found.append(viewer)
        return bool(found)

    _wait_until(answers)
    return found[0]


def _wait_until(done: Callable[[], bool]) -> None:
    """Wait for the viewer.

    Raises:
        TimeoutError: It takes longer than :data:`LONGEST_START`.
    """
    end = time.monotonic() + LONGEST_START
    while not done():
        if time.monotonic() > end:
            raise TimeoutError(f"the viewer is not there after {LONGEST_START:g} s")
        time.sleep(PAUSE)


def _take_full_picture(
    viewer: ViewerClient, blueprint: dict[str, Any], patience: float
) -> tuple[Image.Image, tuple[str, ...]]:
    """Take pictures until no view is empty, or for so long [s]; returns the last one and what is empty on it.

    A viewer that comes to nothing because other work takes the machine is given :data:`LEAST_PICTURES`, however long.
    """
    end = time.monotonic() + patience
    for number in itertools.count(1):
        picture = _take_picture(viewer)
        empty = tuple(_find_empty(viewer, blueprint, picture))
        if not empty or (number >= LEAST_PICTURES and time.monotonic() > end):
            break
        time.sleep(PAUSE)
    return picture, empty


def _take_picture(viewer: ViewerClient) -> Image.Image:
    return Image.open(BytesIO(_insist(viewer.take_screenshot))).convert("RGB")


def _insist(ask: Callable[[], T]) -> T:
    """Ask the viewer; on a machine with other work to do, drawing without a GPU, it is given more than one chance."""
    for _ in range(TRIES - 1):
        with contextlib.suppress(TimeoutError):
            return ask()
    return ask()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _viewer() -> str:
    """Find the viewer that came with this Python's rerun-sdk, whatever the search path."""
    beside = Path(sys.executable).with_name("rerun")
    return str(beside) if beside.exists() else "rerun"


def _tabs(blueprint: dict[str, Any]) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """List every combination of a tab and the tabs within it: its name, and which tab each container then shows."""
    yield from _choices(blueprint, _root(blueprint))


def _choices(blueprint: dict[str, Any], path: str) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    container = _containers(blueprint).get(path)
    if container is None:
        yield "", []
        return
    children = container["contents"]
    if container["container_kind"] == "Tabs":
        for child in children:
            for name, choices in _choices(blueprint, f"/{child}"):
                own = _name(blueprint[f"/{child}"])
                yield " - ".join(filter(None, (own, name))), [(path, child), *choices]
        return
    # Tabs side by side are gone through one after the other, the rest as they open.
    several = [list(_choices(blueprint, f"/{child}")) for child in children]
    first = [found[0] for found in several]
    name = " - ".join(filter(None, (name for name, _ in first)))
    yield name, [choice for _, choices in first for choice in choices]
    for at, found in enumerate(several):
        for name, choices in found[1:]:
            rest = [choice for other, (_, own) in enumerate(first) if other != at for choice in own]
            yield name, [*rest, *choices]


def _containers(blueprint: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Collect containers by path; of one value in a list the viewer gives the value alone."""
    lists = ("contents", "col_shares", "row_shares")
    return {
        path: {
            key: [value] if key in lists and not isinstance(value, list) else value
            for key, value in content["ContainerBlueprint"].items()
        }
        for path, content in blueprint.items()
        if "ContainerBlueprint" in content
    }


def _name(content: dict[str, Any]) -> str:
    """Name a tab that holds a container or a single view as the viewer does."""
    return str(
        next(content[kind]["display_name"] for kind in ("ContainerBlueprint", "ViewBlueprint") if kind in content)
    )


def _places(blueprint: dict[str, Any], path: str, area: Area) -> Iterator[tuple[str, Area]]:
    """Find the ids of the views on the tabs in front, and what of the window each takes, below its own title."""
    x0, y0, x1, y1 = area
    container = _containers(blueprint).get(path)
    if container is None:
        yield path.rsplit("/", 1)[-1], (x0, y0 + BAR, x1, y1)
        return
    children = [f"/{child}" for child in container["contents"]]
    kind = container["container_kind"]
    if kind == "Tabs":
        yield from _places(blueprint, f"/{container['active_tab']}", (x0, y0 + BAR, x1, y1))
        return
    columns = {"Horizontal": len(children), "Vertical": 1}.get(kind) or container["grid_columns"]
    rows = -(-len(children) // columns)
    xs = _divide(x0, x1, container.get("col_shares") or [1.0] * columns)
    ys = _divide(y0, y1, container.get("row_shares") or [1.0] * rows)
    for number, child in enumerate(children):
        row, column = divmod(number, columns)
        yield from _places(blueprint, child, (xs[column], ys[row], xs[column + 1], ys[row + 1]))


def _divide(first: float, last: float, shares: Sequence[float]) -> list[float]:
    ends = np.concatenate(([0.0], np.cumsum(shares))) / sum(shares)
    return [float(first + (last - first) * end) for end in ends]


def _root(blueprint: dict[str, Any]) -> str:
    """Find the outermost container."""
    inner = {f"/{path}" for container in _containers(blueprint).values() for path in container["contents"]}
    return next(path for path in _containers(blueprint) if path not in inner)


def _find_empty(viewer: ViewerClient, blueprint: dict[str, Any], picture: Image.Image) -> Iterator[str]:
    """Find the names of the views that show nothing, and what the viewer complains of."""
    pixels = np.array(picture).astype(np.int16)
    views = {view.view_id: view for view in _insist(viewer.get_state).views}
    area = (0.0, float(MENU), float(picture.width), float(picture.height - TIME_PANEL))
    for place, (x0, y0, x1, y1) in _places(blueprint, _root(blueprint), area):
        view = views.get(place)
        if view is None:  # the viewer made nothing of it
            yield _name(blueprint[f"/view/{place}"])
            continue
        inside = pixels[round(y0) + EDGE : round(y1) - EDGE, round(x0) + EDGE : round(x1) - EDGE]
        if is_empty(inside, plot=view.view_class in PLOTS):
            yield f"{view.name} ({view.view_class})"
        yield from (f"{view.name}: {report}" for report in view.reports)


def is_empty(pixels: "np.ndarray[Any, Any]", *, plot: bool) -> bool:
    """Check whether a picture of a view shows nothing, shape (rows, columns, 3).

    What says that the viewer still loads is nothing, and a plot with a legend alone is empty.
    """
    if plot:
        columns = (np.ptp(pixels, axis=-1) >= COLOURED).any(axis=0)
        return bool(columns.sum() < LEAST_COLUMNS)
    # As one number a colour: finding the commonest of three columns takes a hundred times as long as drawing them.
    red, green, blue = (pixels[..., channel].astype(np.int32) for channel in range(3))
    _, places, counts = np.unique((red << 16) + (green << 8) + blue, return_index=True, return_counts=True)
    commonest = pixels.reshape(-1, 3)[places[counts.argmax()]]
    drawn = np.abs(pixels - commonest).max(axis=-1) >= DIFFERS
    drawn[: LOADING[1], -LOADING[0] :] = False
    return bool(drawn.mean() < LEAST_DRAWN / 1e6)


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in name.lower()).strip("-")


if __name__ == "__main__":
    for shot in take(tyro.cli(ScreenshotConfig)):
        print(shot.path, *(f"\n  EMPTY {name}" for name in shot.empty), sep="")
