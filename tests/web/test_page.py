"""The page in headless Chromium, as somebody uses it."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from closedrooms.cli.commands import main
from closedrooms.core.files.geojson import read_doors

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
MISSING = [
    what
    for what, there in (
        ("nicegui (pip install 'closedrooms[web]')", find_spec("nicegui")),
        ("playwright", find_spec("playwright")),
        ("chromium (Debian: apt-get install chromium)", BROWSER),
    )
    if not there
]
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"not on this machine: {', '.join(MISSING)}")

SWITCHES = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-dev-shm-usage")
# The doors of the corridor, on the walls beside the leaves: where people click.
CLICKS = ((3.05, -0.05), (8.05, -0.05), (13.0, 2.05))
# Nothing takes so long but on a machine with much other work [ms].
WAIT = 300_000

Serve = Callable[..., "Server"]


class Server:
    """``closedrooms edit`` as a process."""

    def __init__(self, *words: str | Path, state: Path) -> None:
        environment = {**os.environ, "XDG_STATE_HOME": str(state), "PYTHONPATH": os.pathsep.join(sys.path)}
        command = [sys.executable, "-m", "closedrooms.cli.commands", "edit", "--no-browser", *map(str, words)]
        # From another folder: `coverage/` of ours would hide a package of this name.
        self.process = subprocess.Popen(
            command, cwd=state.parent, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()

    def stop(self) -> tuple[int, str]:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        _, errors = self.process.communicate(timeout=WAIT / 1000)
        return self.process.returncode, errors


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts servers with one state folder; all are stopped in the end."""
    (tmp_path / "state").mkdir()
    servers: list[Server] = []

    def start(*words: str | Path) -> Server:
        servers.append(Server(*words, state=tmp_path / "state"))
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=\S{16,}", servers[-1].address), servers[-1].stop()
        return servers[-1]

    yield start
    for server in servers:
        _, errors = server.stop()
        assert "Traceback" not in errors, errors


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=list(SWITCHES))
        yield browser
        browser.close()


