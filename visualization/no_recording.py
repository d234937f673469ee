"""Stands in for the recorder where nothing is recorded; imports no rerun."""

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


class NoRecording:
    """Recorder that takes every call and does nothing; it never wants a map."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_args, **_kwargs: None


def no_recording() -> "Recorder":
    """Make a stand-in typed as a recorder, so that calls of it are checked as the real one's are."""
    return cast("Recorder", NoRecording())
