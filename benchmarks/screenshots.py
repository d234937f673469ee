"""Pictures of a recording as the viewer shows it, one a tab: ``python benchmarks/screenshots.py run.rrd OUT``.

Needs no screen and no GPU (Debian: ``mesa-vulkan-drivers libvulkan1``). Unlike ``rerun --screenshot-to`` it waits for
the recording to be loaded, and it goes through all tabs, tabs within tabs too, at any number of times. Says which
views are empty: what a view shows between its frame and its title is one colour.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from PIL import Image
from rerun.experimental import ViewerClient

# A view without content shows its background, a hint in its middle at most. So many of its pixels must differ from the
# commonest colour: one letter has 20, the hint of an empty view is known by its text [pixels].
LEAST_DRAWN = 40


@dataclass(frozen=True, kw_only=True)
class ScreenshotConfig:
    """What to show."""

    recording: Annotated[Path, tyro.conf.Positional]
    """The ``.rrd`` file."""
    out: Annotated[Path, tyro.conf.Positional]
    """Folder for ``<tab>.png``."""
    tabs: tuple[str, ...] = ()
    """Names of the tabs; all by default."""
    sim_times: tuple[float, ...] = ()
    """Times of the simulation to go to [s]; the end by default."""
    stages: tuple[int, ...] = ()
    """Steps of the timeline ``stage`` to go to."""
    settle: float = 1.0
    """How long the viewer may draw before a picture is taken [s]; four times as long to load."""
    width: int = 1400
    """Width of the pictures [pixels]."""
    port: int = 9877
    """Port of the viewer that is started."""


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture.

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
    moments: list[tuple[str, dict[str, Any]]] = [
        *((f"t{at:05.0f}", {"timeline": "sim_time", "duration": at}) for at in config.sim_times),
        *((f"stage{at:02d}", {"timeline": "stage", "sequence": at}) for at in config.stages),
    ]
    shots = []
    with ViewerClient.spawn(headless=True, port=config.port) as viewer:
        viewer.open(str(config.recording.resolve()))
        time.sleep(4 * config.settle)
        blueprint = viewer.get_blueprint().blueprint
        for name, choices in list(_tabs(blueprint)):
            if config.tabs and name.split(" - ")[0] not in config.tabs:
                continue
            for container, tab in choices:
                blueprint[container]["ContainerBlueprint"]["active_tab"] = tab
            viewer.set_blueprint(blueprint, of="recording")
            for moment, where in moments or [("end", {})]:
                if where:
                    rest = {key: value for key, value in where.items() if key != "timeline"}
                    viewer.set_time(where["timeline"], play_state="paused", **rest)
                time.sleep(config.settle)
                path = config.out / f"{_file_name(name)}-{moment}.png"
                path.write_bytes(viewer.take_screenshot(max_size=config.width))
                shots.append(Shot(name, moment, path, tuple(_empty_views(viewer, path))))
    return shots
