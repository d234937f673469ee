"""Work that is handed out, and workers that die of it."""

import _thread
import contextlib
import json
import math
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path

import pytest

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.runtime.packages import MissingPackageError
from closedrooms.experiments import workers as workers_module
from closedrooms.experiments.local_workers import _command_line, _Pool
from closedrooms.experiments.workers import AHEAD, TRIES, Crew, Lost

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


@pytest.mark.parametrize("workers", [1, 2])
def test_a_missing_package_is_said_once_with_what_brings_it(workers: int) -> None:
    crew: Crew[str, object] = Crew(workers, by="closedrooms dataset")
    absent = "(_ for _ in ()).throw(ModuleNotFoundError('gone', name='pybullet.inside'))"
    with pytest.raises(MissingPackageError, match=r"closedrooms dataset needs pybullet, .*pip install"):
        list(crew.do(DO, [absent] * 4))


def test_what_the_work_needs_is_looked_for_before_the_first_job(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("closedrooms.core.runtime.packages.find_spec", lambda _name: None)
    crew: Crew[str, object] = Crew(1, needs=("gtsam",), by="a test")
    with pytest.raises(MissingPackageError, match="a test needs gtsam"):
        list(crew.do(DO, ["1 / 0"]))


def test_no_more_jobs_are_taken_ahead_than_the_workers_can_begin() -> None:
    taken: list[str] = []

    def endless() -> Iterator[str]:
        while True:
            taken.append("1 + 1")
            yield "1 + 1"

    crew: Crew[str, object] = Crew(2)
    outcomes = crew.do(DO, endless())
    for _ in range(5):
        assert next(outcomes) == ("1 + 1", 2)
    outcomes.close()
    assert len(taken) <= 5 + 2


@pytest.mark.parametrize("workers", [1, 2])
def test_workers_use_one_thread(workers: int) -> None:
    threads = "[pool['num_threads'] for pool in __import__('threadpoolctl').threadpool_info()]"
    loaded = f"__import__('scipy.linalg') and __import__('cv2').getNumThreads(), {threads}"
    crew: Crew[str, object] = Crew(workers)
    for _, (opencv, pools) in crew.do(DO, [loaded] * 2):  # type: ignore[misc]
        assert opencv == 1
        assert set(pools) == {1}


def test_a_worker_keeps_the_memory_that_it_frees(monkeypatch: pytest.MonkeyPatch) -> None:
    # As Dask's nanny starts one: what is freed goes back to the system, and comes again page by page.
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "65536")
    faults = "__import__('resource').getrusage(__import__('resource').RUSAGE_SELF).ru_minflt"
    work = f"[{faults}, [__import__('numpy').ones(4_000_000, 'u1').sum() for _ in range(50)], {faults}]"
    crew: Crew[str, object] = Crew(2)
    ((_, (before, _, after)),) = crew.do(DO, [work])  # type: ignore[misc]
    # An array has a thousand pages: it is new to the process once or twice, not fifty times.
    assert after - before < 10_000


@pytest.fixture
def scheduler() -> Iterator[str]:
    """The address of a scheduler in this process, with one worker of two threads in a process of its own."""
    distributed = pytest.importorskip("distributed", reason="needs closedrooms[cluster]")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.filterwarnings("default")
def test_a_cluster_does_the_same_a_few_jobs_ahead_with_one_thread(scheduler: str) -> None:
    taken: list[str] = []

    def jobs() -> Iterator[str]:
        for number in range(40):
            taken.append(f"{number} * __import__('cv2').getNumThreads()")
            yield taken[-1]

    crew: Crew[str, object] = Crew(1, scheduler)
    found = []
    for number, (_, outcome) in enumerate(crew.do(DO, jobs()), start=1):
        assert len(taken) <= number + 2 * AHEAD
        found.append(outcome)
    assert sorted(found) == list(range(40))
    absent = "(_ for _ in ()).throw(ModuleNotFoundError('gone', name='pybullet'))"
    with pytest.raises(MissingPackageError, match="closedrooms dataset needs pybullet"):
        list(Crew(1, scheduler, by="closedrooms dataset").do(DO, [absent] * 4))


