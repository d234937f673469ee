"""Worlds by name or file: the bundled ones, and every format that the importers read."""

import codecs
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_there, read_head, reading
from closedrooms.core.nearest import nearest

if TYPE_CHECKING:
    from closedrooms.worlds.plan import FloorPlan

# An office of about 40 x 30 m.
DEFAULT_WORLD = "office-07"
PLANS = Path(__file__).parent / "plans"
# Enough of a file to tell its format.
HEAD_BYTES = 65_536
# The top-level key of an RMF building may come late.
YAML_BYTES = 20_000_000


@dataclass(frozen=True, slots=True)
class Importer:
    """A format that worlds are read from.

    Attributes:
        name: Short name.
        what: For messages.
        recognises: Whether a file is of this format, from its path and its first bytes as text.
        read: Reads and validates; the level is ``None`` but for formats with several floors a file.
        levels: Whether a file may hold several floors.
    """

    name: str
    what: str
    recognises: Callable[[Path, str], bool]
    read: Callable[[Path, str | None], "FloorPlan"]
    levels: bool = False


def bundled_names() -> list[str]:
    """List the names of the bundled worlds, sorted."""
    return sorted(path.stem for path in PLANS.glob("*.json"))


def load_world(name_or_path: str, *, level: str | None = None) -> "FloorPlan":
    """Load a bundled world by its name, or a file of any known format, told by its content.

    Doors to the outside are walled up (``meta["sealed"]``) and open outlines closed: a robot that maps a floor must
    not leave it. What was dropped, repaired or guessed on reading is in the plan's ``remarks``.

    Args:
        name_or_path: A name wins over a file of the same name; ``FILE:LEVEL`` names the floor too.
        level: Which floor, for files that hold several.

    Raises:
        InvalidInputError: Neither a name nor a file (the message lists the names), an unknown format, a plan that
            is not valid.
    """
    from closedrooms.worlds.ways_out import wall_up_entrances, wall_up_outline

    plan = wall_up_entrances(read_world(name_or_path, level=level))
    return plan if name_or_path in bundled_names() else wall_up_outline(plan)


def read_world(name_or_path: str, *, level: str | None = None) -> "FloorPlan":
    """Read a world as :func:`load_world`, entrances included."""
    from closedrooms.worlds.formats.native import read_plan

    if name_or_path in bundled_names():
        _refuse_level(level, name_or_path)
        return read_plan(PLANS / f"{name_or_path}.json")
    path, level = split_level(name_or_path, level)
    importer = importer_of(path)
    if not importer.levels:
        _refuse_level(level, path)
    with reading(path, importer.what):
        return importer.read(path, level)


def split_level(given: str, level: str | None = None) -> tuple[Path, str | None]:
    """Split ``FILE`` or ``FILE:LEVEL`` into the file and the floor that it names.

    Raises:
        InvalidInputError: There is no such file, or ``level`` is another one.
    """
    if _is_file_name(given):
        return Path(given), level
    for at in range(len(given) - 1, 0, -1):
        if given[at] == ":" and given[at + 1 :] and _is_file_name(given[:at]):
            if level not in (None, given[at + 1 :]):
                raise InvalidInputError(f"--level {level} of {given[at + 1 :]!r}", expected="one level", where=given)
            return Path(given[:at]), given[at + 1 :]
    names = ", ".join(bundled_names())
    shown = given if len(given) <= 80 else f"...{given[-77:]}"
    near = nearest(given, bundled_names())
    meant = f" (did you mean {near}?)" if near else ""
    raise InvalidInputError(f"unknown world {shown!r}{meant}", expected=f"a floor plan file or one of {names}")


def world_source(name_or_path: str) -> str:
    """Name a world as it is found from any folder: a bundled name as it is, a file by its whole path, then its level.

    Raises:
        InvalidInputError: Neither a name nor a file.
    """
    if name_or_path in bundled_names():
        return name_or_path
    path, level = split_level(name_or_path)
    return str(path.resolve()) if level is None else f"{path.resolve()}:{level}"


def _is_file_name(given: str) -> bool:
    return bool(given) and is_there(Path(given))


