"""Small honest inputs of every format, and the ways in which each is spoilt."""

import gzip
import io
import json
import os
import struct
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from closedrooms.core.files.geojson import read_doors, read_rooms
from closedrooms.core.files.rosmap import read_ros_map
from closedrooms.core.files.tum import read_trajectory
from closedrooms.mapping.logs import read_run
from closedrooms.worlds.library import load_world

FIXTURES = Path(__file__).parents[1] / "fixtures"


@dataclass(frozen=True)
class Format:
    """A format that comes in.

    Attributes:
        name: Of the file.
        content: An honest one.
        read: What reads it.
        tree: How its values are parsed and written again; ``None`` where it has none.
    """

    name: str
    content: bytes
    read: Callable[[Path], object]
    tree: tuple[Callable[[bytes], Any], Callable[[Any], bytes]] | None = None


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()


def _yaml(value: Any) -> bytes:
    # Without aliases: values that appear twice are written twice. The dumper in C is three times as quick.
    dumper = type("Dumper", (getattr(yaml, "CSafeDumper", yaml.SafeDumper),), {"ignore_aliases": lambda *_: True})
    return yaml.dump(value, Dumper=dumper, sort_keys=False).encode()


def _features(*geometries: dict[str, Any], **properties: Any) -> bytes:
    features = [{"type": "Feature", "properties": properties | {"id": f"d{n}"}, "geometry": g}
                for n, g in enumerate(geometries)]  # fmt: skip
    return _json({"type": "FeatureCollection", "frame": "map", "units": "m", "features": features})


def _plan() -> bytes:
    """Two rooms side by side with a door between them."""
    room = [[0, 0], [5, 0], [5, 4], [0, 4]]
    outline = [[0, 0], [9, 0], [9, 4], [0, 4], [0, 0]]
    walls = [*pairwise(outline), ([5, 0], [5, 4])]
    value = {
        "format": "closedrooms-plan", "version": 1, "name": "two", "units": "m", "start": [1.0, 1.0, 0.0], "meta": {},
        "rooms": [
            {"id": "r0", "label": "hall", "polygon": room},
            {"id": "r1", "label": "office", "polygon": [[x + 5 if x == 0 else x + 4, y] for x, y in room]},
        ],
        "walls": [{"id": f"w{n}", "segment": list(w), "thickness": 0.2} for n, w in enumerate(walls)],
        "doors": [{"id": "d0", "segment": [[5, 1], [5, 2]], "rooms": ["r0", "r1"], "kind": "hinged", "hinge": 0,
                   "opens_into": "r1"}],
        "openings": [], "furniture": [{"id": "f0", "polygon": [[3, 3], [4, 3], [4, 3.5]]}],
    }  # fmt: skip
    return _json(value)


