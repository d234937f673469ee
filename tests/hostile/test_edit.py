"""Hostile maps and lists of doors in ``closedrooms edit``: one clear line on the page and on the terminal.

What the page shows of a line is tried in a browser (``tests/web/test_page.py``); here, every kind of bad file.
"""

import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import inputs
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("nicegui")

from closedrooms.core.errors import ClosedroomsError
from closedrooms.web.config import EditConfig
from closedrooms.web.server import Desk

FORMATS = inputs.FORMATS
# Where the opening of the server itself refuses the file, before there is a page.
BEFORE = (*inputs.PLACES,)
KINDS = [mutation for mutation in inputs.MUTATIONS if mutation not in BEFORE]


@pytest.fixture
def honest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    for kind in ("map", "doors"):
        (tmp_path / FORMATS[kind].name).write_bytes(FORMATS[kind].content)
    (tmp_path / "map.png").write_bytes(inputs.picture())
    return tmp_path


def visit(folder: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """Visit the page twice; what it says, which is what the terminal says, once."""
    desk = Desk(EditConfig(map=folder / "map.yaml", doors=folder / "doors.geojson"))
    said = []
    for _ in range(2):
        try:
            said.append(desk.session("visitor").trouble)
        except ClosedroomsError as error:
            said.append(str(error))
    assert said[0] == said[1]
    assert said[0].isprintable()
    assert "internal error" not in said[0]
    assert len(said[0]) < 3000
    assert capfd.readouterr().err == (f"closedrooms: {said[0]}\n" if said[0] else "")
    return said[0]


@pytest.mark.parametrize("mutation", KINDS)
@pytest.mark.parametrize("kind", ["map", "picture", "doors"])
def test_a_spoilt_file_is_one_line_on_page_and_terminal(
    honest: Path, kind: str, mutation: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = honest / FORMATS[kind].name
    path.unlink()
    inputs.spoil(path, FORMATS[kind].content, mutation)
    said = visit(honest, capfd)
    assert not said or path.name in said
    if mutation in {"empty", "zeros", "brackets", "tags"}:
        assert said


def test_honest_files_are_no_trouble_and_a_mended_map_is_read_at_the_next_visit(
    honest: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert visit(honest, capfd) == ""
    desk = Desk(EditConfig(map=honest / "map.yaml", doors=None))
    (honest / "map.png").unlink()
    with pytest.raises(ClosedroomsError, match="missing"):
        desk.session("visitor")
    (honest / "map.png").write_bytes(inputs.picture())
    assert desk.session("visitor").trouble == ""


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (1, 500), (3, 2000), (40, 40)])
@pytest.mark.parametrize("grey", [0, 205, 254])
def test_maps_with_nothing_on_them_are_edited_or_refused_in_one_line(
    honest: Path, shape: tuple[int, int], grey: int, capfd: pytest.CaptureFixture[str]
) -> None:
    Image.fromarray(np.full(shape, grey, dtype=np.uint8)).save(honest / "map.png")
    said = visit(honest, capfd)
    assert bool(said) == (min(shape) < 2)


def test_a_defect_is_told_in_one_line_too(
    honest: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(_: EditConfig) -> None:
        raise IndexError("at\nnothing")

    monkeypatch.setattr("closedrooms.web.server.open_sheet", broken)
    with pytest.raises(ClosedroomsError, match="internal error, please report it: IndexError: at nothing"):
        Desk(EditConfig(map=honest / "map.yaml", doors=None)).session("visitor")
    assert len(capfd.readouterr().err.splitlines()) == 1


HEAD = " HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n"
OPEN = "GET /?token={token}" + HEAD + "\r\n"
SOCKET = (
    " HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
)
# What comes in over the wire, byte by byte; none of it is let in. {path} stands for anything that the server has.
REQUESTS = {
    "no token": "GET {path}" + HEAD + "\r\n",
    "an empty token": "GET {path}?token=" + HEAD + "\r\n",
    "two tokens, the first wrong": "GET {path}?token=x&token={token}" + HEAD + "\r\n",
    "a token of a megabyte": "GET {path}?token={long}" + HEAD + "\r\n",
    "a token that is no text": "GET {path}?token=%ff%00%0d%0a" + HEAD + "\r\n",
    "the token in another cookie": "GET {path}" + HEAD + "Cookie: token={token}\r\n\r\n",
    "another host": "GET {path}?token={token} HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n",
    "no host": "GET {path}?token={token} HTTP/1.0\r\n\r\n",
    "another origin": "GET {path}?token={token}" + HEAD + "Origin: http://evil\r\n\r\n",
    "a path that leads out": "GET /../../../etc/passwd" + HEAD + "\r\n",
    "an upload": "POST {path}" + HEAD + "Content-Length: 5\r\n\r\nhello",
    "a negative length": "POST {path}" + HEAD + "Content-Length: -5\r\n\r\nx",
    "chunks that are none": "POST {path}" + HEAD + "Transfer-Encoding: chunked\r\n\r\nzz\r\n",
    "a socket": "GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket" + SOCKET + "\r\n",
    "a socket from another page": "GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket&token={token}"
    + SOCKET
    + "Origin: http://evil\r\n\r\n",
    "a method that is none": "BREW {path}" + HEAD + "\r\n",
    "another protocol": "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
    "a header of a megabyte": "GET {path}" + HEAD + "X: {long}\r\n\r\n",
}
# To these there is no answer: the connection is closed when they are sent.
HALVES = {
    "half a request": "GET / HTT",
    "nothing": "",
    "line ends alone": "\r\n" * 2000,
    "an upload that breaks off": "POST /?token={token}" + HEAD + "Content-Length: 999999999999\r\n\r\nx",
}
PATHS = ("/", "/_nicegui/x", "/_nicegui_ws/socket.io/?EIO=4&transport=polling", "/docs", "/openapi.json")


def talk(port: int, text: str, *, listen: bool = True) -> bytes:
    """Send something and take what comes until the server ends it; nothing where it cuts the connection."""
    with socket.create_connection(("127.0.0.1", port), timeout=120) as connection:
        said = b""
        try:
            connection.sendall(text.encode("latin-1"))
            while listen and (block := connection.recv(65536)):
                said += block
        except ConnectionError:
            pass
    return said


def test_nothing_on_the_wire_is_let_in_or_ends_the_server(honest: Path) -> None:
    words = ["edit", "--no-browser", str(honest / "map.yaml")]
    server = subprocess.Popen(
        [sys.executable, "-m", "closedrooms.cli", *words], cwd=honest, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        assert server.stdout is not None
        found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)\n", server.stdout.readline())
        assert found is not None
        port, token = int(found[1]), found[2]
        wanted = talk(port, OPEN.format(port=port, token=token))
        assert wanted.startswith(b"HTTP/1.1 200 ")
        for name, request in REQUESTS.items():
            for path in PATHS if "{path}" in request else ("",):
                said = talk(
                    port, request.format(port=port, token=token, path=path, long="x" * 1_000_000, socket=SOCKET)
                )
                assert not said or said.split(b" ", 2)[1] in {b"400", b"403", b"405", b"431"}, (name, path, said[:300])
        for half in HALVES.values():
            talk(port, half.format(port=port, token=token), listen=False)
        # Connections that say nothing hold nobody up, and stay open while the server is ended.
        silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(50)]
        assert talk(port, OPEN.format(port=port, token=token)).startswith(b"HTTP/1.1 200 ")
        server.send_signal(signal.SIGTERM)
        _, errors = server.communicate(timeout=120)
        for connection in silent:
            connection.close()
    finally:
        server.kill()
        server.wait()
    assert server.returncode == 128 + signal.SIGTERM
    assert "Traceback" not in errors
    assert [line for line in errors.splitlines() if line.startswith("closedrooms: ")] == [
        "closedrooms: terminated; nothing half-written was left behind"
    ]
