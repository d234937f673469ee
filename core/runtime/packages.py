"""Packages that not every installation has: a missing one is named in one line with the command that brings it."""

from importlib.util import find_spec

from closedrooms.core.errors import ClosedroomsError

# What to install by the name that is imported; the slim installation (requirements-core.txt) has none of them.
BROUGHT_BY = {
    "pybullet": "'closedrooms[sim]'",
    "trimesh": "trimesh mapbox-earcut",
    "mapbox_earcut": "mapbox-earcut",
    "networkx": "networkx",
    "ortools": "ortools",
    "skimage": "scikit-image",
    "rerun": "rerun-sdk",
    "pyarrow": "pyarrow",
    "matplotlib": "matplotlib",
    "distributed": "'closedrooms[cluster]'",
    "gtsam": "'closedrooms[slam]'",
    "rosbags": "'closedrooms[bags]'",
    "nicegui": "'closedrooms[web]'",
    "fsspec": "'closedrooms[s3]'",
    "torch": "'closedrooms[train]'",
    "onnx": "'closedrooms[train]'",
    "onnxscript": "'closedrooms[train]'",
}


class MissingPackageError(ClosedroomsError):
    """A package that the work at hand needs is not installed."""


def require(*modules: str, by: str, instead: str = "") -> None:
    """Check that packages are there before any work begins; nothing is imported.

    Args:
        modules: Names as they are imported, of :data:`BROUGHT_BY`.
        by: Who needs them: the command, ``closedrooms cover``.
        instead: What would do without them, where anything would.

    Raises:
        MissingPackageError: One or more are not installed.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise MissingPackageError(_message(missing, by, instead))


def missing_package(error: ModuleNotFoundError, *, by: str) -> MissingPackageError | None:
    """Explain a failed import in one line, ``None`` where the module is none of :data:`BROUGHT_BY`.

    Args:
        error: Of the import.
        by: Who needs the package.
    """
    name = (error.name or "").split(".")[0]
    return MissingPackageError(_message([name], by, "")) if name in BROUGHT_BY else None


def _message(missing: list[str], by: str, instead: str) -> str:
    """Say which packages are missing, who needs them, and how to install them."""
    brought = dict.fromkeys(BROUGHT_BY[name] for name in missing)
    are = "is" if len(missing) == 1 else "are"
    text = f"{by} needs {', '.join(missing)}, which {are} not installed here: pip install {' '.join(brought)}"
    return f"{text} (or {instead})" if instead else text
