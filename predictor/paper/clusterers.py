"""Where the paper's clusterers come from: scikit-learn."""

from functools import cache
from types import ModuleType

from closedrooms.core.runtime.late_modules import importing_less

# What sklearn.cluster imports along, more than half of its time, and neither DBSCAN nor mean shift calls.
LATE = ("scipy.stats", "numpy.f2py", "numpy.testing")
ABSENT = ("pandas", "rich")


@cache
def sklearn_cluster() -> ModuleType:
    """Import ``sklearn.cluster``; only now, for it takes longer than most predictions."""
    import numpy as np  # noqa: F401 (the parents of what comes late)
    import scipy  # noqa: F401

    with importing_less(LATE, ABSENT):
        import sklearn.cluster

    return sklearn.cluster  # type: ignore[no-any-return]
