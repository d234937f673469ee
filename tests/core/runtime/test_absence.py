"""A package that another one only asks for is not loaded, and stays to be had."""

import importlib
import sys

import pytest

from closedrooms.core.runtime.absence import hidden


def test_a_hidden_package_is_missing_and_comes_back() -> None:
    before = list(sys.meta_path)
    sys.modules.pop("this", None)
    with hidden("this"), pytest.raises(ModuleNotFoundError):
        importlib.import_module("this")
    assert importlib.util.find_spec("this") is not None
    assert sys.meta_path == before


def test_other_packages_and_those_that_are_loaded_are_to_be_had() -> None:
    with hidden("json"):
        assert importlib.import_module("json") is sys.modules["json"]
        assert importlib.util.find_spec("antigravity") is not None
