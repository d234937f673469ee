"""Compiled modules of other packages, loaded by themselves: what their packages import beside them takes longer."""

import importlib.util
from pathlib import Path
from typing import Any


def load_compiled(module: str, *names: str) -> Any | None:
    """Load a compiled module from its file, without importing its package.

    Args:
        module: Its whole name, ``scipy.optimize._lsap``.
        names: What is wanted of it.

    Returns:
        The module; ``None`` where this version of the package keeps it elsewhere, or has not all of the names: the
        package itself is to be imported then.
    """
    package, *folders, name = module.split(".")
    found = importlib.util.find_spec(package)
    for place in (found.submodule_search_locations or ()) if found else ():
        for path in sorted(Path(place, *folders).glob(f"{name}.*")):
            try:
                spec = importlib.util.spec_from_file_location(name, path)
                if spec is None or spec.loader is None:
                    continue
                loaded = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(loaded)
            except ImportError:
                continue
            if all(hasattr(loaded, wanted) for wanted in names):
                return loaded
    return None
