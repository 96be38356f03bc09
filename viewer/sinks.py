"""Two streams of one recording: a file that is always complete, and a live view that may stall."""

from __future__ import annotations

import collections
import contextlib
import logging
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from foretwin.viewer.columns import send_rows
from foretwin.viewer.keeping_up import WindowLag
from foretwin.viewer.rows import APPLICATION_ID, TIMELINE, Row, plain_text

LIVE_ROWS = 256
LASTING_ROWS = 4096
MOST_WAITING = 1000
FLUSH_S = 3.0
MOST_FAILURES = 3
"""Flushes that fail one after the other: a busy machine may be too slow for one of them."""
FILE_BATCH_S, LIVE_BATCH_S = 2.0, 0.05

_log = logging.getLogger(__name__)
_NEVER_DROPPED: list[rr.RecordingStream] = []
"""Streams whose file takes nothing any more: who lets go of one waits for it, for ever."""


def recording_stream(
    recording_id: str, *, send_properties: bool, batch_s: float = FILE_BATCH_S
) -> rr.RecordingStream:
    """Return a stream of our application, without the wall clock as a timeline.

    Rows of one entity within `batch_s` share a chunk, which costs some 1.2 kB of its own.
    """
    batching = rr.ChunkBatcherConfig.DEFAULT()
    batching.flush_tick = batch_s
    stream = rr.RecordingStream(
        APPLICATION_ID,
        recording_id=recording_id,
        send_properties=send_properties,
        batcher_config=batching,
    )
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def _emit(stream: rr.RecordingStream, row: Row) -> None:
    if row.drive_ns is None:
        stream.log(row.path, row.components, static=True)
        return
    stream.set_time(TIMELINE, duration=np.timedelta64(row.drive_ns, "ns"))
    stream.log(row.path, row.components)


class FileStream:
    """The recording as a file, written by the caller's own thread.

    Rows wait for the next `flush`, so that those of one entity cost one call: alone, a row costs
    more than all that leads to it.
    """

    def __init__(
        self, path: Path, *, recording_id: str, title: str, blueprint: rrb.Blueprint
    ) -> None:
        self._stream = recording_stream(recording_id, send_properties=True)
        self._stream.save(path, default_blueprint=blueprint)
        self._stream.send_recording_name(plain_text(title))
        self._waiting: dict[str, list[Row]] = collections.defaultdict(list)
        self._count = 0
        self._failures = 0

    def write(self, rows: Iterable[Row]) -> None:
        """Append rows."""
        for row in rows:
            if row.drive_ns is None or isinstance(row.components, rr.Clear):
                self._send_waiting()  # what is cleared is what was there before
                _emit(self._stream, row)
                continue
            self._waiting[row.path].append(row)
            self._count += 1
            if self._count >= MOST_WAITING:
                self._send_waiting()

    def _send_waiting(self) -> None:
        for path, rows in self._waiting.items():
            send_rows(self._stream, path, rows)
        self._waiting.clear()
        self._count = 0

    def flush(self) -> None:
        """Bring what was written to the file, in bounded time.

        Raises OSError where that fails again and again: after an error of the disk (one that is
        full for a moment) Rerun writes no more into a file, and only another one can go on.
        """
        self._send_waiting()
        try:
            self._stream.flush(timeout_sec=FLUSH_S)
        except RuntimeError as problem:
            self._failures += 1
            _log.warning("the recording could not be flushed: %s", problem)
            if self._failures >= MOST_FAILURES:
                _NEVER_DROPPED.append(self._stream)
                raise OSError(f"the recording takes nothing any more: {problem}") from problem
        else:
            self._failures = 0

    def close(self) -> None:
        """Flush and write the footer, in bounded time: a file that takes nothing takes for ever."""
        with contextlib.suppress(OSError):
            self.flush()
        leaving = threading.Thread(target=self._stream.disconnect, name="footer", daemon=True)
        leaving.start()
        leaving.join(FLUSH_S)
        if leaving.is_alive():
            _NEVER_DROPPED.append(self._stream)
            _log.warning("the recording could not be ended in %g s", FLUSH_S)


class LiveStream:
    """The recording for a window or browser, written by a thread of its own.

    `log()` blocks once an absent or frozen viewer has taken about 200 MB. So rows wait in a
    bounded queue: the oldest are dropped and counted, the map and other lasting rows last.
    `open_viewer` starts the viewer if need be and returns its address; it runs in the thread.
    """

    def __init__(
        self,
        open_viewer: Callable[[], str],
        *,
        recording_id: str,
        blueprint: rrb.Blueprint,
    ) -> None:
        self._open_viewer = open_viewer
        self._recording_id = recording_id
        self._blueprint = blueprint
        self._lasting: collections.deque[Row] = collections.deque()
        self._rows: collections.deque[Row] = collections.deque()
        self._changed = threading.Condition()
        self._closing = False
        self._done = threading.Event()
        self.dropped = 0
        self._newest_ns = self._sent_ns = 0
        self._lag: WindowLag | None = None
        self.failed: str | None = None
        threading.Thread(target=self._pump, name="live", daemon=True).start()

    @property
    def waiting(self) -> int:
        """How many rows have not been sent yet."""
        return len(self._lasting) + len(self._rows)

    @property
    def behind_s(self) -> float:
        """By how much drive time what is shown is older than what was written."""
        asked_s = 0.0 if self._lag is None else self._lag.behind_s
        return max((self._newest_ns - self._sent_ns) / 1e9, asked_s)

    def write(self, rows: Iterable[Row]) -> None:
        """Queue rows; never waits."""
        with self._changed:
            for row in rows:
                self._newest_ns = max(self._newest_ns, row.drive_ns or 0)
                queue, depth = (
                    (self._lasting, LASTING_ROWS) if row.lasting else (self._rows, LIVE_ROWS)
                )
                if len(queue) >= depth:
                    queue.popleft()
                    self.dropped += 1
                queue.append(row)
            self._changed.notify()

    def close(self, timeout_s: float) -> bool:
        """Send what is queued; returns whether all went out within `timeout_s`."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        return self._done.wait(timeout_s)

    def _next(self) -> Row | None:
        with self._changed:
            while True:
                if self._lasting:
                    return self._lasting.popleft()
                if self._rows:
                    return self._rows.popleft()
                if self._closing:
                    return None
                self._changed.wait()

    def _pump(self) -> None:
        try:
            stream = recording_stream(
                self._recording_id, send_properties=False, batch_s=LIVE_BATCH_S
            )
            address = self._open_viewer()
            stream.connect_grpc(address, default_blueprint=self._blueprint)
            self._lag = WindowLag(address, self._recording_id, lambda: self._sent_ns)
            while (row := self._next()) is not None:
                _emit(stream, row)
                self._sent_ns = max(self._sent_ns, row.drive_ns or 0)
            stream.flush(timeout_sec=FLUSH_S)
        except Exception as problem:  # the drive goes on without a window
            _log.warning("no live view: %s", problem)
            self.failed = str(problem)
        self._done.set()
