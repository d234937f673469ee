"""Stands in for the recorder where nothing is recorded; imports no rerun."""

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from closedrooms.visualization.rerun.recorder import Recorder


class NoRecording:
    """Takes every call of a recorder and does nothing; it never wants a map."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_args, **_kwargs: None


def no_recording() -> "Recorder":
    """Return a recorder to those who call it, so that their calls are checked as the real one's are."""
    return cast("Recorder", NoRecording())
