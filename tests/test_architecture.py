"""Who may import whom: ground truth cannot leak into an estimate."""

import ast
import dataclasses
import graphlib
from pathlib import Path

import pytest

from closedrooms.core.observation import Observation

ROOT = Path(__file__).parents[1]
GROUND = ("core", "worlds", "sim", "mapping", "predictor", "coverage", "navigation", "visualization", "pipeline")
MAY_IMPORT = {
    "core": {"core"},
    "worlds": {"core", "worlds"},
    "sim": {"core", "worlds", "sim"},
    "mapping": {"core", "mapping"},
    "predictor": {"core", "predictor"},
    "coverage": {"core", "coverage", "predictor"},
    "navigation": {"core", "mapping", "predictor", "coverage", "navigation"},
    "visualization": {*GROUND} - {"pipeline"},
    "pipeline": {*GROUND},
    "experiments": {*GROUND, "experiments"},
    "web": {*GROUND, "experiments", "web"},
    "cli": {*GROUND, "experiments", "web", "cli"},
}
# What decides; the true pose is told to the pipeline alone.
DECIDING = ("mapping", "predictor", "coverage", "navigation")


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_a_folder_imports_only_what_the_design_allows(folder: str) -> None:
    paths = list((ROOT / folder).rglob("*.py"))
    assert paths
    for path in paths:
        ours = {name.split(".")[1] for name in imported(path) if name.startswith("closedrooms.")}
        assert ours <= MAY_IMPORT[folder], f"{path.relative_to(ROOT)} imports {sorted(ours - MAY_IMPORT[folder])}"


def loads_rerun(path: Path) -> bool:
    """Whether a file imports the rerun SDK, by statement or by name."""
    if any(name.split(".")[0] == "rerun" for name in imported(path)):
        return True
    calls = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call) and node.args]
    return any(
        isinstance(call.args[0], ast.Constant)
        and str(call.args[0].value).split(".")[0] == "rerun"
        and ast.unparse(call.func) in {"__import__", "import_module", "importlib.import_module"}
        for call in calls
    )


def test_only_the_recording_imports_rerun() -> None:
    users = {path for folder in MAY_IMPORT for path in (ROOT / folder).rglob("*.py") if loads_rerun(path)}
    assert users
    assert {path.parent.relative_to(ROOT).as_posix() for path in users} == {"visualization/rerun"}


def test_only_training_imports_torch() -> None:
    heavy = {"torch", "onnx", "onnxscript"}
    users = {
        path.parent.relative_to(ROOT).as_posix()
        for folder in MAY_IMPORT
        for path in (ROOT / folder).rglob("*.py")
        if {name.split(".")[0] for name in imported(path)} & heavy
    }
    assert users == {"experiments/training"}


def modules() -> dict[str, Path]:
    """Every module of the house by its full name."""
    named = {}
    for folder in MAY_IMPORT:
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            named[".".join(("closedrooms", *(parts[:-1] if parts[-1] == "__init__" else parts)))] = path
    return named


