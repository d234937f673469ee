"""The command line: one function a command, options from the configuration dataclasses.

Exit status: 0 done, 1 bad input, 2 wrong usage, 3 part of the work failed and the rest is written, 130 on Ctrl-C.
Heavy libraries are imported by the command that needs them, so that ``--help`` is quick.
"""

import os
import sys
from argparse import ArgumentError, ArgumentParser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from closedrooms.core.errors import ClosedroomsError

if TYPE_CHECKING:
    from closedrooms.pipeline.config import RunConfig
    from closedrooms.pipeline.progress import Terminal


class Result(Protocol):
    """What every command that writes a folder returns."""

    @property
    def folder(self) -> Path:
        """What was written."""

    @property
    def title(self) -> str:
        """Head of the table."""

    @property
    def failures(self) -> dict[str, str]:
        """What failed and why."""

    def table(self) -> Sequence[Sequence[str]]:
        """Rows; the first is the head."""


DONE, BAD_INPUT, WRONG_USAGE, PARTLY_FAILED, INTERRUPTED = 0, 1, 2, 3, 130
# Failures that are named on the terminal; the rest stands in files.
MOST_NAMED = 10

Config = TypeVar("Config")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    Args:
        arguments: Words after the program's name; ``sys.argv`` by default.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in {"-h", "--help"}:
        _say(_usage())
        return DONE if words else WRONG_USAGE
    if words[0] == "--version":
        from importlib.metadata import version

        _say(f"closedrooms {version('closedrooms')}")
        return DONE
    command = COMMANDS.get(words[0])
    if command is None:
        _complain(f"unknown command {words[0]!r}; expected one of {', '.join(COMMANDS)}")
        return WRONG_USAGE
    return _guarded(command[1], words[1:])