def npz(arrays: dict[str, Any]) -> bytes:
    """An archive as NumPy writes it."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def scans() -> dict[str, Any]:
    """The arrays of a short drive."""
    return {
        "stamps": np.arange(4.0), "ranges": np.full((4, 36), 2.0), "odometry": np.zeros((4, 3)),
        "truth": np.zeros((4, 3)), "angle_min": np.float64(-3.0), "angle_increment": np.float64(0.1),
        "range_max": np.float64(20.0),
    }  # fmt: skip


def picture(size: int = 60) -> bytes:
    """A map: free in the middle, walls around it."""
    cells = np.full((size, size), 205, dtype=np.uint8)
    cells[5:-5, 5:-5] = 0
    cells[7:-7, 7:-7] = 254
    buffer = io.BytesIO()
    Image.fromarray(cells).save(buffer, format="PNG")
    return buffer.getvalue()


MAP = (
    b"image: map.png\nmode: trinary\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
    b"occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
FLASER = b"".join(
    f"FLASER 8 {' '.join(['2.0'] * 8)} {n * 0.1} 0 0 {n * 0.1} 0 0 {n}.0 host {n}.0\n".encode() for n in range(6)
)
JSON, YAML = (json.loads, _json), (yaml.safe_load, _yaml)


def _fixture(name: str) -> bytes:
    return (FIXTURES / name).read_bytes()


FORMATS = {
    "map": Format("map.yaml", MAP, read_ros_map, YAML),
    "doors": Format(
        "doors.geojson",
        _features(
            {"type": "Point", "coordinates": [1.5, 0.4]},
            {"type": "LineString", "coordinates": [[1, 2], [2, 2]]},
            {"type": "MultiLineString", "coordinates": [[[1, 2], [2, 2]]]},
            state="closed", width=0.9,
        ),
        read_doors, JSON,
    ),
    "rooms": Format(
        "rooms.geojson",
        _features({"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}, doors=["d0"], kind="border"),
        read_rooms, JSON,
    ),
    "plan": Format("plan.json", _plan(), lambda path: load_world(str(path)), JSON),
    "houseexpo": Format("home.json", _fixture("houseexpo_small.json"), lambda path: load_world(str(path)), JSON),
    "rmf": Format("b.yaml", _fixture("rmf_small.building.yaml"), lambda path: load_world(str(path), level="L1"), YAML),
    "pyrobosim": Format("w.yaml", _fixture("pyrobosim_small.yaml"), lambda path: load_world(str(path)), YAML),
    "kth": Format("k.xml", _fixture("kth_small.xml"), lambda path: load_world(str(path))),
    "luperto": Format("l.xml", _fixture("luperto_small.xml"), lambda path: load_world(str(path))),
    "picture": Format("map.png", picture(), lambda path: load_world(str(path))),
    "scans": Format("scans.npz", npz(scans()), read_run),
    "carmen": Format("c.log", FLASER, read_run),
    "carmen-gz": Format("c.log.gz", gzip.compress(FLASER), read_run),
    "trajectory": Format("t.tum", b"0 1 2 0 0 0 0 1\n1 1 2 0 0 0 0 1\n", read_trajectory),
}  # fmt: skip

# Put in the place of every value of a tree, one at a time.
VALUES: tuple[Any, ...] = (
    None, True, "", "x", "\x1b[2J\x1b[31m", "../../x", "$\\frac{", "[red]", "x" * 5000, [], {}, [[]], [{}], {"a": 1},
    -1, 0, 1e308, -1e308, 5e-324, 10**60, "nan", ".inf", "1e999", [[[[[[[[[[1]]]]]]]]]],
)  # fmt: skip


def spoilt_values(value: Any, *, every: int = 1) -> Iterator[tuple[str, Any]]:
    """Copies of a tree with one place spoilt, each with the name of the place.

    Args:
        value: The tree.
        every: Each place meets every so manyth value, the next place those after them.
    """
    for row, path in enumerate(_places(value)):
        for number, other in enumerate(VALUES):
            if (row + number) % every == 0:
                yield f"{'.'.join(map(str, path)) or 'all'} <- {number}", _replaced(value, path, other)


def _places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    # Of a list, the first two and the last stand for the rest.
    kept = list(children)
    for key, child in kept if isinstance(value, dict) else [*kept[:2], *kept[2:][-1:]]:
        yield from _places(child, (*path, key))


def _replaced(value: Any, path: tuple[Any, ...], other: Any) -> Any:
    if not path:
        return other
    key, *rest = path
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[key] = _replaced(value[key], tuple(rest), other)
    return copy


def _zip_bomb() -> bytes:
    buffer = io.BytesIO()
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3000000,), }\n"
    member = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + bytes(24_000_000)
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("stamps", "ranges", "odometry"):
            archive.writestr(f"{name}.npy", member)
    return buffer.getvalue()


def _aliases() -> bytes:
    """Ten lists of eight aliases of the one before: 8 to the power of ten values."""
    lines = [f"a0: &a0 [{', '.join('x' * 8)}]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 8)}]" for n in range(1, 10)]
    return "\n".join(lines).encode() + b"\n"


# What can be wrong with any file, whatever its format: other content,
CONTENTS: dict[str, bytes] = {
    "empty": b"",
    "noise": np.random.default_rng(0).bytes(2000),
    "zeros": bytes(3000),
    "brackets": b"[" * 300_000,
    "braces": b'{"a":' * 100_000,
    "dashes": b"rooms:\n" + b"- " * 100_000,
    "levels": b"levels: " + b"{a: " * 100_000,
    "tags": b"<a>" * 50_000,
    "entities": b'<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><Building>&b;</Building>',
    "zip-bomb": _zip_bomb(),
    "gzip-bomb": gzip.compress(b"FLASER 1 2 0 0 0 0 0 0 0 h 0\n" * 1_000_000),
}
# changed content,
CHANGES: dict[str, Callable[[bytes], bytes]] = {
    "half": lambda content: content[: len(content) // 2],
    "but-two": lambda content: content[:-2],
    "utf-16": lambda content: content.decode("latin-1").encode("utf-16"),
    "marked": lambda content: b"\xef\xbb\xbf" + content,
    "nul": lambda content: content.replace(b"0", b"\0"),
    "doubled": lambda content: content + content,
    "huge-numbers": lambda content: content.replace(b"0", b"9" * 400),
    "long-numbers": lambda content: content.replace(b"1", b"1" * 5000),
    "minus": lambda content: content.replace(b"0", b"-"),
    "exponents": lambda content: content.replace(b"0", b"1e308"),
    "nan": lambda content: content.replace(b"0", b"nan"),
    "merge": lambda content: b"a: &a {image: x}\n<<: *a\n" + content,
    "aliases": lambda content: _aliases() + content,
}
# no regular file.
PLACES: dict[str, Callable[[Path], None]] = {
    "missing": lambda path: path.unlink(missing_ok=True),
    "fifo": os.mkfifo,
    "folder": Path.mkdir,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "dangling": lambda path: path.symlink_to(path.parent / "gone"),
    "circle": lambda path: path.symlink_to(path),
}
MUTATIONS = (*CONTENTS, *CHANGES, *PLACES)


def spoil(path: Path, content: bytes, mutation: str) -> None:
    """Put a spoilt file of a format there.

    Args:
        path: Where; there is nothing yet.
        content: An honest file of the format.
        mutation: One of :data:`MUTATIONS`.
    """
    if mutation in PLACES:
        PLACES[mutation](path)
    else:
        path.write_bytes(CONTENTS[mutation] if mutation in CONTENTS else CHANGES[mutation](content))
