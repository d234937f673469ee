"""How the process of a worker is set up, local or on a cluster."""

import ctypes
import os
import signal

from closedrooms.core.files.unfinished import remove_unfinished
from closedrooms.core.runtime.stopping import SIGNALS, Stop, end_in_time, ending_with, handle

GRACE = 1.0
"""How long workers may take to clear away what they have under way [s]; the parent itself has 1.4 s."""
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


def begin_worker(parent: int) -> None:
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
