"""From a map and its closed doors to the rooms behind them (paper, sections 3 and 4).

``methods`` is the registry: every method by name, also those of other packages (CONTRIBUTING.md says how to add one);
``config`` holds their settings. ``paper/`` (also rose), ``best/``, ``learned/`` and ``baselines`` are the methods,
``structure/`` is what a grid shows to all of them. ``prediction`` is the result; ``disjoint_rooms`` and ``inpainting``
finish it, ``confidence/`` says how sure it is, ``revision`` goes on with it as knowledge arrives.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.predictor.config import BestConfig as BestConfig
    from closedrooms.predictor.config import FacesConfig as FacesConfig
    from closedrooms.predictor.config import LearnedConfig as LearnedConfig
    from closedrooms.predictor.config import MethodConfig as MethodConfig
    from closedrooms.predictor.config import PaperConfig as PaperConfig
    from closedrooms.predictor.config import RoseConfig as RoseConfig
    from closedrooms.predictor.methods import METHODS as METHODS
    from closedrooms.predictor.methods import Method as Method
    from closedrooms.predictor.methods import find_method as find_method
    from closedrooms.predictor.methods import predict as predict
    from closedrooms.predictor.prediction import Prediction as Prediction

__getattr__, __dir__, __all__ = lazy_face(
    __name__,
    {
        "methods": ("METHODS", "Method", "find_method", "predict"),
        "config": ("BestConfig", "FacesConfig", "LearnedConfig", "MethodConfig", "PaperConfig", "RoseConfig"),
        "prediction": ("Prediction",),
    },
)
