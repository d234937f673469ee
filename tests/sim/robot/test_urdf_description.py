"""What of a description is looked at before PyBullet sees it."""

from itertools import pairwise
from pathlib import Path

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from closedrooms.core.errors import InvalidInputError
from closedrooms.sim.robot.urdf_description import check_description


def described(path: Path, links: list[str], joints: list[tuple[str, str]], extra: str = "") -> Path:
    lines = [f'<link name="{name}"/>' for name in links]
    lines += [f'<joint name="j{n}" type="fixed"><parent link="{a}"/><child link="{b}"/></joint>'
              for n, (a, b) in enumerate(joints)]  # fmt: skip
    path.write_text(f'<robot name="r">{"".join(lines)}{extra}</robot>')
    return path


NAMES = ["a", "b", "c", "d", "e"]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.sampled_from(NAMES), min_size=1, max_size=5),
    st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=5),
)
def test_links_and_joints_make_one_tree(tmp_path: Path, links: list[str], joints: list[tuple[str, str]]) -> None:
    path = described(tmp_path / "robot.urdf", links, joints)
    graph = nx.MultiDiGraph()
    graph.add_nodes_from(links)
    graph.add_edges_from(joints)
    is_tree = len(set(links)) == len(links) and set(graph) == set(links) and nx.is_arborescence(graph)
    if is_tree:
        check_description(path)
    else:
        with pytest.raises(InvalidInputError, match="make no tree"):
            check_description(path)


@pytest.mark.parametrize(("count", "fine"), [(120, True), (121, False)])
def test_a_chain_may_have_as_many_links_as_pybullet_reads(tmp_path: Path, count: int, fine: bool) -> None:
    links = [f"l{n}" for n in range(count)]
    path = described(tmp_path / "robot.urdf", links, list(pairwise(links)))
    if fine:
        check_description(path)
    else:
        with pytest.raises(InvalidInputError, match="121 links and 120 joints"):
            check_description(path)


@pytest.mark.parametrize(
    "joint",
    [
        "<joint name='j'/>",
        "<joint name='j'><parent link='a'/></joint>",
        "<joint name='j'><child link='b'/></joint>",
        "<joint name='j'><parent/><child link='b'/></joint>",
    ],
)
def test_a_joint_without_an_end_makes_no_tree(tmp_path: Path, joint: str) -> None:
    with pytest.raises(InvalidInputError, match="make no tree"):
        check_description(described(tmp_path / "robot.urdf", ["a", "b"], [], joint))
    unnamed = described(tmp_path / "robot.urdf", ["a"], [], "<link/>")
    with pytest.raises(InvalidInputError, match="make no tree"):
        check_description(unnamed)


@pytest.mark.parametrize(
    ("mass", "fine"),
    [
        ("0", True),
        ("0.0", True),
        ("3.5", True),
        ("1e3", True),
        ("-1e-9", False),
        ("inf", False),
        ("nan", False),
        ("", False),
    ],
)
def test_a_mass_is_a_number_from_zero_on(tmp_path: Path, mass: str, fine: bool) -> None:
    path = described(tmp_path / "robot.urdf", ["a"], [], f"<mass value='{mass}'/>")
    if fine:
        check_description(path)
    else:
        with pytest.raises(InvalidInputError, match=f"a mass of '{mass}'"):
            check_description(path)
    with pytest.raises(InvalidInputError, match="a mass of ''"):
        check_description(described(tmp_path / "robot.urdf", ["a"], [], "<mass/>"))


def test_meshes_are_files_in_the_folder_of_the_description_or_below(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "base.stl").write_text("solid")
    (tmp_path / "outside.stl").write_text("solid")
    (folder / "link.stl").symlink_to(tmp_path / "outside.stl")

    def check(name: str) -> None:
        check_description(described(folder / "robot.urdf", ["a"], [], f"<mesh filename='{name}'/>"))

    for name in ("meshes/base.stl", "meshes/../meshes/base.stl", str(folder / "meshes" / "base.stl")):
        check(name)
    for name, why in (
        ("../outside.stl", "in the folder"), ("link.stl", "in the folder"), ("file://meshes/base.stl", "in the folder"),
        ("meshes/none.stl", "not there"), ("meshes", "not there"), ("", "not there"),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match=why):
            check(name)


def test_only_a_robot_with_links_is_one(tmp_path: Path) -> None:
    for text in ("<robot/>", "<model><link name='a'/></model>", "<robot><group><link name='a'/></group></robot>"):
        (tmp_path / "robot.urdf").write_text(text)
        with pytest.raises(InvalidInputError, match="without links"):
            check_description(tmp_path / "robot.urdf")


def test_descriptions_and_meshes_are_read_up_to_a_size(tmp_path: Path) -> None:
    path = described(tmp_path / "robot.urdf", ["a"], [], "<mesh filename='m.stl'/>")
    (tmp_path / "m.stl").write_bytes(b"")
    size = path.stat().st_size
    text = path.read_text()
    for spare, fine in ((0, True), (1, False)):
        path.write_text(text.replace("<robot", f"{' ' * (2_000_000 - size + spare)}<robot"))
        if fine:
            check_description(path)
        else:
            with pytest.raises(InvalidInputError, match="a file of"):
                check_description(path)
    path.write_text(text)
    for size, fine in ((50_000_000, True), (50_000_001, False)):
        with (tmp_path / "m.stl").open("wb") as file:
            file.truncate(size)
        if fine:
            check_description(path)
        else:
            with pytest.raises(InvalidInputError, match="a file of"):
                check_description(path)
