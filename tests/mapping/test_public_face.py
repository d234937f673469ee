import subprocess
import sys

import pytest

from closedrooms import mapping


@pytest.mark.parametrize("name", mapping.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(mapping, name).__module__.startswith("closedrooms.mapping.")


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="Mappper"):
        _ = mapping.Mappper


def test_importing_the_package_loads_nothing_heavy() -> None:
    script = "import sys, closedrooms.mapping; print([m for m in ('numpy', 'scipy', 'cv2') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
