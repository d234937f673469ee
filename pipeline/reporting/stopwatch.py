"""How long each stage took."""

import contextlib
import time
from collections.abc import Iterator


class Stopwatch:
    """Wall-clock seconds by stage, in the order in which the stages began."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()
        self._seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time spent inside the block to stage ``name``."""
        begin = time.perf_counter()
        self._seconds.setdefault(name, 0.0)
        try:
            yield
        finally:
            self._seconds[name] += time.perf_counter() - begin

    def add(self, name: str, seconds: float) -> None:
        """Add time that was measured elsewhere."""
        self._seconds[name] = self._seconds.get(name, 0.0) + seconds

    def seconds(self) -> dict[str, float]:
        """List seconds by stage, rounded to milliseconds, and ``total`` since the stopwatch was made."""
        stages = {name: round(seconds, 3) for name, seconds in self._seconds.items()}
        return stages | {"total": round(time.perf_counter() - self._begin, 3)}
