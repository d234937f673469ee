"""``closedrooms edit``: serves the page on this machine until it is stopped."""

import contextlib
import secrets
import socket
import sys
import threading
import webbrowser
from collections.abc import Iterator
from functools import partial
from typing import Any

from closedrooms.core.errors import ClosedroomsError, OutputError, reason
from closedrooms.core.files.incoming import check_regular
from closedrooms.core.runtime.packages import require
from closedrooms.pipeline.reporting.progress import Progress
from closedrooms.web.config import EditConfig
from closedrooms.web.editing.drafts import Drafts
from closedrooms.web.editing.session import EditSession
from closedrooms.web.editing.sheet import MapSheet, open_sheet
from closedrooms.web.gate import Gate

HOST = "127.0.0.1"
# How long a page may be without its server, or a busy machine silent, before it begins anew from its draft [s].
LONGEST_BREAK = 120.0


def edit_map(config: EditConfig, *, progress: Progress) -> list[str]:  # noqa: ARG001 (the server says where it is)
    """Serve the page until Ctrl-C.

    A map or a list of doors that is there and cannot be read is told on the page.

    Raises:
        MissingPackageError: NiceGUI is not installed.
        InvalidInputError: The map or the doors are no regular files.
        OutputError: The port is taken.
    """
    require("nicegui", by="closedrooms edit", instead="closedrooms doors and closedrooms predict")
    check_regular(config.map, "a map (YAML)")
    if config.doors is not None:
        check_regular(config.doors, "closed doors (GeoJSON)")
    with _listening(config.port) as listener:
        port = listener.getsockname()[1]
        token = secrets.token_urlsafe(16)
        address = f"http://{HOST}:{port}/?token={token}"
        server = _server(config, token, port)
        sys.stdout.write(f"{address}\nCtrl-C ends it; what is not saved is kept for the next visit.\n")
        sys.stdout.flush()
        if config.browser:
            webbrowser.open_new_tab(address)
        server.run(sockets=[listener])
    return []


class Desk:
    """State that the visitors of one server share: the map, once it could be read."""

    def __init__(self, config: EditConfig) -> None:
        self._config, self._drafts = config, Drafts()
        self._sheet: MapSheet | None = None
        self._reading = threading.Lock()
        self._told = ""

    def prepare(self) -> None:
        """Read the map before the first visitor comes; what is wrong with it is told to them."""
        with contextlib.suppress(Exception):
            self._open()

    def _open(self) -> MapSheet:
        with self._reading:
            if self._sheet is None:
                self._sheet = open_sheet(self._config)
            return self._sheet

    def session(self, visitor: str) -> EditSession:
        """Begin the session of a page; what cannot be read is told on the page and in one line of the terminal.

        Raises:
            ClosedroomsError: The map cannot be read; the next visit tries again.
        """
        try:
            sheet = self._open()
        except Exception as error:
            self._tell(reason(error))
            raise ClosedroomsError(reason(error)) from error
        session = EditSession(self._config, sheet, self._drafts, visitor)
        if session.trouble:
            self._tell(session.trouble)
        return session

    def _tell(self, trouble: str) -> None:
        """Say it on the terminal, once for all visits in a row."""
        if trouble != self._told:
            self._told = trouble
            with contextlib.suppress(OSError, ValueError):  # nobody listens
                sys.stderr.write(f"closedrooms: {trouble}\n")
                sys.stderr.flush()


def _server(config: EditConfig, token: str, port: int) -> Any:
    """Set up the web server with the page behind its gate."""
    import uvicorn
    from fastapi import FastAPI
    from nicegui import ui
    from starlette.requests import Request

    from closedrooms.web.page.edit_page import open_page

    desk = Desk(config)
    threading.Thread(target=desk.prepare, daemon=True).start()

    async def page(request: Request) -> None:
        await open_page(partial(desk.session, request.scope["closedrooms_visitor"]))

    ui.page("/")(page)
    app = FastAPI(openapi_url=None)
    ui.run_with(app, title="closedrooms", show_welcome_message=False, reconnect_timeout=LONGEST_BREAK)
    settings = uvicorn.Config(
        Gate(app, token, port), log_level="warning", access_log=False, timeout_graceful_shutdown=1, lifespan="on"
    )
    return uvicorn.Server(settings)


@contextlib.contextmanager
def _listening(port: int) -> Iterator[socket.socket]:
    """Open a socket on this machine alone.

    Raises:
        OutputError: The port is taken or not allowed.
    """
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_STREAM)) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, port))
            listener.listen()  # whoever comes from now on waits until the server is up
        except OSError as error:
            raise OutputError(
                f"cannot listen on port {port} ({error.strerror}); expected a free one, or --port 0"
            ) from error
        yield listener
