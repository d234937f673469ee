"""Scores that an earlier evaluation kept, and whether inputs, options and code are still those they were made with."""

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from closedrooms.core.errors import InvalidInputError
from closedrooms.core.files.incoming import read_json
from closedrooms.experiments.dataset.checksums import files_digest
from closedrooms.experiments.evaluation.scoring.scores import Scores
from closedrooms.experiments.evaluation.scoring.tours import tour_code
from closedrooms.pipeline.reporting.manifest import versions
from closedrooms.predictor.methods import find_method

AUTHORS = "authors"
"""Stands in the place of a method for the completed map that the authors of a sample published with it."""
INPUTS = {".yaml", ".png", ".pgm", ".geojson", ".json"}
# The files beside this one that decide what a sample scores.
SCORING = (
    "sample_evaluation.py", "timed_prediction.py", "hidden_space.py", "scores.py", "watershed.py", "sureness.py",
    "cost.py",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Extras:
    """Optional work on a sample, beside predicting and scoring.

    Attributes:
        tours: Whether to plan coverage tours, where the sample tells how many rooms there are (``|R|``).
        probability: Whether to write the probability of every cell.
        completions: Number of completions from which the cost of coverage is estimated; 0 for no estimate.
    """

    tours: bool
    probability: bool
    completions: int


def plans_tours(method: str) -> bool:
    """Check whether a tour can be planned on what a method predicts: its rooms do not overlap."""
    return method != AUTHORS and find_method(method).disjoint


def content_digest(folder: Path) -> str:
    """Digest the files of a sample's folder that an evaluation reads."""
    return files_digest([path for path in folder.glob("*") if path.suffix in INPUTS and path.is_file()])


def fingerprint(content: str, method: str, extras: Extras) -> str:
    """Digest all that the scores of one method on one sample depend on.

    Args:
        content: Of the sample, see :func:`content_digest`.
        method: Its name.
        extras: What is done beside predicting and scoring.

    Returns:
        Hexadecimal SHA-256 of these, the versions of libraries and the code that predicts, plans and scores.
    """
    planned = (extras.tours or extras.completions) and plans_tours(method)
    parts = [content, method, json.dumps(versions()), _code(), tour_code() if planned else ""]
    parts += ["probability"] if extras.probability and method != AUTHORS else []
    parts += [f"completions {extras.completions} {extras.tours}"] if extras.completions and planned else []
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()


@lru_cache(maxsize=1)
def _code() -> str:
    """Compute the digest of the code that predicts and scores."""
    root, here = Path(__file__).parents[3], Path(__file__).parent
    files = [
        *(root / "predictor").rglob("*.py"),
        *(root / "predictor").rglob("*.json"),
        *(root / "predictor").rglob("*.onnx"),
        *(root / "core").rglob("*.py"),
        root / "pipeline" / "reporting" / "run_scores.py",
        here.parent / "samples" / "sample_reader.py",
        *(here / name for name in SCORING),
    ]
    return files_digest(files)


def read_kept(path: Path, key: str) -> Scores | None:
    """Read the scores in a file if they were kept under this :func:`fingerprint`, else ``None``."""
    try:
        scores: Scores = read_json(path, what="the scores of a sample")
    except InvalidInputError:
        return None
    return scores if isinstance(scores, dict) and scores.get("key") == key else None