def _guarded(command: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """Run a command; what a user can cause is one line and a status, never a traceback."""
    try:
        return command(words)
    except ClosedroomsError as error:
        _complain(str(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        _complain("interrupted; nothing half-written was left behind")
        return INTERRUPTED
    except BrokenPipeError:
        # The reader (`| head`) has what it wanted; stdout goes nowhere, so that the interpreter's own flush is silent.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def _usage() -> str:
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {summary}" for name, (summary, _) in COMMANDS.items()]
    return "\n".join(
        [
            "usage: closedrooms COMMAND [ARGUMENTS] [OPTIONS]",
            "",
            "Predicts the layout of rooms behind closed doors and completes a robot's map with them.",
            "",
            "commands:",
            *lines,
            "",
            "closedrooms COMMAND --help lists the options of a command.",
        ]
    )


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


def _complain(text: str) -> None:
    sys.stderr.write(f"closedrooms: {' '.join(text.split())}\n")


def _parse(
    config: type[Config], name: str, words: Sequence[str], summary: str, *, default: Config | None = None
) -> Config:
    """Options of one command; wrong usage ends the program with status 2, ``--help`` with 0 (both by tyro)."""
    import tyro

    prog, args = f"closedrooms {name}", list(words)
    if default is None:
        return tyro.cli(config, prog=prog, description=summary, args=args)
    return tyro.cli(config, prog=prog, description=summary, args=args, default=default)


def _named_presets(words: Sequence[str]) -> "RunConfig":
    """Defaults of ``run`` with the numbers that ``--noise`` and ``--lidar`` name, so that each can be set by itself."""
    from dataclasses import replace

    from closedrooms.pipeline.config import RunConfig
    from closedrooms.sim.config import LIDAR_PRESETS, NOISE_LEVELS

    parser = ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--noise", default="medium")
    parser.add_argument("--lidar", default="default")
    try:
        named, _ = parser.parse_known_args(list(words))
    except ArgumentError:
        return RunConfig()
    noise, lidar = NOISE_LEVELS.get(named.noise), LIDAR_PRESETS.get(named.lidar)
    if noise is None or lidar is None:
        return RunConfig()
    return RunConfig(sim=replace(RunConfig().sim, noise=noise, lidar=lidar))


def _report(work: "Callable[[Terminal], Result]", *, name_failures: bool = False) -> int:
    """Do the work with progress on the terminal, then print its table, where it was written and what failed."""
    from closedrooms.pipeline.progress import Terminal

    with Terminal() as terminal:
        result = work(terminal)
    terminal.table(result.title, result.table())
    terminal.say(f"written to {result.folder}")
    if name_failures:
        for name, reason in list(result.failures.items())[:MOST_NAMED]:
            _complain(f"{name}: {reason}")
        if len(result.failures) > MOST_NAMED:
            _complain(f"and {len(result.failures) - MOST_NAMED} more; all are named in the folder")
    return PARTLY_FAILED if result.failures else DONE


def _run(words: Sequence[str]) -> int:
    from closedrooms.pipeline.config import RunConfig

    config = _parse(RunConfig, "run", words, COMMANDS["run"][0], default=_named_presets(words))
    from closedrooms.pipeline.run import run

    return _report(lambda terminal: run(config, progress=terminal))


def _predict(words: Sequence[str]) -> int:
    from closedrooms.pipeline.config import PredictConfig

    config = _parse(PredictConfig, "predict", words, COMMANDS["predict"][0])
    from closedrooms.pipeline.predict import predict_map

    return _report(lambda terminal: predict_map(config, progress=terminal))


def _cover(words: Sequence[str]) -> int:
    from closedrooms.pipeline.config import CoverConfig

    config = _parse(CoverConfig, "cover", words, COMMANDS["cover"][0])
    from closedrooms.pipeline.cover import cover_map

    return _report(lambda terminal: cover_map(config, progress=terminal))


def _doors(words: Sequence[str]) -> int:
    from closedrooms.pipeline.propose_doors_config import DoorsConfig

    config = _parse(DoorsConfig, "doors", words, COMMANDS["doors"][0])
    from closedrooms.pipeline.propose_doors import doors_map

    return _report(lambda terminal: doors_map(config, progress=terminal))


def _map(words: Sequence[str]) -> int:
    from closedrooms.pipeline.config import MapConfig

    config = _parse(MapConfig, "map", words, COMMANDS["map"][0])
    from closedrooms.pipeline.map import map_log

    return _report(lambda terminal: map_log(config, progress=terminal))


def _dataset(words: Sequence[str]) -> int:
    from closedrooms.experiments.dataset.config import DatasetConfig

    config = _parse(DatasetConfig, "dataset", words, COMMANDS["dataset"][0])
    from closedrooms.experiments.dataset.dataset import dataset

    return _report(lambda terminal: dataset(config, progress=terminal))


def _worlds(words: Sequence[str]) -> int:
    from closedrooms.pipeline.config import WORLD_ACTIONS

    if not words or words[0] in {"-h", "--help"}:
        width = max(map(len, WORLD_ACTIONS))
        actions = [f"  {name:<{width}}  {summary}" for name, (summary, _) in WORLD_ACTIONS.items()]
        _say("\n".join(["usage: closedrooms worlds ACTION [ARGUMENTS] [OPTIONS]", "", "actions:", *actions]))
        return DONE if words else WRONG_USAGE
    if words[0] not in WORLD_ACTIONS:
        _complain(f"unknown action {words[0]!r} of worlds; expected one of {', '.join(WORLD_ACTIONS)}")
        return WRONG_USAGE
    summary, config_type = WORLD_ACTIONS[words[0]]
    config = _parse(config_type, f"worlds {words[0]}", words[1:], summary)
    from closedrooms.cli.worlds import act

    lines, lost = act(config)
    for line in lines:
        _say(line)
    return PARTLY_FAILED if lost else DONE


def _evaluate(words: Sequence[str]) -> int:
    from closedrooms.experiments.evaluation.config import EvaluateConfig

    config = _parse(EvaluateConfig, "evaluate", words, COMMANDS["evaluate"][0])
    from closedrooms.experiments.evaluation.evaluate import evaluate

    return _report(lambda terminal: evaluate(config, progress=terminal), name_failures=True)


def _robustness(words: Sequence[str]) -> int:
    from closedrooms.experiments.robustness.config import RobustnessConfig

    config = _parse(RobustnessConfig, "robustness", words, COMMANDS["robustness"][0])
    from closedrooms.experiments.robustness.sweep import robustness

    return _report(lambda terminal: robustness(config, progress=terminal), name_failures=True)


COMMANDS: dict[str, tuple[str, Callable[[Sequence[str]], int]]] = {
    "run": ("Simulate a robot in a building with closed doors, map it, predict the closed rooms, plan a tour.", _run),
    "predict": ("Predict the rooms behind the closed doors of a ROS map.", _predict),
    "cover": ("Plan a coverage tour on a ROS map.", _cover),
    "map": ("Build the map of a recorded run.", _map),
    "doors": ("Propose closed doors on a ROS map, from the map alone.", _doors),
    "worlds": ("List, show, generate and convert floor plans.", _worlds),
    "dataset": ("Make maps of many buildings with closed doors, and what is really behind them.", _dataset),
    "evaluate": ("Compare predictions with the truth over a dataset.", _evaluate),
    "robustness": (
        "Find at which noise the prediction starts to suffer, and which stage gives way first.",
        _robustness,
    ),
}


if __name__ == "__main__":
    sys.exit(main())
