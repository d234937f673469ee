import subprocess
import sys

import pytest

from closedrooms import core


def test_every_public_name_is_there_and_the_rest_is_not() -> None:
    assert {name for name in core.__all__ if getattr(core, name, None) is None} == set()
    assert set(core.__all__) <= set(dir(core))
    with pytest.raises(AttributeError, match="nothing_of_ours"):
        core.nothing_of_ours  # noqa: B018


def test_importing_the_face_loads_no_library() -> None:
    code = (
        "import sys, closedrooms.core as core; core.__version__; core.InvalidInputError;"
        "assert not {'numpy', 'shapely', 'yaml', 'PIL'} & set(sys.modules), sorted(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
