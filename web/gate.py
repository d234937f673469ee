"""Who may talk to the server: whoever was given the address with its token, and nobody else on this machine.

A browser that opens the printed address gets a cookie; everything else that comes, pages of other programs included,
is refused. A second cookie tells visitors apart, so that each keeps drafts of their own.
"""

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

VISITOR = "closedrooms_visitor"
REFUSED = b"closedrooms edit: open the address with the token that the terminal shows\n"
# How long a visitor is known, and with them their drafts [s]: a year.
REMEMBERED = 31_536_000


class Gate:
    """ASGI middleware before the page.

    Args:
        app: What it guards.
        token: Secret of this server.
        port: Of this server; cookies of one host are shared by its ports.
    """

    def __init__(self, app: App, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"closedrooms_token_{port}"
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request pass, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        cookies = read_cookies(scope)
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        invited = _same(given, self._token)
        if not self._from_here(scope) or not (invited or _same(cookies.get(self._cookie, ""), self._token)):
            await _refuse(scope, receive, send)
            return
        fresh = [] if cookies.get(VISITOR) else [(VISITOR, secrets.token_urlsafe(16))]
        fresh += [(self._cookie, self._token)] if invited else []
        scope["closedrooms_visitor"] = cookies.get(VISITOR) or fresh[0][1]

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start" and invited:
                headers = [(b"set-cookie", _cookie(name, value)) for name, value in fresh]
                message = {**message, "headers": [*message.get("headers", []), *headers]}
            await send(message)

        await self._app(scope, receive, answer)

    def _from_here(self, scope: Scope) -> bool:
        """Check that the address and, where a page asks, that page's own are this server's (no DNS rebinding)."""
        headers = dict(scope["headers"])
        origin = headers.get(b"origin", b"").decode("latin-1")
        return headers.get(b"host", b"").decode("latin-1") in self._hosts and (
            not origin or origin.removeprefix("http://") in self._hosts
        )


def read_cookies(scope: Scope) -> dict[str, str]:
    """Read the cookies of a request; none where they cannot be read."""
    text = "; ".join(value.decode("latin-1") for name, value in scope["headers"] if name == b"cookie")
    try:
        return {name: morsel.value for name, morsel in SimpleCookie(text).items()}
    except CookieError:
        return {}


def _same(given: str, token: str) -> bool:
    """Compare a token in a time that tells nothing of it."""
    return secrets.compare_digest(given.encode("utf-8", "replace"), token.encode())


def _cookie(name: str, value: str) -> bytes:
    """Write a ``Set-Cookie`` header; only the visitor's outlives the browser."""
    age = f"; Max-Age={REMEMBERED}" if name == VISITOR else ""
    return f"{name}={value}; Path=/; HttpOnly; SameSite=Strict{age}".encode()


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer a request without a token: 403, or a closed socket."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(REFUSED)).encode())]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": REFUSED})
