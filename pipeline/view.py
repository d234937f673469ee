"""``closedrooms view``: opens the recording of a result in the viewer that comes with rerun."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from closedrooms.core.errors import ClosedroomsError, InvalidInputError
from closedrooms.core.files.incoming import check_regular, is_file, is_folder, read_json
from closedrooms.core.files.output_folders import MANIFEST
from closedrooms.core.files.schema import check_schema
from closedrooms.core.runtime.packages import require
from closedrooms.core.runtime.stopping import ending_with
from closedrooms.pipeline.options.view import ViewConfig
from closedrooms.pipeline.reporting.progress import Progress

RECORDING = "run.rrd"
HOST = "127.0.0.1"
# Recordings further down that a message names.
MOST_NAMED = 3
# How long the viewer may take to end once it is told to [s].
PATIENCE = 5.0


class ViewerError(ClosedroomsError):
    """The viewer cannot be started, or ended in an error."""


def view_recording(config: ViewConfig, *, progress: Progress | None = None) -> list[str]:  # noqa: ARG001
    """Open the viewer and wait until it is closed; with ``--web`` serve it until Ctrl-C.

    Raises:
        InvalidInputError: There is no recording.
        MissingPackageError: rerun is not installed.
        ViewerError: There is no desktop, a port is taken, the viewer ended in an error.
    """
    recording = find_recording(config.folder)
    require("rerun", by="closedrooms view")
    viewer = find_viewer()
    if not config.web:
        if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise ViewerError("there is no desktop here; closedrooms view --web serves the recording to a browser")
        _wait_for([viewer, str(recording), "--bind", HOST, "--port", "auto"])
        return []
    page, data = _free_port(config.port), _free_port(0)
    source = quote(f"rerun+http://{HOST}:{data}/proxy", safe="")
    sys.stdout.write(f"http://{HOST}:{page}?url={source}\nCtrl-C ends it.\n")
    sys.stdout.flush()
    ports = ["--port", str(data), "--web-viewer-port", str(page)]
    _wait_for([viewer, str(recording), "--serve-web", "--bind", HOST, *ports])
    return []


def find_recording(folder: Path) -> Path:
    """Find the recording of a result.

    Args:
        folder: A folder that we wrote, or a recording itself.

    Raises:
        InvalidInputError: There is none (those in folders below are named), or it is of a newer version.
    """
    if not is_folder(folder):
        check_regular(folder, "a folder with a recording, or a recording (.rrd)")
        if folder.suffix.lower() == ".rrd":
            return folder
        raise InvalidInputError("no recording", expected="a folder with run.rrd, or a file .rrd", where=folder)
    if is_file(folder / RECORDING):
        if is_file(folder / MANIFEST) and isinstance(about := read_json(folder / MANIFEST, what="a manifest"), dict):
            check_schema(about, folder / MANIFEST)
        return folder / RECORDING
    below = sorted(path.parent.name for path in folder.glob(f"*/{RECORDING}"))[:MOST_NAMED]
    written = " (run and map write it unless --no-record, predict with --record)"
    hint = f"; there are some in {', '.join(below)}" if below else written
    raise InvalidInputError("no recording", expected=f"{RECORDING} in the folder{hint}", where=folder)


def find_viewer() -> str:
    """Find the program ``rerun`` of this environment.

    Raises:
        ViewerError: It is not there.
    """
    # The viewer itself: the script of this name only starts it, and leaves it behind where it is killed.
    package = find_spec("rerun_cli")
    itself = Path(package.origin).with_name("rerun") if package is not None and package.origin else None
    if itself is not None and os.access(itself, os.X_OK):
        return str(itself)
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    viewer = beside or shutil.which("rerun")
    if viewer is None:
        raise ViewerError(f"the program rerun is not beside {sys.executable}: pip install --force-reinstall rerun-sdk")
    return viewer


def _wait_for(words: Sequence[str]) -> None:
    """Run a program to its end, or end it with us.

    Raises:
        ViewerError: It ended in an error, told by its last line.
    """
    try:
        # A group of its own lets it be ended with whatever it starts; killed ourselves, we leave nobody behind.
        viewer = subprocess.Popen(
            words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
            preexec_fn=ending_with(os.getpid(), signal.SIGKILL),  # noqa: PLW1509 (it takes no lock)
        )  # fmt: skip
    except OSError as error:
        raise ViewerError(f"cannot start {words[0]}: {error.strerror}") from error
    last = ""
    with viewer:
        try:
            for line in viewer.stderr or ():
                last = line.strip() or last
            status = viewer.wait()
        finally:
            _end(viewer)
    if status != 0:
        raise ViewerError(f"the rerun viewer ended with status {status}: {last[:300]}")


def _end(viewer: "subprocess.Popen[str]") -> None:
    """End a program and what it started, kindly at first."""
    for kind, patience in ((signal.SIGTERM, PATIENCE), (signal.SIGKILL, None)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(viewer.pid, kind)
        with contextlib.suppress(subprocess.TimeoutExpired):
            viewer.wait(patience)
            return


def _free_port(wanted: int) -> int:
    """Choose the port itself where it is free, any free one for 0.

    Raises:
        ViewerError: It is taken.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind((HOST, wanted))
        except OSError as error:
            raise ViewerError(f"port {wanted} is taken ({error.strerror}); expected a free one, or --port 0") from error
        return int(probe.getsockname()[1])
