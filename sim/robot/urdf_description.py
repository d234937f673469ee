"""The text of a user's URDF: refused where PyBullet would crash on it, guess about it or fetch from anywhere."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import is_file, read_bytes
from closedrooms.worlds.formats.xml_text import parse_xml

WHAT = "a robot description (URDF)"
# Descriptions have some kilobytes; meshes are files of their own [bytes].
LARGEST, LARGEST_MESH = 2_000_000, 50_000_000
# Links of one body are truncated silently at 127; a description is loaded in a second, or not in a minute [s].
MOST_LINKS, LOADING = 120, 60.0


def check_description(path: Path) -> None:
    """Refuse what PyBullet would crash on, guess about or fetch from anywhere: it reads URDFs with no care at all.

    Raises:
        InvalidInputError: Not XML or no robot, too large, a mass below 0 or that is no number, or a mesh that is
            missing or outside the file's folder.
    """
    read_bytes(path, what=WHAT, max_bytes=LARGEST)
    root = parse_xml(path, what=WHAT)
    if root.tag != "robot" or not root.findall("link"):
        raise InvalidInputError(f"<{root.tag}> without links", expected=f"{WHAT}: <robot> with <link>", where=path)
    for item in root.iter("mass"):
        text = item.get("value", "")
        try:
            fine = math.isfinite(float(text)) and float(text) >= 0.0
        except ValueError:
            fine = False
        if not fine:
            raise InvalidInputError(f"a mass of {text!r}", expected="a finite number, at least 0", where=path)
    _check_tree(root, path)
    folder = path.resolve().parent
    for item in root.iter("mesh"):
        name = item.get("filename", "")
        mesh = (folder / name).resolve()
        if "://" in name or not mesh.is_relative_to(folder):
            raise InvalidInputError(f"a mesh {name!r}", expected="a file in the folder of that description", where=path)
        if not is_file(mesh):
            raise InvalidInputError(f"a mesh {name!r} that is not there", expected="a file", where=path)
        read_bytes(mesh, what="a mesh", max_bytes=LARGEST_MESH)


def _check_tree(root: Any, path: Path) -> None:
    """Check that links and joints make one tree: PyBullet crashes on anything else."""
    links = [link.get("name") for link in root.findall("link")]
    pairs = []
    for joint in root.findall("joint"):
        ends = [item.get("link") if (item := joint.find(end)) is not None else None for end in ("parent", "child")]
        pairs.append(tuple(ends))
    parents = {child: parent for parent, child in pairs}
    whole = len(links) == len(set(links)) <= MOST_LINKS and None not in links and len(parents) == len(pairs)
    whole &= {name for pair in pairs for name in pair} <= set(links) and len(pairs) == len(links) - 1
    if whole:
        # As many joints as a tree has, each link below one other at most: what is no tree has a circle.
        for link in links:
            seen = {link}
            while (link := parents.get(link)) is not None and whole:
                whole = link not in seen
                seen.add(link)
    if not whole:
        raise InvalidInputError(
            f"{len(links)} links and {len(pairs)} joints that make no tree",
            expected=f"{WHAT}: at most {MOST_LINKS} links of different names below one", where=path,
        )  # fmt: skip


def check_loads(path: Path) -> None:
    """Load the description in a process of its own: what is broken in a mesh may end the process.

    Raises:
        InvalidInputError: It does not load, or not in a minute.
    """
    code = "import sys, pybullet as p; p.connect(p.DIRECT); p.loadURDF(sys.argv[1]); p.stepSimulation()"
    # -P: no module is imported from the folder of the description.
    words = [sys.executable, "-P", "-c", code, str(path.absolute())]
    try:
        subprocess.run(words, capture_output=True, timeout=LOADING, check=True, cwd=path.parent)
    except subprocess.SubprocessError as error:
        raise InvalidInputError("a description that PyBullet does not load", expected=WHAT, where=path) from error
