"""Predicts a sample with one method and measures how long that takes; what methods share is computed once."""

import time
from dataclasses import fields

from closedrooms.experiments.evaluation.samples.sample_reader import Sample
from closedrooms.predictor.config import FacesConfig
from closedrooms.predictor.methods import find_method
from closedrooms.predictor.paper.initial_layouts import FacesFound
from closedrooms.predictor.prediction import Prediction


class Starts:
    """The first steps of a prediction on one sample (lines and faces), done once for all methods that share them."""

    def __init__(self, sample: Sample) -> None:
        self._sample = sample
        self._found: dict[FacesConfig, tuple[FacesFound, float]] = {}

    def of(self, config: FacesConfig) -> tuple[FacesFound, float]:
        """Find lines, faces and initial faces, once for each settings of theirs.

        Args:
            config: Of a method; only the settings of lines and faces count.

        Returns:
            What was found, and how many seconds it took when it was found.
        """
        from closedrooms.predictor.paper.initial_layouts import find_initial_faces

        faces = FacesConfig(**{item.name: getattr(config, item.name) for item in fields(FacesConfig)})
        if faces not in self._found:
            begin = time.perf_counter()
            started = find_initial_faces(self._sample.observed, self._sample.doors, faces)
            self._found[faces] = started, time.perf_counter() - begin
        return self._found[faces]


def predict_with(name: str, sample: Sample, starts: Starts | None = None) -> tuple[Prediction, float]:
    """Predict one sample with one method, and measure how long it takes.

    Args:
        name: Of the method.
        sample: The sample.
        starts: What methods share on this sample; the time that it took counts for each of them.

    Returns:
        The prediction, and the seconds that it took.
    """
    method = find_method(name)
    config = method.config()
    shared, seconds = {}, 0.0
    if method.shares_faces:
        started, seconds = (starts or Starts(sample)).of(config)
        shared = {"started": started}
    begin = time.perf_counter()
    prediction = method.run(sample.observed, sample.doors, config, **shared)
    return prediction, seconds + time.perf_counter() - begin
