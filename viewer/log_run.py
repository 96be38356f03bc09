"""The run itself as rows: workers, progress in one line, events."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import rerun as rr

from foretwin.contracts.simulation import Event, Progress, WorkerStatus
from foretwin.contracts.world import ATTRIBUTION
from foretwin.viewer.rows import (
    Row,
    document,
    in_markdown,
    path_part,
    place_text,
    plain_text,
    static,
)

WORKER_COLOURS = {
    "starting": 0x607D8BFF,
    "idle": 0x90A4AEFF,
    "busy": 0x43A047FF,
    "sick": 0xFB8C00FF,
    "dead": 0xE53935FF,
}
_MEASURED = "rtf", "memory_mb", "link_ms", "clock_offset_ms"
"""What a worker's status tells in numbers; the last two of one on another machine alone."""
LEVELS = {
    "info": rr.TextLogLevel.INFO,
    "warning": rr.TextLogLevel.WARN,
    "error": rr.TextLogLevel.ERROR,
}


class RunLog:
    """Turns the run's messages into rows; a worker's colours come with its first status."""

    def __init__(
        self,
        title: str,
        attribution: str = ATTRIBUTION,
        clock: Callable[[], str] | None = None,
    ) -> None:
        """`clock` tells the time of day where somebody watches: who sees an old one is behind."""
        self._clock = clock
        self._title = in_markdown(title)
        self._source = f"map: {in_markdown(attribution)}"
        self._states: dict[str, str] = {}

    def static_rows(self) -> list[Row]:
        """Return the status line as it reads before the first progress."""
        return [static("about", document(f"{self._title} · {self._source}"))]

    def first_status(self) -> Row:
        """Return the status line at drive time 0."""
        return Row("status", 0, document(f"**{self._title}** · {self._source}"), True)

    def worker(self, status: WorkerStatus, drive_ns: int) -> list[Row]:
        """Return a change of state, and what was measured of it."""
        part = path_part(status.worker_id)
        rows: list[Row] = []
        if status.worker_id not in self._states:
            rows.append(
                static(
                    f"workers/state/{part}",
                    rr.StateConfiguration(
                        values=list(WORKER_COLOURS),
                        labels=list(WORKER_COLOURS),
                        colors=np.array(list(WORKER_COLOURS.values()), dtype=np.uint32),
                    ),
                )
            )
            rows += [
                static(f"workers/{what}/{part}", rr.SeriesLines(names=status.worker_id))
                for what in _MEASURED
            ]
        if self._states.get(status.worker_id) != status.state:
            self._states[status.worker_id] = status.state
            rows.append(Row(f"workers/state/{part}", drive_ns, rr.StateChange(state=status.state)))
        for what in _MEASURED:
            if (value := getattr(status, what)) is not None:
                rows.append(Row(f"workers/{what}/{part}", drive_ns, rr.Scalars(value)))
        return rows

    def progress(self, progress: Progress, drive_ns: int) -> list[Row]:
        """Return the status line."""
        ahead = "no junction ahead"
        if progress.next_intersection is not None:
            name = in_markdown(place_text(progress.next_intersection, progress.junction_id or ""))
            ahead = f"next **{name}** {progress.arrival_text}"
        now = "" if self._clock is None else f", now {self._clock()}"
        memory = f" · {progress.memory_mb:.0f} MB" if progress.memory_mb is not None else ""
        short = (
            f"**{in_markdown(progress.too_slow)}** (too slow for all) · "
            if progress.too_slow
            else ""
        )
        text = (
            # The map's source early on: where the line is too long, its end is cut off.
            f"**{progress.drive_time_s:.1f} s**{now} · {self._source} · "
            f"{in_markdown(progress.mission_state)} · {ahead} · "
            f"{short}{progress.futures_per_s:.0f} futures/s · {progress.dropped} dropped{memory}"
        )
        return [Row("status", drive_ns, document(text))]


def rows_of_event(event: Event, drive_ns: int) -> list[Row]:
    """Return one line of the event log."""
    text = f"{plain_text(event.source)}: {plain_text(event.text)}"
    return [Row("events", drive_ns, rr.TextLog(text, level=LEVELS[event.level]))]
