"""Signals: the first one stops the work, and a process that cannot stop is ended."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from closedrooms.core.runtime.stopping import Terminated, stopping


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_an_exception_and_a_second_one_disturbs_nothing(number: int) -> None:
    # Whoever started the tests in the background of a script, or by nohup, had some of them ignored.
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(each, signal.SIG_DFL) for each in signals]
    try:
        with stopping() as stop:
            assert not stop
            with pytest.raises(Terminated):
                signal.raise_signal(number)
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGINT)
            assert stop.status == 128 + number
    finally:
        for each, handler in zip(signals, before, strict=True):
            signal.signal(each, handler)


def test_handlers_are_put_back_and_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stopping() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop
            assert signal.getsignal(signal.SIGTERM) is stop
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_another_thread_sets_no_handlers() -> None:
    seen: list[object] = []

    def work() -> None:
        with stopping():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.SIG_DFL]


# What keeps a process from stopping: a call in C that lets no Python run, an exception that is lost, or caught.
STUBBORN = {
    "in C": "import hashlib; hashlib.pbkdf2_hmac('sha256', b'a', b'b', 10**9)",
    "lost": "import time\nclass A:\n    def __del__(self):\n        time.sleep(30)\na = A(); del a\ntime.sleep(30)",
    "caught": "import time\nwhile True:\n    try:\n        time.sleep(30)\n    except BaseException:\n        pass",
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("what", STUBBORN)
def test_a_process_that_does_not_stop_is_ended_in_time_and_quietly(what: str, number: int) -> None:
    code = (
        "import os\nfrom closedrooms.core.runtime.stopping import SIGNALS, Stop, end_in_time, handle\n"
        "end_in_time(SIGNALS, lambda number: os.write(1, b'left'), patience=0.3)\n"
        "handle(SIGNALS, Stop())\nprint('ready', flush=True)\n" + STUBBORN[what]
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.2)
    begin = time.monotonic()
    os.kill(process.pid, number)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (128 + number, "left", "")
    assert time.monotonic() - begin < 10


def ended(code: str) -> tuple[int, str]:
    code = f"import atexit, time; from closedrooms.core.runtime import stopping\n{code}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    return done.returncode, done.stdout


def test_a_process_ends_with_its_status_and_what_is_to_be_done_at_exit_is_done() -> None:
    assert ended("atexit.register(print, 'done', end=''); print('said', end=' '); stopping.end(2)") == (2, "said done")


def test_a_process_whose_library_waits_for_ever_ends_all_the_same_with_its_status() -> None:
    code = "atexit.register(time.sleep, 1000); print('said', end=''); stopping.wait_for_nothing(); stopping.end(3)"
    assert ended(code) == (3, "said")


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel of Linux alone does it")
def test_a_process_ends_with_its_parent_and_at_once_where_that_has_ended_before() -> None:
    # The child says its number and waits; its parent ends as soon as it is told to.
    code = (
        "import os, signal, subprocess, sys; from closedrooms.core.runtime.stopping import ending_with\n"
        "subprocess.Popen([sys.executable, '-c', 'import os, time; print(os.getpid(), flush=True); time.sleep(600)'],"
        " preexec_fn=ending_with(os.getpid(), signal.SIGKILL)); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        assert int(parent.stdout.readline()) != parent.pid
        assert parent.stdin is not None
        parent.stdin.close()
        # The pipe ends when the child, which writes to it too, is gone.
        assert parent.stdout.read() == ""
    assert parent.returncode == 0
    code = "from closedrooms.core.runtime.stopping import ending_with; ending_with(1 << 30, 9)()"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 1
