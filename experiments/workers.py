"""The same work for one process, several, or a cluster, behind the executor interface of concurrent.futures."""

import contextlib
import functools
import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from itertools import chain, count, islice
from typing import TYPE_CHECKING, Generic, TypeVar, cast

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.runtime.packages import missing_package, require
from closedrooms.experiments.local_workers import hire
from closedrooms.experiments.worker_process import keep_memory, one_thread

if TYPE_CHECKING:
    from distributed import Client

Job = TypeVar("Job")
Result = TypeVar("Result")

# How often a job is handed out before it is given up: its worker may have been killed for another one's sake.
TRIES = 3
# How long a scheduler may take to answer [s].
PATIENCE = 10.0
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
            try:
                threads = sum(client.nthreads().values())
            except OSError as error:  # it was lost, and does not answer
                raise CommClosedError(str(error)) from error
            most = max(AHEAD * threads, 1)
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
