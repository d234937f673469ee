"""One rerun file, its two timelines and its log."""

import contextlib
import logging
import threading
from collections.abc import Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from closedrooms.core.arrays import FloatArray
from closedrooms.core.errors import OutputError
from closedrooms.core.files.unfinished import final_place
from closedrooms.core.runtime.absence import hidden
from closedrooms.core.runtime.stopping import wait_for_nothing
from closedrooms.visualization.rerun.documents import text_document
from closedrooms.visualization.rerun.live import LiveViewer

APPLICATION = "closedrooms"
# Chunks are cut by size alone: a cut by wall-clock time would differ from one run to the next.
CHUNK_BYTES = 1_000_000
NEVER_SECONDS = 1e6
# How long those who watch wait for what has happened [s].
LIVE_SECONDS = 0.2
# On a full disk the writer has been seen to wait for ever; an honest flush takes milliseconds, and the file grows. So
# long without growth is enough [s].
FLUSH_SECONDS = 5.0
CLOSE_SECONDS = 1.0


class Stage(IntEnum):
    """Steps of the timeline ``stage``; level k of the layouts is ``EXPANSION + k``, but before ``ROOMS``.

    A method that weighs whole rooms shows its wall faces at ``SEGMENTS`` and its candidates at ``INITIAL``.
    """

    BUILDING = 0
    MAPPING = 1
    SEGMENTS = 2
    LINES = 3
    FACES = 4
    INITIAL = 5
    EXPANSION = 6
    ROOMS = 30
    COVERAGE = 31
    DRIVING = 32


class RecordingStream:
    """Rerun file that is being written; a context manager, whole only after it ends.

    Two timelines: ``sim_time``, a duration [s] by the simulation's (or the log's) clock, and ``stage``, a sequence
    over the steps of :class:`Stage`. Everything of a run carries both; a prediction without a run only ``stage``.
    No wall clock is recorded, so that equal runs give equal recordings.
    """

    def __init__(self, path: Path, name: str, viewer: LiveViewer | None = None) -> None:
        """Prepare a file.

        Args:
            path: The file.
            name: Of the recording.
            viewer: It is streamed to while it is written. Batches are then cut by time too, so that two equal runs give
                the same values in files that differ.
        """
        # Before its first array pyarrow imports pandas to ask what is one of its columns: 0.23 s of processor time.
        with hidden("pandas"):
            pa.array([0])
        self._path, self._name, self._viewer = path, name, viewer
        self._stage: int = Stage.BUILDING
        self._rec = rr.RecordingStream(
            APPLICATION,
            recording_id=f"{APPLICATION}-{name}",
            send_properties=False,
            batcher_config=rr.ChunkBatcherConfig(
                flush_tick=NEVER_SECONDS if viewer is None else LIVE_SECONDS, flush_num_bytes=CHUNK_BYTES
            ),
        )
        self.live = viewer is not None
        """Whether somebody watches while it is written."""
        self._closing: threading.Thread | None = None
        self._handler = rr.LoggingHandler("log")
        self._log_level = logging.NOTSET

    def __enter__(self) -> Self:
        with self._clear_errors():
            if self._viewer is None:
                self._rec.save(self._path)
            else:
                self._rec.set_sinks(rr.FileSink(str(self._path)), rr.GrpcSink(self._viewer.address))
        self._rec.set_log_time_enabled(False)
        self._rec.send_recording_name(self._name)
        # The logging handler writes to the recording of its thread.
        self._previous = rr.set_thread_local_data_recording(self._rec)
        logger = logging.getLogger(APPLICATION)
        self._log_level = logger.level
        logger.setLevel(min(logger.getEffectiveLevel(), logging.INFO))
        logger.addHandler(self._handler)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        logger = logging.getLogger(APPLICATION)
        logger.removeHandler(self._handler)
        logger.setLevel(self._log_level)
        rr.set_thread_local_data_recording(self._previous)
        try:
            with self._clear_errors():
                self._flush()
                if self._viewer is None:
                    self._rec.disconnect()
                elif not self._closed_within(FLUSH_SECONDS):
                    raise RuntimeError("the viewer hangs")
        except BaseException as failure:
            watched = self._viewer if isinstance(failure, OutputError) else None
            if watched is not None:
                watched.give_up()
            closed = self._closed_within(CLOSE_SECONDS if watched is None else FLUSH_SECONDS)
            if not closed:
                wait_for_nothing()
            if watched is None or not closed:
                raise  # Else it was the viewer that did not take it; the file is whole.

    def _closed_within(self, seconds: float) -> bool:
        """Close file and viewer; where the writer has ended, or a viewer hangs, that may never end."""
        if self._closing is None:
            self._closing = threading.Thread(target=self._rec.disconnect, daemon=True)
            self._closing.start()
        self._closing.join(seconds)
        return not self._closing.is_alive()

    def _flush(self) -> None:
        """Wait until all is written, as long as the file grows."""
        size = -1
        while True:
            try:
                self._rec.flush(timeout_sec=FLUSH_SECONDS)
            except RuntimeError:
                before, size = size, self._path.stat().st_size
                if size <= before:
                    raise
            else:
                return

    @contextlib.contextmanager
    def _clear_errors(self) -> Iterator[None]:
        """Say what cannot be written as rerun's own errors do not: with the path."""
        try:
            yield
        except RuntimeError as failure:
            raise OutputError(f"cannot write the recording ({failure}): {final_place(self._path)}") from failure

    def arrange(self, blueprint: rrb.Blueprint) -> None:
        """Say how the recording opens; the last one counts."""
        self._rec.send_blueprint(blueprint)

    def at(self, stamp: float | None = None, stage: int | None = None) -> None:
        """Log what follows at ``stamp`` [s] and ``stage``; either stays as it was where not given."""
        if stamp is not None:
            self._rec.set_time("sim_time", duration=stamp)
        if stage is not None:
            self._stage = stage
        self._rec.set_time("stage", sequence=int(self._stage))

    def log(self, path: str, *archetypes: Any, static: bool = False) -> None:
        """Log at the current time, or for all times."""
        self._rec.log(path, *archetypes, static=static)

    def columns(
        self, path: str, columns: Any, *, stamps: FloatArray | None = None, stages: Sequence[int] | None = None
    ) -> None:
        """Send one value a stamp [s] and stage at once; on the one timeline alone where the other is not given."""
        times = []
        if stamps is not None:
            times.append(rr.TimeColumn("sim_time", duration=stamps))
        if stages is not None:
            times.append(rr.TimeColumn("stage", sequence=[int(stage) for stage in stages]))
        self._rec.send_columns(path, times, columns)

    def say(self, title: str, text: str) -> None:
        """Say what happens at this stage, in the view ``Stage``."""
        self.log("stage", text_document(f"## {title}\n{text}"))

    def clear(self, path: str) -> None:
        """Take away what lies below a path, from now on."""
        self.log(path, rr.Clear(recursive=True))

    def property(self, name: str, values: dict[str, str]) -> None:
        """Set a property of the whole recording, shown by the viewer beside its name."""
        self._rec.send_property(name, rr.AnyValues(drop_untyped_nones=True, **values))