def first_circle(imports: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle, the first once more at the end; empty where there is none."""
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as error:
        return list(error.args[1])
    return []


def test_a_circle_is_found() -> None:
    assert first_circle({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert set(first_circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})) == {"a", "b", "c"}


def test_no_modules_import_each_other_in_a_circle() -> None:
    # Imports inside functions and those for types alone count: a circle that is put off is one all the same.
    named = modules()
    imports = {}
    for module, path in named.items():
        wanted = {name if name in named else name.rpartition(".")[0] for name in imported(path)}
        imports[module] = (wanted & named.keys()) - {module}
    assert first_circle(imports) == []


def test_an_observation_carries_no_truth() -> None:
    assert {field.name for field in dataclasses.fields(Observation)} == {"scan", "odometry", "sightings", "bumps"}


@pytest.mark.parametrize("folder", DECIDING)
def test_what_decides_knows_no_true_pose(folder: str) -> None:
    for path in (ROOT / folder).rglob("*.py"):
        names = {node.attr for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Attribute)}
        told = {name for name in names if "true" in name.split("_") or name == "world_T_robot"}
        assert not told, f"{path.relative_to(ROOT)} reads {sorted(told)}"


def test_every_folder_of_code_is_in_the_wheel() -> None:
    import tomllib

    packages = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    for folder in MAY_IMPORT:
        for path in (ROOT / folder).rglob("*.py"):
            assert "closedrooms." + ".".join(path.relative_to(ROOT).parent.parts) in packages, path


# What opens a file by itself. `core` has the one door for incoming files and the one writer.
OPENERS = {
    "open", "io.open", "os.open", "np.load", "np.loadtxt", "np.genfromtxt", "np.fromfile", "numpy.load", "Image.open",
    "cv2.imread", "yaml.load", "yaml.safe_load", "json.load", "tomllib.load", "pickle.load", "gzip.open",
    "zipfile.ZipFile", "tarfile.open", "ElementTree.parse", "ET.parse", "pq.read_table", "csv.reader",
}  # fmt: skip
OPENING_METHODS = {"read_text", "read_bytes", "open"}
# Not incoming files: the null device, the lock of a dataset.
ALLOWED = {
    "cli/commands.py": {"os.open"},
    "sim/pybullet_process.py": {"os.open"},
    "experiments/dataset/layout.py": {"(folder / LOCK).open"},
    "experiments/stores.py": {"self._files.open", "temporary.open"},  # of fsspec; what is written
}


def openings(source: str) -> set[str]:
    """Calls that open or parse a file, as they stand in a source text."""
    calls = (node.func for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))
    found = set()
    for call in calls:
        name = ast.unparse(call)
        if name in OPENERS or (isinstance(call, ast.Attribute) and call.attr in OPENING_METHODS):
            found.add(name)
    return found


def test_the_search_for_openings_finds_them() -> None:
    assert openings("p.read_text(); Path('a').open(); json.load(f); read_json(p); f.read(); (a / b).read_bytes()") == {
        "p.read_text", "Path('a').open", "json.load", "(a / b).read_bytes",
    }  # fmt: skip


def test_nothing_outside_core_opens_a_file_by_itself() -> None:
    strange = {}
    for folder in set(MAY_IMPORT) - {"core"}:
        for path in (ROOT / folder).rglob("*.py"):
            name = path.relative_to(ROOT).as_posix()
            found = openings(path.read_text()) - ALLOWED.get(name, set())
            if found:
                strange[name] = sorted(found)
    assert not strange, f"core.files.incoming opens files: {strange}"


def read_outside_validation(tree: ast.AST) -> set[str]:
    """Names of the attributes that are read anywhere but in ``__post_init__``, where a configuration checks itself."""
    names = set()
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef) and node.name == "__post_init__":
            continue
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            names.add(node.attr)
        names |= read_outside_validation(node)
    return names


def configuration_fields(tree: ast.AST) -> set[tuple[str, str]]:
    """Class and name of every field of a class whose name ends in ``Config`` or ``Options``."""
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    return {
        (node.name, field.target.id)
        for node in classes
        if node.name.endswith(("Config", "Options"))
        for field in node.body
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and not ast.unparse(field.annotation).startswith("ClassVar")
    }


def test_a_field_that_only_its_own_check_reads_is_told_apart() -> None:
    tree = ast.parse(
        "class AConfig:\n a: int\n b: int\n def __post_init__(self):\n  check(self.a, self.b)\n"
        "def use(config): return config.b"
    )
    assert configuration_fields(tree) == {("AConfig", "a"), ("AConfig", "b")}
    assert read_outside_validation(tree) == {"b"}


# Read by tyro itself, through the word on the line.
READ_BY_NAME = {("SharedOptions", "help_all")}


def test_every_field_of_every_configuration_is_read() -> None:
    trees = [ast.parse(path.read_text()) for path in modules().values()]
    fields = set().union(*(configuration_fields(tree) for tree in trees))
    read = set().union(*(read_outside_validation(tree) for tree in trees))
    assert len(fields) > 100
    assert {field for field in fields if field[1] not in read} <= READ_BY_NAME