LOST = """
import sys
from closedrooms.core.errors import ClosedroomsError
from closedrooms.experiments.workers import Crew
try:
    for job, outcome in Crew(1, sys.argv[1]).do(eval, ["__import__('time').sleep(0.05)"] * 10_000):
        print(job, flush=True)
except ClosedroomsError as error:
    sys.exit(str(error))
"""


def test_a_scheduler_that_dies_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="needs closedrooms[cluster]")
    where, log = tmp_path / "scheduler.json", tmp_path / "dask.log"
    common = ["--scheduler-file", str(where), "--host", "127.0.0.1", "--no-dashboard"]

    def begin(*words: str) -> "subprocess.Popen[bytes]":
        with log.open("ab") as file:
            return subprocess.Popen([sys.executable, "-m", "dask", *words, *common], stdout=file, stderr=file)

    scheduler = begin("scheduler", "--port", "0")
    worker = begin("worker", "--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path))
    try:
        while not (where.is_file() and where.read_text().rstrip().endswith("}")):
            assert scheduler.poll() is None, log.read_text()
            time.sleep(0.05)
        words = [sys.executable, "-c", LOST, json.loads(where.read_text())["address"]]
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            child.stdout.readline()  # the work has begun
            scheduler.kill()
            _, said = child.communicate(timeout=60)
    finally:
        for process in (worker, scheduler):
            process.kill()
            process.wait()
    assert child.returncode == 1
    assert said.splitlines() == [
        "the Dask scheduler was lost; the same command goes on where it stopped once there is one again"
    ]


def test_a_scheduler_that_no_longer_answers_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs closedrooms[cluster]")

    class Unanswered:
        loop = object()

        def nthreads(self) -> dict[str, int]:
            raise OSError("Timed out trying to connect") from ConnectionRefusedError(111, "Connection refused")

    monkeypatch.setattr(workers_module, "_cluster", lambda _: contextlib.nullcontext(Unanswered()))
    with pytest.raises(ClosedroomsError, match="the Dask scheduler was lost"):
        list(Crew(1, "tcp://127.0.0.1:1").do(str, [1]))


def test_a_signal_that_another_thread_takes_waits_until_a_worker_has_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = 0

    def submit(_: ProcessPoolExecutor, *work: object) -> Future[object]:
        nonlocal steps
        _thread.interrupt_main(signal.SIGINT)
        while steps < 1000:  # the interpreter looks for signals here
            steps += len(work)
        return Future()

    monkeypatch.setattr(ProcessPoolExecutor, "submit", submit)
    pool = _Pool(1)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        pool.submit(print)
    assert steps == 1000
    assert signal.getsignal(signal.SIGINT) is before
    pool.shutdown()


def test_a_worker_whose_parent_is_gone_ends_quietly() -> None:
    reading, writing = os.pipe()
    os.close(writing)
    command = _command_line(tracker_fd=reading, pipe_handle=reading)
    done = subprocess.run(command, pass_fds=[reading], capture_output=True, check=False)
    os.close(reading)
    assert (done.returncode, done.stdout, done.stderr) == (1, b"", b"")


def test_a_worker_that_was_told_nothing_yet_ends_with_its_parent() -> None:
    # Its pipe stays open here: what ends it is the kernel, before it has read a word.
    code = (
        "import subprocess, sys, time\n"
        "from closedrooms.experiments.local_workers import _command_line\n"
        "pipe = int(sys.argv[1])\n"
        "words = _command_line(tracker_fd=pipe, pipe_handle=pipe)\n"
        "subprocess.Popen(words, pass_fds=[pipe], stderr=subprocess.DEVNULL)\n"
        "print('begun', flush=True)\n"
        "time.sleep(600)\n"
    )
    reading, writing = os.pipe()
    with subprocess.Popen(
        [sys.executable, "-c", code, str(reading)], pass_fds=[reading], stdout=subprocess.PIPE, text=True
    ) as parent:
        os.close(reading)
        assert parent.stdout is not None
        assert parent.stdout.readline() == "begun\n"
        parent.kill()
        # The worker holds the other end of it for as long as it lives.
        gone, _, _ = select.select([parent.stdout], [], [], 120.0)
        os.close(writing)
        assert gone
        assert parent.stdout.read() == ""
