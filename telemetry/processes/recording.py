"""What a recorder does with messages, without a bus: write them, and survive a full disk."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from typing import Literal

import msgspec

from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.simulation import Event
from foretwin.telemetry.logs.write_mcap import DriveWriter

SOURCE = "recorder"

log = logging.getLogger("foretwin.telemetry.processes.recorder")


class DriveRecording:
    """Writes the messages of one drive; what goes wrong becomes events, never an exception.

    Each call returns the events to publish. After the first write error nothing more is written
    and messages are counted in `unwritten`; `create` is called once and may raise OSError.
    """

    def __init__(self, create: Callable[[], DriveWriter], *, name: str) -> None:
        self.unwritten = 0
        """Messages that came after a write error."""
        self.refused: Counter[str] = Counter()
        """Messages that no MCAP can hold, by channel."""
        self._name = name
        self._stamp_ns = 0
        self._writer: DriveWriter | None = None
        self._pending: list[Event] = []
        try:
            self._writer = create()
        except OSError as error:
            self._pending = [self._event("error", f"{name} cannot be written: {error}")]

    @property
    def counts(self) -> Counter[str]:
        """Messages written, by channel."""
        return Counter() if self._writer is None else self._writer.counts

    @property
    def writes(self) -> bool:
        """Whether messages still reach the file."""
        return self._writer is not None and self._writer.error is None

    def started(self) -> list[Event]:
        """Return what went wrong at the start."""
        return self._pending

    def add(self, channel: str, message: msgspec.Struct) -> list[Event]:
        """Write one message."""
        self._stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        if self._writer is None or not self.writes:
            self.unwritten += 1
            return []
        try:
            self._writer.add(channel, message)
        except OSError as error:
            self.unwritten += 1
            return [self._stopped(error)]
        except ValueError as error:
            self.refused[channel] += 1
            if self.refused[channel] > 1:
                return []
            return [self._event("warning", f"not recorded: {error}")]
        return []

    def set_info(self, info: VehicleInfo) -> list[Event]:
        """Write what is known of the vehicle."""
        return self._attempt(lambda writer: writer.set_info(info))

    def flush(self) -> list[Event]:
        """Put what has been added so far on the disk."""
        return self._attempt(DriveWriter.flush)

    def finish(self) -> list[Event]:
        """End the file."""
        writer, wrote = self._writer, self.writes
        if writer is None:
            return []
        writer.finish()
        if wrote and writer.error is not None:
            return [self._stopped(writer.error)]
        return []

    def _attempt(self, step: Callable[[DriveWriter], None]) -> list[Event]:
        if self._writer is None or not self.writes:
            return []
        try:
            step(self._writer)
        except OSError as error:
            return [self._stopped(error)]
        return []

    def _stopped(self, error: OSError) -> Event:
        reason = error.strerror or str(error)
        return self._event(
            "error",
            f"{self._name} ends here: {reason}; the drive goes on without being recorded",
        )

    def _event(self, level: Literal["warning", "error"], text: str) -> Event:
        log.log(logging.ERROR if level == "error" else logging.WARNING, text)
        return Event(stamp_ns=self._stamp_ns, level=level, source=SOURCE, text=text)
