"""Bad input over all formats and commands: one line of ours or a result, in bounded time, and nothing left behind.

Any exception that is not ours fails. ``cases.py`` beside this runs folders of such cases as processes.
"""

import io
import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import inputs
import pytest
from PIL import Image

from closedrooms.cli.commands import main
from closedrooms.core.errors import ClosedroomsError

FORMATS, MUTATIONS = inputs.FORMATS, inputs.MUTATIONS
# In no format can these be read.
REFUSED = {*inputs.PLACES, "empty", "zeros", "brackets", "tags"}
# Every single answer comes within this time of the processor, and where it only waits, within the other one [s].
PATIENCE, WAITING = 20, 600


@contextmanager
def patience() -> Iterator[None]:
    def stop(*_: object) -> None:
        # Not an error that a reader would turn into one of ours.
        pytest.fail(f"no answer in {PATIENCE} s")

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, PATIENCE), signal.SIGALRM: (signal.ITIMER_REAL, WAITING)}
    before = {number: signal.signal(number, stop) for number in timers}
    try:
        for timer, seconds in timers.values():
            signal.setitimer(timer, seconds)
        yield
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0)
            signal.signal(number, before[number])


def refusal(kind: str, path: Path) -> str:
    """What the reader of a format says of a file; empty when it reads it. Another exception fails the test."""
    said = ""
    with patience():
        try:
            FORMATS[kind].read(path)
        except ClosedroomsError as error:
            said = str(error)
    assert not said or said.isprintable()
    assert len(said) < 3000
    return said


@pytest.mark.parametrize("kind", FORMATS)
def test_the_honest_file_is_read(tmp_path: Path, kind: str) -> None:
    path = tmp_path / FORMATS[kind].name
    (tmp_path / "map.png").write_bytes(inputs.picture())
    path.write_bytes(FORMATS[kind].content)
    assert refusal(kind, path) == ""


@pytest.mark.parametrize("mutation", MUTATIONS)
@pytest.mark.parametrize("kind", FORMATS)
def test_a_spoilt_file_is_read_or_refused_in_one_line(tmp_path: Path, kind: str, mutation: str) -> None:
    path = tmp_path / FORMATS[kind].name
    if kind == "map":
        (tmp_path / "map.png").write_bytes(inputs.picture())
    inputs.spoil(path, FORMATS[kind].content, mutation)
    said = refusal(kind, path)
    if mutation in REFUSED and (kind, mutation) != ("trajectory", "empty"):
        assert path.name in said


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", [kind for kind in FORMATS if FORMATS[kind].tree])
def test_every_value_may_be_anything(tmp_path: Path, kind: str, every: int) -> None:
    parse, write = FORMATS[kind].tree
    path = tmp_path / FORMATS[kind].name
    (tmp_path / "map.png").write_bytes(inputs.picture())
    refused = 0
    for place, value in inputs.spoilt_values(parse(FORMATS[kind].content), every=every):
        # A new file each time: to write over one makes some file systems wait for the disk.
        path.unlink(missing_ok=True)
        path.write_bytes(write(value))
        try:
            refused += bool(refusal(kind, path))
        except Exception as error:
            raise AssertionError(f"{place}: {type(error).__name__}: {error}") from error
    assert refused > 0


COMMANDS = {
    "predict": ("map", ["predict", "map.yaml", "--doors", "doors.geojson", "--out", "out"]),
    "predict-doors": ("doors", ["predict", "map.yaml", "--doors", "doors.geojson", "--out", "out"]),
    "predict-picture": ("picture", ["predict", "map.yaml", "--doors", "doors.geojson", "--out", "out"]),
    "cover": ("map", ["cover", "map.yaml", "--out", "out"]),
    "doors": ("map", ["doors", "map.yaml", "--out", "out.geojson", "--picture", "out.png"]),
    "map": ("scans", ["map", "scans.npz", "--no-record", "--out", "out"]),
    "map-log": ("carmen-gz", ["map", "c.log.gz", "--no-record", "--out", "out"]),
    "show": ("plan", ["worlds", "show", "plan.json", "--out", "out.png"]),
    "convert-json": ("rmf", ["worlds", "convert", "b.yaml", "out.json", "--to", "json", "--level", "L1"]),
    "convert-sdf": ("plan", ["worlds", "convert", "plan.json", "out.sdf", "--to", "sdf"]),
    "convert-stage": ("pyrobosim", ["worlds", "convert", "w.yaml", "out.world", "--to", "stage"]),
    "convert-rosmap": ("kth", ["worlds", "convert", "k.xml", "out", "--to", "rosmap"]),
}


def test_a_plan_that_makes_no_mesh_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("trimesh")  # its import takes longer than any answer on a busy machine
    inputs.spoil(tmp_path / "map.png", FORMATS["picture"].content, "doubled")
    words = ["worlds", "convert", "map.png", "out.obj", "--to", "obj"]
    status, complaints, new = answered(words, tmp_path, monkeypatch, capfd)
    assert (status, len(complaints), new) == (1, 1, set())
    assert complaints[0].endswith(": map.png")


