import asyncio
from typing import Any

import pytest

from closedrooms.web.gate import VISITOR, Gate

PORT = 4711
HOST = (b"host", b"127.0.0.1:4711")


def ask(
    *headers: tuple[bytes, bytes], query: str = "", kind: str = "http"
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """What the gate answers, and what it handed on to the page."""
    sent: list[dict[str, Any]] = []
    passed: dict[str, Any] = {}

    async def page(scope: Any, _receive: Any, send: Any) -> None:
        passed.update(scope)
        await send({"type": f"{kind}.response.start", "status": 200, "headers": []})

    async def receive() -> dict[str, Any]:
        return {"type": f"{kind}.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": kind, "headers": list(headers), "query_string": query.encode()}
    asyncio.run(Gate(page, "secret", PORT)(scope, receive, send))
    return sent, passed


def test_the_token_opens_the_gate_and_leaves_cookies_that_open_it_again() -> None:
    sent, passed = ask(HOST, query="token=secret")
    assert sent[0]["status"] == 200
    cookies = [value.decode() for name, value in sent[0]["headers"] if name == b"set-cookie"]
    assert len(cookies) == 2
    assert all("HttpOnly; SameSite=Strict" in cookie for cookie in cookies)
    given = "; ".join(cookie.split(";")[0] for cookie in cookies)
    sent, again = ask(HOST, (b"cookie", given.encode()))
    assert sent[0]["status"] == 200
    assert again["closedrooms_visitor"] == passed["closedrooms_visitor"]
    assert ask(HOST, (b"cookie", given.encode()), kind="websocket")[1]


@pytest.mark.parametrize(
    ("headers", "query"),
    [
        ((HOST,), ""),
        ((HOST,), "token="),
        ((HOST,), "token=secre"),
        ((HOST,), "token=%ff%00"),
        ((HOST, (b"cookie", b"closedrooms_token_4712=secret")), ""),
        ((HOST, (b"cookie", b"closedrooms_token_4711=wrong")), ""),
        ((HOST, (b"cookie", b"\xff;;==")), ""),
        (((b"host", b"evil.example"),), "token=secret"),
        ((), "token=secret"),
        ((HOST, (b"origin", b"http://evil.example")), "token=secret"),
        ((HOST, (b"origin", b"null")), "token=secret"),
    ],
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_all_else_is_refused(headers: tuple[tuple[bytes, bytes], ...], query: str, kind: str) -> None:
    sent, passed = ask(*headers, query=query, kind=kind)
    assert not passed
    assert sent[0].get("status") == 403 or sent[0]["type"] == "websocket.close"


def test_two_visitors_are_told_apart_and_one_is_known_again() -> None:
    _, one = ask(HOST, query="token=secret")
    _, two = ask(HOST, query="token=secret")
    assert one["closedrooms_visitor"] != two["closedrooms_visitor"]
    known = f"{VISITOR}={one['closedrooms_visitor']}".encode()
    assert ask(HOST, (b"cookie", known), query="token=secret")[1]["closedrooms_visitor"] == one["closedrooms_visitor"]
