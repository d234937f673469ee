"""Plugin of pytest: which functions of the checkout each test reaches, and how much of the processor it takes.

    REACHED=FILE.json pytest -p reached ...

The file holds a list of tests, each with ``test`` (its id), ``passed``, ``seconds``, ``functions`` (``module:line`` of
the definition) and ``processes`` (whether it started any; what they run is not seen). Set-up that tests share counts
for the first of them only. Of a property only the first examples are run: they reach what it reaches, and its time is
reckoned from them.
"""

import json
import os
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

ROOT = Path.cwd()
# Examples of a property.
EXAMPLES = 10
_reached: set[CodeType] = set()
_tests: list[dict[str, Any]] = []
_started: list[str] = []
_failed: set[str] = set()
_full: dict[object, int] = {}
sys.addaudithook(lambda event, _: _started.append(event) if event in {"subprocess.Popen", "os.fork"} else None)


def _trace(frame: FrameType, _event: str, _argument: object) -> None:
    # Called at the start of each function; without a tracer in return its lines are not traced.
    _reached.add(frame.f_code)


def _shorten(test: Any) -> float:
    """Let a property run its first examples only; how many times as many it has as a rule."""
    settings = getattr(test, "_hypothesis_internal_use_settings", None)
    if settings is None:
        return 1.0
    # Of a test with parameters it is one function for all.
    full = _full.setdefault(test, settings.max_examples)
    test._hypothesis_internal_use_settings = type(settings)(settings, max_examples=min(full, EXAMPLES))
    return max(float(full / EXAMPLES), 1.0)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Trace one test with its set-up."""
    _reached.clear()
    _started.clear()
    times = _shorten(getattr(item, "obj", None))
    before, begin = sys.gettrace(), time.process_time()
    threading.settrace(_trace)
    sys.settrace(_trace)
    try:
        return (yield)
    finally:
        sys.settrace(before)
        threading.settrace(None)  # type: ignore[arg-type]
        seconds = times * (time.process_time() - begin)
        functions = {place for code in _reached if (place := _place(code))}
        _tests.append(
            {
                "test": item.nodeid,
                "passed": item.nodeid not in _failed,
                "seconds": seconds,
                "functions": sorted(functions),
                "processes": bool(_started),
            }
        )


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Remember what failed."""
    if report.failed:
        _failed.add(report.nodeid)


def pytest_sessionfinish() -> None:
    """Write what was seen."""
    Path(os.environ["REACHED"]).write_text(json.dumps(_tests))


def _place(code: CodeType) -> str:
    path = Path(code.co_filename).resolve()
    if not path.is_relative_to(ROOT) or path.is_relative_to(ROOT / "tests"):
        return ""
    return f"{path.relative_to(ROOT).as_posix()}:{code.co_firstlineno}"
