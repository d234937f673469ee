import subprocess
import sys

import pytest

import closedrooms.coverage as face


def test_every_name_of_the_public_face_is_there_and_no_other():
    assert set(face._HOME) == set(face.__all__) <= set(dir(face))
    for name in face.__all__:
        assert getattr(face, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'plan'"):
        face.plan  # noqa: B018


def test_the_public_face_loads_no_library():
    code = "import sys, closedrooms.coverage; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "networkx", "cv2", "scipy", "skimage", "ortools"} & set(loaded)