QUICKLY = ["--repetitions", "1", "--workers", "1", "--out", "out"]
# These simulate where a file can still be read, so each sees few mutations: of the file, which ones, the command.
LONG = {
    "run": ("plan", ("half", "fifo", "exponents", "aliases"), ["run", "plan.json", "--no-record", "--out", "out"]),
    "dataset": ("plan", ("noise", "circle", "huge-numbers"), ["dataset", "plan.json", "--max-closed", "1", *QUICKLY]),
    "robustness": ("plan", ("but-two", "device", "nan"), ["robustness", "plan.json", "--factors", "shift", *QUICKLY]),
}
EVALUATE = [
    "evaluate",
    "data",
    "--methods",
    "paper",
    "--no-tours",
    "--resamples",
    "20",
    "--workers",
    "1",
    "--out",
    "out",
]
SAMPLE = {"map.yaml": "map", "map.png": "picture", "truth.yaml": "map", "doors.geojson": "doors",
          "truth_rooms.geojson": "rooms", "run.json": "manifest"}  # fmt: skip
# The readers have seen every mutation above; the commands see one of each kind of failure.
SEEN = ("missing", "half", "noise", "huge-numbers", "brackets", "aliases", "fifo", "dangling", "exponents")


def answer(
    command: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> tuple[int, list[str], set[str]]:
    """Exit status, lines of complaint and what is new in the folder; files that were there are unchanged."""
    return answered(COMMANDS[command][1], folder, monkeypatch, capfd)


def answered(
    words: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> tuple[int, list[str], set[str]]:
    """As :func:`answer`, of a command line."""
    monkeypatch.chdir(folder)
    before = {path: path.lstat() for path in folder.rglob("*")}
    with patience():
        status = main(words)
    said = capfd.readouterr()
    for text in (said.out, said.err):
        assert "\x1b" not in text
        assert "Traceback" not in text
        assert "internal error" not in text
    after = {path: path.lstat() for path in folder.rglob("*")}
    for path, stat in before.items():
        assert (after[path].st_mtime_ns, after[path].st_ino) == (stat.st_mtime_ns, stat.st_ino)
    complaints = [line for line in said.err.splitlines() if not line.endswith(" ...")]
    return status, complaints, {path.name for path in after.keys() - before.keys() if path.parent == folder}


def honest(folder: Path) -> None:
    for other in FORMATS.values():
        (folder / other.name).write_bytes(other.content)


@pytest.mark.parametrize("mutation", SEEN)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_on_a_spoilt_file_says_one_line_and_leaves_nothing(
    tmp_path: Path, command: str, mutation: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    honest(tmp_path)
    kind = COMMANDS[command][0]
    path = tmp_path / FORMATS[kind].name
    path.unlink()
    inputs.spoil(path, FORMATS[kind].content, mutation)
    status, complaints, new = answer(command, tmp_path, monkeypatch, capfd)
    assert status in {0, 1, 3}
    assert len(complaints) <= 3
    if status == 1:
        assert new == set()
        assert any(path.name in line for line in complaints)


@pytest.mark.parametrize(
    ("command", "mutation"), [(command, mutation) for command, (_, some, _) in LONG.items() for mutation in some]
)
def test_a_long_command_on_a_spoilt_plan_says_one_line_and_leaves_nothing(
    tmp_path: Path, command: str, mutation: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    kind, _, words = LONG[command]
    path = tmp_path / FORMATS[kind].name
    inputs.spoil(path, FORMATS[kind].content, mutation)
    status, complaints, new = answered(words, tmp_path, monkeypatch, capfd)
    assert (status, new) == (1, set())
    assert len(complaints) == 1
    assert path.name in complaints[0]


def sample(folder: Path) -> Path:
    """A sample as somebody else may have put it together."""
    (folder / "data" / "s").mkdir(parents=True)
    contents = {kind: other.content for kind, other in FORMATS.items()}
    contents["manifest"] = json.dumps({"world": "w", "closed": ["d0"], "metrics": {"rooms_seen": 1}}).encode()
    for name, kind in SAMPLE.items():
        (folder / "data" / "s" / name).write_bytes(contents[kind])
    (folder / "data" / "s" / "truth.yaml").write_bytes(contents["map"])
    return folder / "data" / "s"


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The libraries of an evaluation, which take longer than any answer on a busy machine."""
    folder = tmp_path_factory.mktemp("honest")
    sample(folder)
    words = [str(folder / word) if word in {"data", "out"} else word for word in EVALUATE]
    assert main([*words, "-q"]) == 0


@pytest.mark.usefixtures("imported")
@pytest.mark.parametrize("mutation", ["empty", "half", "brackets", "exponents", "fifo", "dangling"])
@pytest.mark.parametrize("name", SAMPLE)
def test_an_evaluation_tells_a_spoilt_sample_and_goes_on(
    tmp_path: Path, name: str, mutation: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    path = sample(tmp_path) / name
    content = path.read_bytes()
    path.unlink()
    inputs.spoil(path, content, mutation)
    status, complaints, new = answered(EVALUATE, tmp_path, monkeypatch, capfd)
    assert status in {0, 1, 3}
    assert len(complaints) <= 3
    assert new <= {"out"}
    assert status != 0 or mutation == "exponents"
    assert status == 0 or "data" in complaints[0]


def circle(folder: Path) -> None:
    (folder / "out").symlink_to("out")


def palette(folder: Path) -> None:
    """Transparent colours, of which Pillow warns."""
    picture = Image.open(io.BytesIO(FORMATS["picture"].content)).convert("P")
    picture.save(folder / "map.png", transparency=bytes([0, 128, 255]))


def twice(folder: Path) -> None:
    (folder / "map.yaml").write_bytes(FORMATS["map"].content + b"resolution: 0.10\n")


PREDICT = COMMANDS["predict"][1]
OVER = ["doors", "map.yaml", "--out", "out.geojson", "--picture", "map.png", "--force"]
LEARN = [*PREDICT, "--method", "x" * 5000]
LONG_NAME = "x" * 300
# What was badly answered when it was invented: how the folder is prepared, the command, what the line says.
INVENTED = {
    "a circle of links as output": (circle, PREDICT, "out"),
    "a circle of links above it": (circle, [*PREDICT[:-1], "out/below"], "out/below"),
    "a circle of links for a dataset": (circle, ["dataset", "plan.json", "--out", "out"], "out"),
    "a circle of links for an evaluation": (circle, EVALUATE, "out"),
    "a circle of links for a sweep": (circle, ["robustness", "plan.json", "--out", "out"], "out"),
    "a circle of links that is read": (circle, ["predict", "out", "--doors", "doors.geojson", "--out", "o"], "out"),
    "the picture of the map as output": (lambda _: None, OVER, "a file that was read"),
    "a key that stands twice": (twice, PREDICT, "the key 'resolution' twice"),
    "a name of 5000 letters": (lambda _: None, LEARN, "expected one of"),
    "a dataset of 300 letters": (lambda _: None, ["evaluate", LONG_NAME, "--out", "out"], "no such folder"),
    "transparent colours of a palette": (palette, PREDICT, ""),
}


@pytest.mark.parametrize("case", INVENTED)
def test_what_was_invented_is_answered_in_one_line(
    tmp_path: Path, case: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    prepare, words, wanted = INVENTED[case]
    honest(tmp_path)
    sample(tmp_path)
    prepare(tmp_path)
    status, complaints, new = answered(words, tmp_path, monkeypatch, capfd)
    if wanted:
        assert (status, len(complaints), new) == (2 if words is LEARN else 1, 1, set())
        assert wanted in complaints[0]
        assert len(complaints[0]) < 400
    else:
        assert status in {0, 3}
        assert not any("warn" in line.lower() for line in complaints)


NAMES = [
    "\x1b[2J\x1b[31mowned",
    "$x_{$",
    "[red]x[/red]",
    "../../../x",
    "<script>",
    "|a|`b`",
    "a\u202eb",
    "x" * 900,
    '"\\',
]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("command", ["predict", "show", "convert-sdf", "convert-rosmap-plan", "convert-stage-plan"])
def test_names_reach_no_terminal_picture_or_file_raw(
    tmp_path: Path, command: str, name: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    honest(tmp_path)
    doors = json.loads(FORMATS["doors"].content)
    doors["features"] = doors["features"][:1]
    doors["features"][0]["properties"]["id"] = name
    (tmp_path / "doors.geojson").write_text(json.dumps(doors))
    plan = json.loads(FORMATS["plan"].content)
    plan["rooms"][0]["label"] = plan["doors"][0]["id"] = plan["furniture"][0]["id"] = name
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    monkeypatch.setitem(
        COMMANDS, "convert-rosmap-plan", ("plan", ["worlds", "convert", "plan.json", "out", "--to", "rosmap"])
    )
    monkeypatch.setitem(
        COMMANDS, "convert-stage-plan", ("plan", ["worlds", "convert", "plan.json", "out.world", "--to", "stage"])
    )
    status, complaints, new = answer(command, tmp_path, monkeypatch, capfd)
    assert status in {0, 3}, complaints
    assert all(path.startswith("out") for path in new)
    if command == "convert-sdf":
        from xml.dom import minidom

        minidom.parse(str(tmp_path / "out.sdf"))
    if command == "convert-stage-plan":
        text = (tmp_path / "out.world").read_text()
        assert all(line.count('"') % 2 == 0 for line in text.splitlines())
        assert text.replace("\n", "").isprintable()
