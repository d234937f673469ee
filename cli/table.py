"""The table of commands, and how tyro reads a line with it."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Union

import tyro

# Private to tyro, and the only way to say wrong usage in one line. pyproject.toml bounds the version; a kind of error
# that is not known here is told in tyro's own words.
from tyro._errors import on_parse_error

from closedrooms.cli.options import HELP, HELP_ALL, Command, option_names, options_class
from closedrooms.cli.usage import Place, UsageError, explain
from closedrooms.core.errors import InvalidInputError

TOURS = ("networkx", "ortools", "skimage")
SIMULATION = ("pybullet", "mapbox_earcut", "skimage")
TABLES = ("pyarrow", "matplotlib")
COMMANDS = (
    Command(
        "run",
        "Simulate a robot in a building with closed doors, map it, predict the closed rooms, plan a tour.",
        "pipeline.config:RunConfig",
        "pipeline.runs:run_all",
        needs=(*SIMULATION, *TOURS),
    ),
    Command(
        "predict",
        "Predict the rooms behind the closed doors of a ROS map.",
        "pipeline.config:PredictConfig",
        "pipeline.predict:predict_map",
    ),
    Command(
        "cover",
        "Plan a coverage tour on a ROS map.",
        "pipeline.config:CoverConfig",
        "pipeline.cover:cover_map",
        needs=TOURS,
    ),
    Command(
        "map",
        "Build the map of a recorded run.",
        "pipeline.config:MapConfig",
        "pipeline.map:map_log",
    ),
    Command(
        "doors",
        "Propose closed doors on a ROS map, from the map alone.",
        "pipeline.propose_doors_config:DoorsConfig",
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
        "pipeline.view_config:ViewConfig",
        "pipeline.view:view_recording",
    ),
    Command(
        "worlds list",
        "List the bundled worlds, one a line, its name first.",
        "pipeline.config:ListWorlds",
        "cli.work:list_worlds",
    ),
    Command(
        "worlds show", "Draw a floor plan.", "pipeline.config:ShowWorld", "cli.work:show_world", needs=("matplotlib",)
    ),
    Command("worlds generate", "Generate a floor plan.", "pipeline.config:GenerateWorld", "cli.work:generate_world"),
    Command(
        "worlds convert",
        "Convert a floor plan to another format.",
        "pipeline.config:ConvertWorld",
        "cli.work:convert_world",
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

MARKERS = (
    tyro.conf.OmitSubcommandPrefixes,
    tyro.conf.AvoidSubcommands,
    tyro.conf.PositionalMetavarFromFieldName,
)
ABOUT = """Predicts the layout of rooms behind closed doors and completes a robot's map with them.

closedrooms COMMAND --help shows the options that people set, --help-all every one.

closedrooms --tyro-print-completion bash (or zsh, fish) prints what completes commands and options in a shell,
closedrooms --version the version.
"""


def read_line(words: Sequence[str]) -> Any:
    """Read one line.

    Returns:
        The options of a command, see :func:`closedrooms.cli.options.options_class`.

    Raises:
        UsageError: No such command, option or value.
        InvalidInputError: A value that a configuration refuses, a file of settings that cannot be used.
        SystemExit: The help or a completion script was printed.
    """
    command = named_command(words)
    rest = list(words) if command is None else list(words[len(command.name.split()) :])
    brief = bool(HELP & set(rest)) and HELP_ALL not in rest
    options = None if command is None else options_class(command, rest, brief=brief)

    def complain(event: Any) -> None:
        line = explain(event, _place(words, command, options))
        if line is not None:
            raise UsageError(line)

    completing = bool(words) and words[0].startswith("--tyro-")
    with on_parse_error(complain), _naming_the_file(rest, options):
        return tyro.cli(
            _table(command, options, completing=completing),
            prog="closedrooms",
            description=ABOUT,
            args=["--help" if word == HELP_ALL else word for word in words],
            config=MARKERS,
        )


@contextlib.contextmanager
def _naming_the_file(words: Sequence[str], options: type[Any] | None) -> Iterator[None]:
    """Say which file a value that is refused comes from, where it does not stand on the line."""
    try:
        yield
    except InvalidInputError as error:
        option = str(error).split(" ", 1)[0]
        if options is None or options.about["file"] is None or any(word.split("=")[0] == option for word in words):
            raise
        raise InvalidInputError(str(error), where=options.about["file"]) from error


def named_command(words: Sequence[str]) -> Command | None:
    """Return the command that a line begins with."""
    for command in COMMANDS:
        parts = command.name.split()
        if list(words[: len(parts)]) == parts:
            return command
    return None


@dataclass(frozen=True)
class _NotAsked:
    """Stands for the options of the commands that a line does not name, which nobody looks at."""


def _table(chosen: Command | None, options: type[Any] | None, *, completing: bool) -> Any:
    """The union of all commands, as tyro takes it.

    Args:
        chosen: The command that the line names.
        options: Its options as resolved.
        completing: The options of all the others are wanted too.
    """
    rows: dict[str, Any] = {}
    groups: dict[str, dict[str, Any]] = {name: {} for name in GROUPS}
    for command in COMMANDS:
        *group, name = command.name.split()
        own = options if command is chosen else options_class(command) if completing else _NotAsked
        row = _row(name, _description(command, options if command is chosen else None), own)
        if group:
            groups[group[0]][name] = row
            rows[group[0]] = _row(group[0], GROUPS[group[0]], Union[tuple(groups[group[0]].values())])  # noqa: UP007
        else:
            rows[name] = row
    return Union[tuple(rows.values())]  # noqa: UP007


def _row(name: str, description: str, options: Any) -> Any:
    about = tyro.conf.subcommand(
        name=name, description=description, prefix_name=False, constructor_factory=lambda: options
    )
    return Annotated[Any, about]


def _description(command: Command, options: type[Any] | None) -> str:
    if options is None or not options.about["hidden"]:
        return command.summary
    groups = ", ".join(f"--{name}.*" for name in options.about["hidden"])
    return f"{command.summary} --help-all shows the settings of each stage too: {groups}."


def _place(words: Sequence[str], command: Command | None, options: type[Any] | None) -> Place:
    """Where on the line tyro stopped: before a command, or among its options."""
    if command is not None and options is not None:
        method = options.about["method"]
        return Place(tuple(words), f"closedrooms {command.name}", options=tuple(option_names(options)), method=method)
    group = words[0] if words and words[0] in GROUPS else None
    if group is not None:
        names = [c.name.split()[1] for c in COMMANDS if c.name.split()[0] == group]
        return Place(tuple(words), f"closedrooms {group}", commands=tuple(names))
    names = list(dict.fromkeys(c.name.split()[0] for c in COMMANDS))
    return Place(tuple(words), "closedrooms", commands=tuple(names))