def distinct_names(plans: Sequence["FloorPlan"], sources: Sequence[str]) -> list[str]:
    """Name each plan: its own name where no other plan has it.

    Plans of one name are told apart by the folders of their files, as few of them as it takes, and by a number where
    that is not enough; the order of the plans does not matter for the former.

    Args:
        plans: In any order.
        sources: The file that each was read from, or its bundled name.
    """
    names = [plan.name for plan in plans]
    folders = [Path(source).resolve().parent.parts[::-1] for source in sources]
    result = [*names]
    for name in {name for name in names if names.count(name) > 1}:
        same = [number for number, other in enumerate(names) if other == name]
        for depth in range(1, max(len(folders[number]) for number in same) + 1):
            told = ["-".join([*folders[number][:depth][::-1], name]).lstrip("/-") for number in same]
            if len({*told}) == len(same):
                break
        else:
            told = [name if k == 0 else f"{name}-{k + 1}" for k in range(len(same))]
        for number, better in zip(same, told, strict=True):
            result[number] = better
    return result


def _refuse_level(level: str | None, where: str | Path) -> None:
    if level is not None:
        raise InvalidInputError(f"--level {level} of a world with one floor", expected="no level", where=where)


def importer_of(path: Path) -> Importer:
    """Find the importer that recognises the content of a file.

    Raises:
        InvalidInputError: It cannot be read, or no importer knows it.
    """
    formats = importers()
    content = read_head(path, what="a floor plan", size=HEAD_BYTES)
    encoding = "utf-16" if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    head = content.decode(encoding, errors="replace")
    for importer in formats:
        if importer.recognises(path, head):
            return importer
    known = ", ".join(importer.what for importer in formats)
    raise InvalidInputError("a file of no known format", expected=known, where=path)


def importers() -> list[Importer]:
    """List every importer, the more specific ones first."""
    from closedrooms.worlds.formats.houseexpo import read_houseexpo
    from closedrooms.worlds.formats.kth import read_kth
    from closedrooms.worlds.formats.luperto import read_luperto
    from closedrooms.worlds.formats.native import read_plan
    from closedrooms.worlds.formats.pyrobosim import read_pyrobosim
    from closedrooms.worlds.formats.raster.rosmap import read_raster
    from closedrooms.worlds.formats.rmf import read_rmf

    return [
        Importer("picture", "a picture of a map (PNG or PGM)", _is_picture, lambda path, _: read_raster(path)),
        Importer("kth", "KTH XML", _is_kth, lambda path, _: read_kth(path)),
        Importer("luperto", "Luperto XML", _is_luperto, read_luperto, levels=True),
        Importer("houseexpo", "HouseExpo JSON", _is_houseexpo, lambda path, _: read_houseexpo(path)),
        Importer("json", "closedrooms JSON", _is_json, lambda path, _: read_plan(path)),
        Importer("rmf", "RMF building.yaml", _has_keys("levels"), read_rmf, levels=True),
        Importer("pyrobosim", "pyrobosim YAML", _has_keys("rooms"), lambda path, _: read_pyrobosim(path)),
        Importer("rosmap", "a ROS map (YAML)", _has_keys("image"), lambda path, _: read_raster(path)),
    ]


def _is_picture(path: Path, head: str) -> bool:
    del path
    return head.startswith(("\ufffdPNG\r\n", "P2\n", "P5\n", "P2 ", "P5 "))


def _is_xml(path: Path, head: str) -> bool:
    return head.lstrip().startswith("<") or (not head.strip() and path.suffix == ".xml")


def _is_kth(path: Path, head: str) -> bool:
    # Its scale stands at the top; Luperto's has another one (represented_distance).
    lower = head.lower()
    return _is_xml(path, head) and ("pixeldistance" in lower or "<contour" in lower)


def _is_luperto(path: Path, head: str) -> bool:
    return _is_xml(path, head)


def _is_houseexpo(path: Path, head: str) -> bool:
    del path
    return head.lstrip().startswith(("{", "[")) and any(key in head for key in ('"verts"', '"room_category"'))


def _is_json(path: Path, head: str) -> bool:
    return head.lstrip().startswith(("{", "[")) or (not head.strip() and path.suffix == ".json")


def _has_keys(*keys: str) -> Callable[[Path, str], bool]:
    """Check whether a text has these top-level YAML keys; large YAML files are looked through to their end."""
    patterns = [re.compile(rf"^[\"']?{re.escape(key)}[\"']?\s*:", re.MULTILINE) for key in keys]

    def recognises(path: Path, head: str) -> bool:
        text = head
        if len(head) >= HEAD_BYTES // 2 and path.suffix.lower() in {".yaml", ".yml"}:
            text = read_head(path, what="a floor plan", size=YAML_BYTES).decode("utf-8-sig", errors="replace")
        return all(pattern.search(text) for pattern in patterns)

    return recognises
