"""Work that is handed out, and workers that die of it."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.experiments.workers import TRIES, Crew, Lost, _outcomes

DEADLY = "__import__('os')._exit(1)"
# `eval` is a function that any worker can find by name.
DO: Callable[[str], object] = eval


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_has_its_outcome(workers: int) -> None:
    crew: Crew[float, float] = Crew(workers)
    assert dict(crew.do(math.sqrt, [1.0, 4.0, 9.0, 16.0])) == {1.0: 1.0, 4.0: 2.0, 9.0: 3.0, 16.0: 4.0}


def test_nothing_to_do_starts_nobody() -> None:
    crew: Crew[float, float] = Crew(2, "tcp://127.0.0.1:9")
    assert list(crew.do(math.sqrt, [])) == []


def test_a_deadly_job_is_given_up_and_the_others_are_done() -> None:
    crew: Crew[str, object] = Crew(2)
    outcomes = dict(crew.do(DO, ["1 + 1", DEADLY, "2 + 2", "3 + 3"]))
    assert outcomes[DEADLY] == Lost(f"{TRIES} workers died while they worked on it")
    assert {job: outcome for job, outcome in outcomes.items() if job != DEADLY} == {"1 + 1": 2, "2 + 2": 4, "3 + 3": 6}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_programming_error_ends_the_work(workers: int) -> None:
    crew: Crew[str, object] = Crew(workers)
    with pytest.raises(ZeroDivisionError):
        list(crew.do(DO, ["1 / 0", "1 + 1"]))


def test_workers_are_other_processes_and_gone_afterwards() -> None:
    crew: Crew[str, object] = Crew(2)
    pids = {outcome for _, outcome in crew.do(DO, ["__import__('os').getpid()"] * 1 + ["__import__('os').getppid()"])}
    assert os.getpid() in pids
    assert len(pids) == 2


def test_a_scheduler_that_does_not_answer_is_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs closedrooms[cluster]")
    monkeypatch.setattr("closedrooms.experiments.workers.PATIENCE", 0.2)
    crew: Crew[float, float] = Crew(1, "tcp://127.0.0.1:9")
    with pytest.raises(InvalidInputError, match="no scheduler answers"):
        list(crew.do(math.sqrt, [1.0]))


def test_a_scheduler_that_is_lost_is_one_line() -> None:
    pytest.importorskip("distributed", reason="needs closedrooms[cluster]")

    class Lossy(ThreadPoolExecutor):
        """Cancels what it is given, as Dask's client does when its scheduler is gone."""

        def submit(self, *_: object, **__: object) -> Future[object]:  # type: ignore[override]
            future: Future[object] = Future()
            future.set_exception(CancelledError("lost"))
            return future

    with pytest.raises(ClosedroomsError, match="scheduler was lost"):
        list(_outcomes(Lossy(), DO, ["1 + 1"]))


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    code = (
        "from closedrooms.experiments.workers import Crew\n"
        "if __name__ == '__main__':\n"
        '    jobs = [\'(__import__("os").write(1, b"begun " + str(__import__("os").getpid()).encode() + b"\\\\n"),'
        ' __import__("time").sleep(60))\'] * 2\n'
        "    list(Crew(2).do(eval, jobs))\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        assert parent.stdout is not None
        workers = [int(parent.stdout.readline().split()[1]) for _ in range(2)]
        parent.kill()
    end = time.monotonic() + 20
    while any(Path(f"/proc/{worker}").exists() for worker in workers) and time.monotonic() < end:
        time.sleep(0.02)
    assert not [worker for worker in workers if Path(f"/proc/{worker}").exists()]