class Visitor:
    """A browser of one person; what its console complains of fails the test in the end."""

    def __init__(self, chromium: Any, *, width: int = 1280, height: int = 800) -> None:
        self.context = chromium.new_context(viewport={"width": width, "height": height})
        self.context.set_default_timeout(WAIT)
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda said: self.complaints.append(said.text) if said.type == "error" else None)
        self.page.on("request", self._requested)

    def _requested(self, request: Any) -> None:
        if not request.url.startswith(("http://127.0.0.1", "data:", "blob:")):
            self.complaints.append(f"asks for {request.url}")

    def visit(self, address: str) -> None:
        self.page.goto(address)
        self.page.wait_for_selector(".leaflet-image-layer")

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the map is on the screen."""
        at = self.page.evaluate(
            """([x, y]) => { const box = document.querySelector('.leaflet-container');
            const p = getElement(Number(box.id.slice(1))).map.latLngToContainerPoint([y, x]);
            const r = box.getBoundingClientRect(); return [r.x + p.x, r.y + p.y]; }""",
            [x, y],
        )
        return at[0], at[1]

    def click(self, x: float, y: float) -> None:
        self.page.mouse.click(*self.pixel(x, y))

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.page.mouse.move(*self.pixel(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.pixel(*end), steps=8)
        self.page.mouse.up()

    def wait(self, status: str) -> None:
        """Wait until the status line matches."""
        self.page.wait_for_function(
            "pattern => new RegExp(pattern).test(document.querySelector('[data-id=status]').innerText)",
            arg=status,
        )

    def names(self) -> list[str]:
        return self.page.eval_on_selector_all("[data-id=doors] input[data-door]", "all => all.map(i => i.value)")

    def behind(self) -> list[str]:
        return self.page.locator("[data-id=behind]").all_inner_texts()

    def answer(self, button: str) -> None:
        self.page.get_by_role("button", name=button, exact=True).click()


@contextlib.contextmanager
def visiting(chromium: Any, address: str, **size: int) -> Iterator[Visitor]:
    visitor = Visitor(chromium, **size)
    visitor.visit(address)
    yield visitor
    visitor.context.close()
    assert visitor.complaints == []


def set_three_doors(visitor: Visitor) -> None:
    for number, place in enumerate(CLICKS, start=1):
        visitor.click(*place)
        visitor.wait(rf"^{number} rooms? behind {number} doors?, ")


def test_three_doors_are_marked_dragged_undone_saved_and_are_what_predict_makes_of_them(
    corridor: Path, tmp_path: Path, serve: Serve, chromium: Any
) -> None:
    out = tmp_path / "saved"
    server = serve(corridor, "--out", out)
    with visiting(chromium, server.address) as visitor:
        visitor.wait("click on a wall")
        set_three_doors(visitor)
        assert visitor.names() == ["d00", "d01", "d02"]
        assert all("m²" in line for line in visitor.behind())
        before = visitor.behind()
        visitor.drag((3.0, -0.125), (3.6, -0.1))
        visitor.page.wait_for_function(
            "before => document.querySelectorAll('[data-id=behind]')[0].innerText !== before", arg=before[0]
        )
        visitor.wait("^3 rooms behind 3 doors, ")
        visitor.page.keyboard.press("Control+z")
        visitor.page.wait_for_function(
            "before => document.querySelectorAll('[data-id=behind]')[0].innerText === before", arg=before[0]
        )
        visitor.page.locator("[data-id=save]").click()
        visitor.wait(f"saved to {re.escape(str(out))}$")
        visitor.page.reload()
        visitor.page.wait_for_selector(".leaflet-image-layer")
        visitor.wait("click on a wall")  # all is saved: nothing is left to offer
        assert visitor.names() == []
    assert server.stop()[0] == 130
    assert (
        main(["predict", str(corridor), "--doors", str(out / "doors.geojson"), "--out", str(tmp_path / "again")]) == 0
    )
    files = {path.name for path in out.iterdir()}
    again = {path.name for path in (tmp_path / "again").iterdir()}
    assert files == again | {"tour.geojson"}
    for name in again - {"run.json"}:
        assert (out / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    for (x, y), door in zip(((3.0, -0.1), (8.0, -0.1), (13.0, 2.1)), read_doors(out / "doors.geojson"), strict=True):
        assert door.midpoint == pytest.approx((x, y), abs=0.08)
        assert door.width == pytest.approx(0.9, abs=0.1)


def test_two_people_keep_their_own_state_and_find_it_again_when_the_server_died(
    corridor: Path, serve: Serve, chromium: Any
) -> None:
    server = serve(corridor)
    with visiting(chromium, server.address) as one, visiting(chromium, server.address) as two:
        one.click(*CLICKS[0])
        one.wait("^1 room behind 1 door")
        two.click(*CLICKS[1])
        two.wait("^1 room behind 1 door")
        two.click(*CLICKS[2])
        two.wait("^2 rooms behind 2 doors")
        assert one.names() == ["d00"]
        server.process.kill()
        server = serve(corridor)
        for visitor, doors in ((one, 1), (two, 2)):
            visitor.complaints.clear()  # the lost connection
            visitor.page.goto(server.address)
            visitor.page.get_by_text(f"you left {doors} door").wait_for()
            visitor.complaints.clear()
            visitor.answer("go on")
            visitor.wait(f"^{doors} rooms? behind {doors} door")
            visitor.page.screenshot()


def test_a_proposal_is_accepted_another_dismissed_and_a_door_renamed_turned_and_deleted_by_keys(
    corridor: Path, serve: Serve, chromium: Any
) -> None:
    server = serve(corridor)
    with visiting(chromium, server.address, width=400, height=760) as visitor:
        page = visitor.page
        page.wait_for_function("document.querySelectorAll('.handle-proposal').length === 3")
        page.keyboard.press("p")
        visitor.wait("^1 room behind 1 door")
        page.get_by_role("button", name=re.compile("dismiss proposal")).first.click()
        page.wait_for_function("document.querySelectorAll('.handle-proposal').length === 1")
        name = page.locator("[data-id=doors] input").first
        name.fill("kitchen <b>")
        name.press("Enter")
        page.wait_for_function("document.querySelector('.handle-chosen')?.dataset.label === 'kitchen <b>'")
        page.locator(".leaflet-container").focus()
        before = page.get_by_label("direction").input_value()
        page.locator("body").press("]")
        page.wait_for_function(
            "before => document.querySelectorAll('[data-id=doors] input')[2].value !== before", arg=before
        )
        page.locator("body").press("Escape")
        page.locator(".handle-chosen").wait_for(state="detached")
        page.get_by_role("button", name="door kitchen").focus()
        page.keyboard.press("Enter")
        page.locator(".handle-chosen").wait_for()
        # Doors are drawn anew; the focus stays on the one that was reached by keys.
        page.keyboard.press("ArrowUp")
        visitor.wait("^1 room behind 1 door")
        page.wait_for_function("document.activeElement.getAttribute('aria-label') === 'chosen kitchen <b>'")
        page.locator("body").press("Delete")
        visitor.wait("click on a wall")
        # A narrow screen shows all of the page without a sideways scroll.
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def test_ctrl_s_saves_from_within_a_field_and_keys_work_after_a_name_was_typed(
    corridor: Path, tmp_path: Path, serve: Serve, chromium: Any
) -> None:
    server = serve(corridor, "--out", tmp_path / "saved")
    with visiting(chromium, server.address) as visitor:
        visitor.click(*CLICKS[0])
        visitor.wait("^1 room behind 1 door")
        name = visitor.page.locator("[data-id=doors] input").first
        name.fill("kitchen")
        name.press("Enter")
        visitor.page.locator("[data-door=kitchen]").wait_for()
        visitor.page.keyboard.press("Escape")
        visitor.page.locator(".handle-chosen").wait_for(state="detached")
        visitor.page.locator("[data-door=kitchen]").click()
        visitor.page.keyboard.press("Control+s")
        visitor.wait(f"saved to {re.escape(str(tmp_path / 'saved'))}$")
        visitor.page.keyboard.press("Control+s")
        visitor.answer("keep it")
    assert [door.id for door in read_doors(tmp_path / "saved" / "doors.geojson")] == ["kitchen"]


def test_a_name_that_is_being_typed_and_the_focus_outlive_a_prediction(
    corridor: Path, serve: Serve, chromium: Any
) -> None:
    server = serve(corridor)
    with visiting(chromium, server.address) as visitor:
        visitor.click(*CLICKS[0])
        visitor.wait("^1 room behind 1 door")
        name = visitor.page.locator("[data-id=doors] input").first
        name.fill("kitchen")
        # A click that takes no focus: rooms are predicted anew while the name is not finished.
        visitor.page.locator(".handle-proposal").first.dispatch_event("click")
        visitor.wait("^2 rooms behind 2 doors")
        assert visitor.page.evaluate("document.activeElement.value") == "kitchen"
        name.press("End")
        name.press("2")
        name.press("Enter")
        visitor.page.locator("[data-door=kitchen2]").wait_for()
        assert visitor.names() == ["kitchen2", "d01"]
        name.fill("d01")
        name.press("Enter")
        visitor.page.wait_for_function("document.querySelector('[data-door=kitchen2]').value === 'kitchen2'")
        visitor.page.keyboard.press("Control+z")
        visitor.page.wait_for_function("document.querySelector('[data-door=d00]')?.value === 'd00'")


def test_a_room_beyond_the_view_is_shown_by_a_key_and_a_door_by_the_list(
    corridor: Path, serve: Serve, chromium: Any
) -> None:
    server = serve(corridor)
    with visiting(chromium, server.address) as visitor:
        visitor.click(*CLICKS[0])
        visitor.wait("^1 room behind 1 door")
        visitor.page.locator("body").press("Escape")
        for _ in range(20):
            visitor.page.locator("body").press("ArrowRight")
        visitor.page.wait_for_function("() => document.querySelector('.handle-note').getBoundingClientRect().x < 0")
        visitor.page.locator("body").press("0")
        visitor.page.wait_for_function("() => document.querySelector('.handle-note').getBoundingClientRect().x > 0")
        wide = visitor.pixel(1.0, 0.0)[0] - visitor.pixel(0.0, 0.0)[0]
        visitor.page.get_by_label("select and show on the map").click()
        visitor.page.wait_for_function(
            """wide => { const box = document.querySelector('.leaflet-container');
            const map = getElement(Number(box.id.slice(1))).map;
            return map.latLngToContainerPoint([0, 1]).x - map.latLngToContainerPoint([0, 0]).x > 1.2 * wide; }""",
            arg=wide,
        )
        x, y = visitor.pixel(*CLICKS[0])
        box = visitor.page.locator(".leaflet-container").bounding_box()
        assert box["x"] < x < box["x"] + box["width"]
        assert box["y"] < y < box["y"] + box["height"]


def test_the_tour_the_completed_map_and_another_method_can_be_chosen(
    corridor: Path, tmp_path: Path, serve: Serve, chromium: Any
) -> None:
    doors = tmp_path / "doors.geojson"
    points = {"type": "MultiPoint", "coordinates": [[3.0, -0.1], [14.0, 5.0]]}
    doors.write_text(json.dumps({"type": "Feature", "properties": {"id": "a"}, "geometry": points}))
    server = serve(corridor, "--doors", doors)
    with visiting(chromium, server.address) as visitor:
        visitor.wait("^1 room behind 2 doors")
        assert visitor.behind()[1] == "it lies outside the known map"
        visitor.page.get_by_label("completed map").click()
        visitor.page.wait_for_function("document.querySelectorAll('.leaflet-image-layer').length === 2")
        visitor.page.get_by_label("tour").click()
        visitor.wait("tour [0-9.]+ m$")
        visitor.page.get_by_label("tour").click()
        visitor.wait("^1 room behind 2 doors, [0-9.]+ s$")
        visitor.page.get_by_label("tour").click()
        visitor.wait("tour [0-9.]+ m$")
        visitor.page.locator("[data-id=method]").click()
        visitor.page.get_by_role("option", name="line-of-sight").click()
        visitor.wait("no tour: the rooms of the method line-of-sight overlap")
        visitor.page.get_by_label("settings of the method").click()
        visitor.page.get_by_label("max_free").fill("7")
        visitor.answer("predict with these")
        visitor.page.get_by_text("expected shares between 0 and 1").wait_for()
        visitor.answer("cancel")


def test_a_hostile_map_and_a_hostile_list_of_doors_are_told_on_the_page(
    corridor: Path, tmp_path: Path, serve: Serve, chromium: Any
) -> None:
    doors = tmp_path / "doors.geojson"
    doors.write_text('{"type": "Feature", "geometry": {"type": "Point", "coordinates": [1e999, 0]}}')
    server = serve(corridor, "--doors", doors)
    with visiting(chromium, server.address) as visitor:
        visitor.page.get_by_text("no doors were read").wait_for()
        visitor.wait("click on a wall")
        with visitor.page.expect_file_chooser() as chooser:
            visitor.page.get_by_label("take doors from a GeoJSON file").click()
        chooser.value.set_files({"name": "<i>.geojson", "mimeType": "text/plain", "buffer": b"[" * 100_000})
        visitor.page.get_by_text("broken JSON").or_(visitor.page.get_by_text("nested")).first.wait_for()
        with visitor.page.expect_file_chooser() as chooser:
            visitor.page.get_by_label("take doors from a GeoJSON file").click()
        chooser.value.set_files({"name": "big.geojson", "mimeType": "text/plain", "buffer": b" " * 20_000_001})
        visitor.page.get_by_text("more than 20 MB").wait_for()
        assert visitor.names() == []
    server.stop()
    corridor.write_text("image: map.png\nresolution: -1\norigin: [0, 0, 0]\n")
    server = serve(corridor)
    visitor = Visitor(chromium)
    visitor.page.goto(server.address)
    visitor.page.get_by_text("map resolution -1").wait_for()
    visitor.context.close()
    assert visitor.complaints == []


def test_whoever_has_no_token_is_refused(corridor: Path, serve: Serve) -> None:
    server = serve(corridor)
    address = server.address.partition("?")[0]
    foreign = urllib.request.Request(server.address, headers={"Host": "evil.example"})
    polling = "_nicegui_ws/socket.io/?EIO=4&transport=polling"
    for request in (foreign, *(address + place for place in ("", "?token=", "?token=guess", polling))):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=WAIT / 1000)
        assert refused.value.code == 403
        refused.value.close()
    with urllib.request.urlopen(server.address, timeout=WAIT / 1000) as answer:
        assert answer.status == 200
