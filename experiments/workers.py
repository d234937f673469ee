"""The same work for one process, several, or a cluster, behind the executor interface of concurrent.futures."""

import contextlib
import ctypes
import functools
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from itertools import chain, count, islice
from multiprocessing import spawn
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.files.unfinished import remove_unfinished
from closedrooms.core.runtime.packages import missing_package, require
from closedrooms.core.runtime.stopping import SIGNALS, Stop, end_in_time, ending_with, handle

if TYPE_CHECKING:
    from distributed import Client

Job = TypeVar("Job")
Result = TypeVar("Result")

# How often a job is handed out before it is given up: its worker may have been killed for another one's sake.
TRIES = 3
# How long a scheduler may take to answer [s].
PATIENCE = 10.0
# How long workers may take to clear away what they have under way [s]; the parent itself has 1.4 s.
GRACE = 1.0
SAFE_PATH = "PYTHONSAFEPATH"
# Jobs that a cluster is given for each of its threads: one to work on, one to go on with.
AHEAD = 2


@dataclass(frozen=True, slots=True)
class Lost:
    """Stand-in for an outcome: every worker that was given the job died of it."""

    reason: str


@dataclass(frozen=True, slots=True)
class Crew(Generic[Job, Result]):
    """Workers who do the work, local or on a cluster.

    Attributes:
        workers: Local processes; 1 works in this process.
        scheduler: Address of a Dask scheduler, ``tcp://host:port``, or ``None`` for local processes.
        needs: Packages that the work cannot do without, as they are imported.
        by: Who needs them, the command.
    """

    workers: int = 1
    scheduler: str | None = None
    needs: tuple[str, ...] = ()
    by: str = "closedrooms"

    def do(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[tuple[Job, Result | Lost]]:
        """Yield outcomes as they come, in no certain order.

        Jobs are taken one after the other, no more of them ahead than the workers can begin: a million cost no more
        memory than a hundred, and neighbours, which share a building, are worked on at one time.

        A worker that dies is replaced, and what it was doing is handed out again, at most ``TRIES`` times. On any
        error, Ctrl-C included, work that has not begun is not begun, and local workers are ended.

        Args:
            function: What to do; a function of a module, so that it can be sent.
            jobs: What to do it to; small, since they are sent.

        Raises:
            InvalidInputError: The scheduler cannot be reached.
            MissingPackageError: Here or on a worker a package is not installed; said once.
        """
        source = iter(jobs)
        for first in source:
            work = partial(_prepared, function, self.needs, self.by)
            jobs = chain((first,), source)
            if self.scheduler is not None:
                yield from _on_cluster(self.scheduler, work, jobs)
            elif self.workers == 1:
                for job in jobs:
                    yield job, work(job)
            else:
                yield from self._locally(work, jobs)

    def _locally(self, work: Callable[[Job], Result], jobs: Iterator[Job]) -> Iterator[tuple[Job, Result | Lost]]:
        """Do jobs in local processes, and hand out again what a worker died of."""
        # Jobs that were under way when a worker died are retried one at a time, to find the one that kills workers.
        suspects: deque[tuple[Job, int]] = deque()
        while True:
            begun: dict[int, Job] = {}
            job, tries = suspects.popleft() if suspects else (None, 0)
            batch = jobs if tries == 0 else iter((cast(Job, job),))
            try:
                yield from self._batch(work, batch, begun, 1 if tries else self.workers)
            except BrokenProcessPool:
                if tries + 1 >= TRIES:
                    yield from ((job, Lost(f"{TRIES} workers died while they worked on it")) for job in begun.values())
                else:
                    suspects.extend((job, tries + 1) for job in begun.values())
                continue
            if tries == 0:
                return

    def _batch(
        self, work: Callable[[Job], Result], jobs: Iterator[Job], begun: dict[int, Job], workers: int
    ) -> Iterator[tuple[Job, Result]]:
        """Hand out jobs, no more at a time than there are workers: ``begun`` names those under way when one dies."""
        under_way: dict[Future[Result], int] = {}
        numbers = count()
        with hire(workers) as pool:
            while True:
                for job in islice(jobs, workers - len(under_way)):
                    number = next(numbers)
                    begun[number] = job
                    under_way[pool.submit(work, job)] = number
                if not under_way:
                    break
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    outcome = future.result()
                    yield begun.pop(under_way.pop(future)), outcome


@contextlib.contextmanager
def hire(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Start local workers: no part in Ctrl-C, no modules from the current directory, no life after the parent's.

    On any error in the block, Ctrl-C included, they are told to clear away what they have under way, and ended.
    """
    before = os.environ.get(SAFE_PATH)
    # A worker begins as `python -c`, which looks for modules in the current directory.
    os.environ[SAFE_PATH] = "1"
    spawn.get_command_line = _command_line
    pool = _Pool(workers, multiprocessing.get_context("spawn"), _begin, (os.getpid(),))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        manager = getattr(pool, "_executor_manager_thread", None)
        pool.shutdown(wait=False, cancel_futures=True)
        _dismiss()
        if manager is not None:
            # It closes a pipe that the interpreter writes to when it ends.
            manager.join(GRACE)
        raise
    finally:
        spawn.get_command_line = _SPAWNED
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


_SPAWNED = spawn.get_command_line
# A worker whose parent is gone before it has said what to do ends; Python's own words for that are a traceback.
_QUIETLY = """\
import pickle, sys
try:
    {program}
except (EOFError, pickle.UnpicklingError):
    sys.exit(1)
"""


def _command_line(**named: Any) -> list[str]:
    """Make the command that a worker begins with, as the standard library does, but quiet where its parent is gone."""
    words = list(_SPAWNED(**named))
    at = words.index("-c") + 1
    words[at] = _QUIETLY.format(program=words[at])
    return words


class _Pool(ProcessPoolExecutor):
    """Workers that are not disturbed by signals while they begin, nor begun while a signal ends their parent."""

    def submit(self, *work: Any, **named: Any) -> Future[Any]:
        """Hand out a job; a worker that is begun for it inherits that SIGINT and SIGTERM wait."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        try:
            # Another thread may still take the signal, and its handler would run here.
            with _signals_late():
                return super().submit(*work, **named)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _signals_late() -> Iterator[None]:
    """Handle signals that come in the block when it has ended; in the main thread, where handlers run."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = {number: handler for number in SIGNALS if callable(handler := signal.getsignal(number))}
    for number in handlers:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def _dismiss() -> None:
    """End the workers, those that do not go by themselves too."""
    children = multiprocessing.active_children()
    for child in children:
        child.terminate()
    end = time.monotonic() + GRACE
    for child in children:
        child.join(max(0.0, end - time.monotonic()))
        child.kill()


def _prepared(function: Callable[[Job], Result], needs: tuple[str, ...], by: str, job: Job) -> Result:
    """Do one job on a worker of any kind, which is made ready once."""
    _make_ready(needs, by)
    try:
        return function(job)
    except ModuleNotFoundError as error:
        missing = missing_package(error, by=by)
        if missing is None:
            raise
        raise missing from error


@functools.cache
def _make_ready(needs: tuple[str, ...], by: str) -> None:
    """Check the packages of a worker and set up its process, once."""
    require(*needs, by=by)
    one_thread()
    keep_memory()


# What the numeric libraries ask when they are loaded.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread() -> None:
    """Limit a worker to one thread: workers share the processors, and a library's own threads would only be in the way.

    Holds for OpenCV and BLAS, those that are loaded and those that will be.
    """
    import cv2
    from threadpoolctl import threadpool_limits

    os.environ.update(dict.fromkeys(THREADS, "1"))
    threadpool_limits(1)
    cv2.setNumThreads(1)


# Of <malloc.h>: what is returned to the system at the end of the heap, and what is asked from it by itself [bytes].
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
KEPT, OWN = 64 << 20, 32 << 20


def keep_memory() -> None:
    """Let this process keep the memory that it frees: the next map takes it again.

    Dask's nanny starts workers with ``MALLOC_TRIM_THRESHOLD_=65536``, which also ends glibc's habit to raise both
    limits by itself: every array above 128 kB is then asked from the system, zeroed page by page and given back at
    once. Measured on 18 maps of school-01: 250,000 page faults against 76,000 without that variable and 5,700 with
    this function, and a quarter less processor time.
    """
    adjust = getattr(ctypes.CDLL(None), "mallopt", None)
    if adjust is not None:  # another C library has no such limits
        adjust(M_MMAP_THRESHOLD, OWN)
        adjust(M_TRIM_THRESHOLD, KEPT)


def _begin(parent: int) -> None:
    """Prepare a local worker: one thread, no part in the parent's Ctrl-C, and no life after the parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_in_time((signal.SIGTERM,), lambda _: remove_unfinished(), patience=GRACE / 2)
    ending_with(parent, signal.SIGTERM)()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    one_thread()
    # Until here the signal ends the worker by itself: it has nothing under way.
    handle((signal.SIGTERM,), _Dismissal())


class _Dismissal(Stop):
    """End of a worker: multiprocessing tells any other exception in a traceback."""

    error = SystemExit


@contextlib.contextmanager
def _cluster(address: str) -> Iterator["Client"]:
    """Connect to a Dask cluster."""
    require("distributed", by="--scheduler")
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError, RuntimeError) as error:
        raise InvalidInputError(
            "no scheduler answers", expected="the address of a Dask scheduler, tcp://host:port", where=address
        ) from error
    # What Dask logs of a lost scheduler are tracebacks; we tell it in a line of our own.
    for logger in ("distributed", "distributed.client"):
        logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    with client:
        yield client


def _on_cluster(
    address: str, work: Callable[[Job], Result], jobs: Iterator[Job]
) -> Iterator[tuple[Job, Result | Lost]]:
    """Hand out jobs to a cluster, ``AHEAD`` times as many as it has threads at a time."""
    with _cluster(address) as client:
        from distributed import KilledWorker, as_completed
        from distributed.comm import CommClosedError

        begun: dict[str, Job] = {}
        completed = as_completed(loop=client.loop)

        def fill() -> None:
            most = max(AHEAD * sum(client.nthreads().values()), 1)
            for job in islice(jobs, max(most - len(begun), 0)):
                # No key of our own: equal jobs are done as often as they are asked for.
                future = client.submit(work, job, pure=False, retries=TRIES - 1)
                begun[future.key] = job
                completed.add(future)

        try:
            fill()
            for future in completed:
                job = begun.pop(future.key)
                try:
                    outcome: Result | Lost = future.result()
                except KilledWorker as error:
                    outcome = Lost(" ".join(str(error).split()))
                future.release()
                yield job, outcome
                fill()
        except (CancelledError, CommClosedError, ConnectionError, TimeoutError) as error:
            # Dask cancels what its scheduler can no longer tell about.
            raise ClosedroomsError(
                "the Dask scheduler was lost; the same command goes on where it stopped once there is one again"
            ) from error
        except BaseException:
            client.cancel(list(completed.futures))
            raise
