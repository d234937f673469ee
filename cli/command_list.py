"""Which commands there are, and the help of the program itself; neither tyro nor any command is imported."""

import shutil
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

HELP, HELP_ALL = {"-h", "--help"}, "--help-all"


@dataclass(frozen=True, slots=True)
class Command:
    """One command.

    Attributes:
        name: As it is typed, ``worlds list`` for one in a group.
        summary: One line for people.
        config: Its configuration class, ``module:name``.
        work: The function that does it, ``module:name``: from a configuration and ``progress`` to a report.
        needs: Packages that not every installation has, as they are imported, and that it cannot do without.
    """

    name: str
    summary: str
    config: str
    work: str
    needs: tuple[str, ...] = ()


TOURS = ("networkx", "ortools", "skimage")
SIMULATION = ("pybullet", "mapbox_earcut", "skimage")
TABLES = ("pyarrow", "matplotlib")
COMMANDS = (
    Command(
        "run",
        "Simulate a robot in a building with closed doors, map it, predict the closed rooms, plan a tour.",
        "pipeline.options.run:RunConfig",
        "pipeline.runs:run_all",
        needs=(*SIMULATION, *TOURS),
    ),
    Command(
        "predict",
        "Predict the rooms behind the closed doors of a ROS map.",
        "pipeline.options.predict:PredictConfig",
        "pipeline.predict:predict_map",
    ),
    Command(
        "cover",
        "Plan a coverage tour on a ROS map.",
        "pipeline.options.cover:CoverConfig",
        "pipeline.cover:cover_map",
        needs=TOURS,
    ),
    Command(
        "map",
        "Build the map of a recorded run.",
        "pipeline.options.map:MapConfig",
        "pipeline.map:map_log",
    ),
    Command(
        "doors",
        "Propose closed doors on a ROS map, from the map alone.",
        "pipeline.options.doors:DoorsConfig",
        "pipeline.propose_doors:doors_map",
    ),
    Command(
        "edit",
        "Mark closed doors on a map in the browser and see the rooms behind them at once.",
        "web.config:EditConfig",
        "web.server:edit_map",
    ),
    Command(
        "view",
        "Open the recording of a result in the rerun viewer.",
        "pipeline.options.view:ViewConfig",
        "pipeline.view:view_recording",
    ),
    Command(
        "worlds list",
        "List the bundled worlds, one a line, its name first.",
        "pipeline.options.worlds:ListWorlds",
        "cli.work:report_worlds",
    ),
    Command(
        "worlds show",
        "Draw a floor plan.",
        "pipeline.options.worlds:ShowWorld",
        "cli.work:report_world",
        needs=("matplotlib",),
    ),
    Command(
        "worlds generate",
        "Generate a floor plan.",
        "pipeline.options.worlds:GenerateWorld",
        "cli.work:report_generated",
    ),
    Command(
        "worlds convert",
        "Convert a floor plan to another format.",
        "pipeline.options.worlds:ConvertWorld",
        "cli.work:report_converted",
    ),
    Command(
        "dataset",
        "Make maps of many buildings with closed doors, and what is really behind them.",
        "experiments.dataset.config:DatasetConfig",
        "experiments.dataset.dataset:dataset",
        needs=(*SIMULATION, *TOURS, "pyarrow"),
    ),
    Command(
        "evaluate",
        "Compare predictions with the truth over a dataset.",
        "experiments.evaluation.config:EvaluateConfig",
        "experiments.evaluation.evaluate:evaluate",
        needs=(*TOURS, *TABLES),
    ),
    Command(
        "robustness",
        "Find at which noise the prediction starts to suffer, and which stage gives way first.",
        "experiments.robustness.config:RobustnessConfig",
        "experiments.robustness.sweep:robustness",
        needs=(*SIMULATION, *TOURS, *TABLES),
    ),
    Command(
        "train",
        "Train the network of the method learned on the rooms of datasets.",
        "experiments.training.config:TrainConfig",
        "experiments.training.train:train",
        needs=("torch", "onnx", "onnxscript", "matplotlib"),
    ),
)
GROUPS = {"worlds": "List, show, generate and convert floor plans."}
ABOUT = """Predicts the layout of rooms behind closed doors and completes a robot's map with them.

closedrooms COMMAND --help shows the options that people set, --help-all every one.

closedrooms --tyro-print-completion bash (or zsh, fish) prints what completes commands and options in a shell,
closedrooms --version the version.
"""
# Columns of the help: no wider than a line is read with ease.
WIDEST = 100


def wants_overview(words: Sequence[str]) -> bool:
    """Tell whether a line asks for the help of the program, or says nothing."""
    return len(words) <= 1 and set(words) <= {*HELP, HELP_ALL}


def overview() -> str:
    """Return the help of the program: what it does, and every command in a line."""
    rows = {command.name.split()[0]: command.summary for command in COMMANDS} | GROUPS
    width = min(shutil.get_terminal_size().columns, WIDEST)
    paragraphs = [textwrap.fill(" ".join(text.split()), width) for text in ABOUT.strip().split("\n\n")]
    indent = max(map(len, rows)) + 4
    lines = [
        textwrap.fill(summary, width, initial_indent=f"  {name}".ljust(indent), subsequent_indent=" " * indent)
        for name, summary in rows.items()
    ]
    return "\n\n".join(
        ["usage: closedrooms [-h] [--version] COMMAND ...", *paragraphs, "\n".join(["commands:", *lines])]
    )
