"""Folders say which version of the files they hold; nobody reads a newer one as if it were known."""

import json
from pathlib import Path

import pytest

from closedrooms.cli.config_file import read_settings
from closedrooms.core.errors import InvalidInputError, OutputError
from closedrooms.core.files.output_folders import output_folder
from closedrooms.core.files.schema import SCHEMA, check_schema
from closedrooms.experiments.claimed_folder import claim_folder
from closedrooms.experiments.dataset.layout import read_manifest
from closedrooms.experiments.evaluation.samples.sample_path import SamplePath
from closedrooms.experiments.evaluation.samples.sample_reader import read_sample
from closedrooms.pipeline.options.predict import PredictConfig
from closedrooms.pipeline.view import find_recording

NEWER = f"schema version {SCHEMA + 1}, written by a newer closedrooms; expected at most {SCHEMA}.*"


def write(path: Path, content: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


def test_every_folder_that_is_written_says_its_version(tmp_path: Path) -> None:
    with output_folder(tmp_path / "result", {"command": "predict"}) as staging:
        (staging / "note.txt").write_text("here")
    assert json.loads((tmp_path / "result" / "run.json").read_text())["schema"] == SCHEMA
    claim_folder(tmp_path / "evaluation", "evaluate")
    assert json.loads((tmp_path / "evaluation" / "run.json").read_text())["schema"] == SCHEMA


def test_what_names_no_version_is_older_and_read(tmp_path: Path) -> None:
    check_schema({}, tmp_path)
    check_schema({"schema": SCHEMA}, tmp_path)


@pytest.mark.parametrize("found", [0, -1, 1.0, "1", True, None, [1]])
def test_what_is_no_version_is_refused(tmp_path: Path, found: object) -> None:
    with pytest.raises(InvalidInputError, match="expected a whole number from 1"):
        check_schema({"schema": found}, tmp_path)


def test_settings_of_a_newer_result_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "run.json", {"command": "predict", "configuration": {}, "schema": SCHEMA + 1})
    with pytest.raises(InvalidInputError, match=NEWER + "run.json"):
        read_settings(path, "predict", PredictConfig)


def test_a_newer_dataset_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "manifest.json", {"program": "closedrooms", "format": 1, "schema": SCHEMA + 1, "samples": []})
    with pytest.raises(InvalidInputError, match=NEWER + "manifest.json"):
        read_manifest(tmp_path)


def test_a_newer_run_is_not_evaluated(tmp_path: Path) -> None:
    write(tmp_path / "run.json", {"schema": SCHEMA + 1})
    with pytest.raises(InvalidInputError, match=NEWER + "run.json"):
        read_sample(SamplePath("newer", tmp_path))


def test_a_newer_recording_is_not_shown(tmp_path: Path) -> None:
    write(tmp_path / "run.json", {"schema": SCHEMA + 1})
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    with pytest.raises(InvalidInputError, match=NEWER + "run.json"):
        find_recording(tmp_path)


def test_a_newer_evaluation_is_not_gone_on_with(tmp_path: Path) -> None:
    write(tmp_path / "run.json", {"command": "evaluate", "schema": SCHEMA + 1})
    with pytest.raises(InvalidInputError, match=NEWER + "run.json"):
        claim_folder(tmp_path, "evaluate")


def test_a_newer_folder_is_not_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "result"
    with output_folder(folder, {"command": "predict"}):
        pass
    manifest = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(manifest | {"schema": SCHEMA + 1}, indent=2) + "\n")
    with pytest.raises(OutputError, match=NEWER + "run.json"), output_folder(folder, {"command": "predict"}):
        pass
