"""The same work for one process, several, or a cluster, behind the executor interface of concurrent.futures."""

import contextlib
import ctypes
import logging
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.stopping import SIGNALS, Stop, end_in_time, handle
from closedrooms.core.unfinished import remove_unfinished

Job = TypeVar("Job")
Outcome = TypeVar("Outcome")

# How often a job is handed out before it is given up: its worker may have been killed for another one's sake.
TRIES = 3
# How long a scheduler may take to answer [s].
PATIENCE = 10.0
# How long workers may take to clear away what they have under way [s]; the parent itself has 1.4 s.
GRACE = 1.0
SAFE_PATH = "PYTHONSAFEPATH"
PR_SET_PDEATHSIG = 1  # <linux/prctl.h>


@dataclass(frozen=True, slots=True)
class Lost:
    """In place of an outcome: every worker that was given the job died of it."""

    reason: str


@dataclass(frozen=True, slots=True)
class Crew(Generic[Job, Outcome]):
    """Who does the work.

    Attributes:
        workers: Local processes; 1 works in this process.
        scheduler: Address of a Dask scheduler, ``tcp://host:port``, or ``None`` for local processes.
    """

    workers: int = 1
    scheduler: str | None = None

    def do(self, function: Callable[[Job], Outcome], jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome | Lost]]:
        """Outcomes as they come, in no certain order.

        A worker that dies is replaced, and what it was doing is handed out again, at most ``TRIES`` times. On any
        error, Ctrl-C included, work that has not begun is not begun, and local workers are ended.

        Args:
            function: What to do; a function of a module, so that it can be sent.
            jobs: What to do it to; small, since they are sent.

        Raises:
            InvalidInputError: The scheduler cannot be reached, or Dask is not installed.
        """
        if not jobs:
            return
        if self.scheduler is not None:
            with _cluster(self.scheduler) as executor:
                yield from _outcomes(executor, function, jobs)
        elif self.workers == 1:
            for job in jobs:
                yield job, function(job)
        else:
            yield from self._locally(function, jobs)

    def _locally(self, function: Callable[[Job], Outcome], jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome | Lost]]:
        tries = dict.fromkeys(range(len(jobs)), 0)
        while tries:
            # Jobs that were under way when a worker died are tried one at a time, so that the guilty one is known.
            suspects = [number for number, count in tries.items() if count > 0]
            batch = suspects[:1] or list(tries)
            begun: set[int] = set()
            try:
                for number, outcome in self._batch(function, jobs, batch, begun):
                    del tries[number]
                    yield jobs[number], outcome
            except BrokenProcessPool:
                for number in begun & tries.keys():
                    tries[number] += 1
                    if tries[number] >= TRIES:
                        del tries[number]
                        yield jobs[number], Lost(f"{TRIES} workers died while they worked on it")

    def _batch(
        self, function: Callable[[Job], Outcome], jobs: Sequence[Job], batch: Sequence[int], begun: set[int]
    ) -> Iterator[tuple[int, Outcome]]:
        """Hand out a batch, no more at a time than can be worked on, so that ``begun`` names what a death hits."""
        under_way: dict[Future[Outcome], int] = {}
        left = list(reversed(batch))
        with hire(min(self.workers, len(batch))) as pool:
            while left or under_way:
                while left and len(under_way) < self.workers:
                    number = left.pop()
                    begun.add(number)
                    under_way[pool.submit(function, jobs[number])] = number
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    outcome = future.result()
                    yield under_way.pop(future), outcome


@contextlib.contextmanager
def hire(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Local worker processes: no part in Ctrl-C, no modules from the current directory, no life after the parent's.

    On any error in the block, Ctrl-C included, they are told to clear away what they have under way, and ended.
    """
    before = os.environ.get(SAFE_PATH)
    # A worker begins as `python -c`, which looks for modules in the current directory.
    os.environ[SAFE_PATH] = "1"
    pool = _Pool(workers, multiprocessing.get_context("spawn"), _begin, (os.getpid(),))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        _dismiss()
        raise
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


class _Pool(ProcessPoolExecutor):
    """Workers that are not disturbed by signals while they begin, nor begun while a signal ends their parent."""

    def submit(self, *work: Any, **named: Any) -> Future[Any]:
        """Hand out a job; a worker that is begun for it inherits that SIGINT and SIGTERM wait."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        try:
            return super().submit(*work, **named)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _dismiss() -> None:
    """End the workers, those that do not go by themselves too."""
    children = multiprocessing.active_children()
    for child in children:
        child.terminate()
    end = time.monotonic() + GRACE
    for child in children:
        child.join(max(0.0, end - time.monotonic()))
        child.kill()


def one_thread() -> None:
    """Begin a worker: workers share the processors, and OpenCV's own threads would only get in each other's way."""
    import cv2

    cv2.setNumThreads(1)


def _begin(parent: int) -> None:
    """Prepare a local worker: one thread, no part in the parent's Ctrl-C, and no life after the parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_in_time((signal.SIGTERM,), lambda _: remove_unfinished(), patience=GRACE / 2)
    # The kernel sends the signal when the parent ends, however it ends; it may have ended already.
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    if os.getppid() != parent:
        os._exit(1)
    one_thread()
    # Until here the signal ends the worker by itself: it has nothing under way.
    handle((signal.SIGTERM,), _Dismissal())


class _Dismissal(Stop):
    """Ends a worker: multiprocessing tells any other exception in a traceback."""

    error = SystemExit


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """The executor of a Dask cluster."""
    try:
        from distributed import Client
    except ImportError as error:
        raise InvalidInputError(
            "Dask is not installed", expected="pip install 'closedrooms[cluster]'", where=address
        ) from error
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
        yield client.get_executor(pure=False, retries=TRIES - 1)


def _outcomes(
    executor: Executor, function: Callable[[Job], Outcome], jobs: Sequence[Job]
) -> Iterator[tuple[Job, Outcome | Lost]]:
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    waiting = {executor.submit(function, job): job for job in jobs}
    try:
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                job = waiting.pop(future)
                try:
                    yield job, future.result()
                except KilledWorker as error:
                    yield job, Lost(" ".join(str(error).split()))
    except (CancelledError, CommClosedError, ConnectionError, TimeoutError) as error:
        # Dask cancels what its scheduler can no longer tell about.
        raise ClosedroomsError(
            "the Dask scheduler was lost; the same command goes on where it stopped once there is one again"
        ) from error
    except BaseException:
        for future in waiting:
            future.cancel()
        raise
