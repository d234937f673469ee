"""Pictures of a recording as the viewer shows it, one a tab: ``python benchmarks/screenshots.py run.rrd OUT``.

Needs no screen and no GPU (Debian: ``mesa-vulkan-drivers libvulkan1``). Unlike ``rerun --screenshot-to`` it waits for
the recording to be loaded, and it can go through all tabs and to any time.
"""

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rerun.experimental import ViewerClient


@dataclass(frozen=True, kw_only=True)
class ScreenshotConfig:
    """What to show."""

    recording: Annotated[Path, tyro.conf.Positional]
    """The ``.rrd`` file."""
    out: Annotated[Path, tyro.conf.Positional]
    """Folder for ``<tab>.png``."""
    tabs: tuple[str, ...] = ()
    """Names of the tabs; all by default."""
    sim_time: float | None = None
    """Time of the simulation to go to [s]; the end by default."""
    stage: int | None = None
    """Step of the timeline ``stage`` to go to instead."""
    settle: float = 2.0
    """How long the viewer may load and draw before a picture is taken [s]."""
    width: int = 1400
    """Width of the pictures [pixels]."""
    port: int = 9877
    """Port of the viewer that is started."""


def take(config: ScreenshotConfig) -> list[Path]:
    """Start a viewer, open the recording, take one picture a tab."""
    config.out.mkdir(parents=True, exist_ok=True)
    pictures = []
    # The viewer is looked for by its name, beside this Python where the environment is not activated.
    os.environ["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)))
    with ViewerClient.spawn(headless=True, port=config.port) as viewer:
        viewer.open(str(config.recording.resolve()))
        time.sleep(config.settle)
        blueprint = viewer.get_blueprint().blueprint
        root, tabs = _tabs(blueprint)
        for name, tab in tabs.items():
            if config.tabs and name not in config.tabs:
                continue
            blueprint[root]["ContainerBlueprint"]["active_tab"] = tab
            viewer.set_blueprint(blueprint, of="recording")
            if config.stage is not None:
                viewer.set_time("stage", sequence=config.stage, play_state="paused")
            elif config.sim_time is not None:
                viewer.set_time("sim_time", duration=config.sim_time, play_state="paused")
            time.sleep(config.settle)
            pictures.append(config.out / f"{name.lower()}.png")
            pictures[-1].write_bytes(viewer.take_screenshot(max_size=config.width))
            for view in viewer.get_state().views:
                print(*(f"{name}: {view.name}: {report}" for report in view.reports), sep="\n", end="")
    return pictures


def _tabs(blueprint: dict[str, Any]) -> tuple[str, dict[str, str]]:
    """Path of the outermost tab container, and its tabs by name."""
    containers = {
        path: content["ContainerBlueprint"] for path, content in blueprint.items() if "ContainerBlueprint" in content
    }
    inner = {f"/{path}" for container in containers.values() for path in container["contents"]}
    root = next(path for path in containers if path not in inner and "active_tab" in containers[path])
    return root, {_name(blueprint[f"/{tab}"]): tab for tab in containers[root]["contents"]}


def _name(content: dict[str, Any]) -> str:
    """What a tab that holds a container or a single view is called."""
    return str(
        next(content[kind]["display_name"] for kind in ("ContainerBlueprint", "ViewBlueprint") if kind in content)
    )


if __name__ == "__main__":
    for picture in take(tyro.cli(ScreenshotConfig)):
        print(picture)
