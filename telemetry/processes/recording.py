"""What a recorder does with messages, without a bus: write them, and outlast a full disk."""

from __future__ import annotations

import contextlib
import logging
import time
from collections import defaultdict, deque
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import msgspec

from foretwin.contracts.drive import DriveEnd, VehicleInfo
from foretwin.contracts.keys import SAMPLE_CHANNELS
from foretwin.contracts.segments import Roll, next_number, segment_file
from foretwin.contracts.simulation import Event
from foretwin.contracts.tally import Tally, tally_file, write_tally
from foretwin.telemetry.logs.write_mcap import DriveWriter, create
from foretwin.telemetry.processes.tally_left import tally_left

SOURCE = "recorder"
MOST_WAITING = 20_000
"""Messages that are kept for a disk that has no room: more than a minute of a car."""
RETRY_S = 1.0

log = logging.getLogger("foretwin.telemetry.processes.recorder")


class OpenPart(Protocol):
    """Creates the file of one part of a recording; may raise OSError."""

    def __call__(self, path: Path, *, part: int) -> DriveWriter:
        """Create it."""


class _ToWrite(NamedTuple):
    channel: str
    message: msgspec.Struct
    numbering: str
    seq: int
    sender: int


class DriveRecording:
    """Writes the messages of one drive; what goes wrong becomes events, never an exception.

    Each call returns the events to publish. Where a file cannot grow, messages wait in memory, the
    newest `MOST_WAITING`, and go into the next part (foretwin.contracts.segments) as soon as there
    is room; the others are counted. What is in a file or lost for good stands in the tally
    (foretwin.contracts.tally), which is written with each flush: who goes on with a recording
    takes nothing twice. What a kill left in the file after the last tally is read from there.
    """

    def __init__(
        self,
        path: Path,
        *,
        open_part: OpenPart = create,
        mono_s: Callable[[], float] = time.monotonic,
        roll: Roll | None = None,
    ) -> None:
        self._path, self._open_part = path, open_part
        self._mono_s, self._roll = mono_s, roll or Roll()
        self._begun_s = mono_s()
        self._part = next_number(path)
        begun = self._part > 1
        self.tally = tally_left(path) if begun else Tally()
        self._waiting: deque[_ToWrite] = deque()
        self._given = 0
        """So many of those that wait have been given to the file in progress."""
        self._writer: DriveWriter | None = None
        self._info: VehicleInfo | None = None
        self._retry_s = 0.0
        self._outages = 0
        self._out = False
        self._stamp_ns = 0
        self._pending = self._open()

    @property
    def missing(self) -> int:
        """Messages that have not come, by their senders' numbers."""
        return self.tally.numbers.missing.total()

    def started(self) -> list[Event]:
        """Return what went wrong at the start."""
        return self._pending

    def add(
        self,
        channel: str,
        message: msgspec.Struct,
        *,
        sender: int = 0,
        seq: int | None = None,
        sent_ns: int = 0,
    ) -> list[Event]:
        """Write one message, unless it came before; without a number it is the next one."""
        if seq is None:
            seq = self.tally.numbers.published[channel]
        numbering = self.tally.numbers.take(channel, seq, sender=sender, sent_ns=sent_ns)
        if numbering is None:
            return []
        self._stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        if isinstance(message, DriveEnd):
            self._take_end(message, sender)
        self._waiting.append(_ToWrite(channel, message, numbering, seq, sender))
        if len(self._waiting) > MOST_WAITING:
            self._give_up(self._waiting.popleft())
        return self._go_on() if self._writer is None else self._give()

    def refuse(self, channel: str, *, sender: int, seq: int, sent_ns: int = 0) -> None:
        """Count a message that came and is not taken."""
        if self.tally.numbers.take(channel, seq, sender=sender, sent_ns=sent_ns) is not None:
            self.tally.settle("refused", channel)

    def set_info(self, info: VehicleInfo) -> list[Event]:
        """Write what is known of the vehicle, into each part."""
        self._info = info
        return self._attempt(lambda writer: writer.set_info(info))

    def flush(self) -> list[Event]:
        """Put what has been added so far on the disk; begin another file where one is large."""
        events = self._go_on() if self._writer is None else self._attempt(DriveWriter.flush)
        # Before the disk is waited for: whoever is killed meanwhile has it in the file.
        self._write_tally()
        events += self._attempt(DriveWriter.sync)
        if self._writer is not None and self._roll.is_due(
            size_bytes=self._writer.size_bytes, age_s=self._mono_s() - self._begun_s
        ):
            self._end_part()
            events += self._open()
        return events

    def finish(self, *, last: bool = True) -> list[Event]:
        """End the file; what could not be written by now is lost.

        Where this recorder is not the `last`, it has not come: the next one asks for it.
        """
        self._retry_s = 0.0
        events = self.flush()
        self._end_part()
        while last and self._waiting:
            self._give_up(self._waiting.popleft())
        self._write_tally()
        return events

    def _write_tally(self) -> None:
        """Write what is in a file or lost for good; what waits has not come, for who goes on."""
        waiting: dict[str, list[int]] = defaultdict(list)
        for one in self._waiting:
            waiting[one.numbering].append(one.seq)
        self.tally.part = self._part
        writer = self._writer
        self.tally.in_part = 0 if writer is None else writer.counts.total() - writer.held
        write_tally(self.tally.without(waiting), tally_file(self._path))

    def _take_end(self, end: DriveEnd, sender: int) -> None:
        """Count as missing what the vehicle says it sent and that never came; of other channels
        than a vehicle's nothing comes here."""
        for channel in SAMPLE_CHANNELS:
            if count := end.published.get(channel):
                self.tally.numbers.reach(channel, count, sender=sender)

    def _open(self) -> list[Event]:
        """Begin a part and give it all that waits."""
        try:
            path = segment_file(self._path, self._part)
            self._writer = self._open_part(path, part=self._part)
            self._begun_s = self._mono_s()
        except OSError as error:
            self._discard()
            return self._stopped(error)
        if self._info is not None:
            self._attempt(lambda writer: writer.set_info(self._info))  # type: ignore[arg-type]
        return self._give()

    def _go_on(self) -> list[Event]:
        """Try again to write, where it is time to."""
        if self._mono_s() < self._retry_s:
            return []
        events = self._open()
        if self._out and self._writer is not None:
            events += self._attempt(DriveWriter.flush)
        if self._out and self._writer is not None:
            self._out = False
            name = segment_file(self._path, self._part).name
            lost = sum(self.tally.unwritten.values())
            text = f"{name}: the recording goes on; {lost} messages could not be written so far"
            if _is_told(self._outages):
                events.append(self._event("warning", text))
        return events

    def _give(self) -> list[Event]:
        """Give the file what it has not been given yet."""
        events: list[Event] = []
        while self._writer is not None and self._given < len(self._waiting):
            one = self._waiting[self._given]
            try:
                self._writer.add(one.channel, one.message, sequence=one.seq, sender=one.sender)
            except OSError as error:
                return events + self._stopped(error)
            except ValueError as error:
                events += self._refuse(one, error)
                continue
            self._given += 1
            self._settle()
        return events

    def _refuse(self, one: _ToWrite, error: ValueError) -> list[Event]:
        del self._waiting[self._given]
        if self.tally.settle("refused", one.channel) > 1:
            return []
        return [self._event("warning", f"not recorded: {error}")]

    def _settle(self) -> None:
        """Count what is in the file by now."""
        while self._writer is not None and self._given > self._writer.held:
            one = self._waiting.popleft()
            self._given -= 1
            self.tally.settle("recorded", one.channel)

    def _give_up(self, one: _ToWrite) -> None:
        self.tally.settle("unwritten", one.channel)

    def _attempt(self, step: Callable[[DriveWriter], None]) -> list[Event]:
        if self._writer is None:
            return []
        try:
            step(self._writer)
        except OSError as error:
            return self._stopped(error)
        self._settle()
        return []

    def _end_part(self) -> None:
        """End the file in progress; a part without a message gives way to the next attempt."""
        writer, self._writer, self._given = self._writer, None, 0
        if writer is None:
            return
        writer.finish()
        if writer.counts.total() > writer.held:
            self._part += 1
        else:
            self._discard()

    def _discard(self) -> None:
        """Remove a later part that holds nothing; the first keeps its name whatever comes."""
        if self._part > 1:
            with contextlib.suppress(OSError):
                segment_file(self._path, self._part).unlink()

    def _stopped(self, error: OSError) -> list[Event]:
        """Keep what comes until there is room; told for the first, second, fourth time ..."""
        name = segment_file(self._path, self._part).name
        self._end_part()
        self._retry_s = self._mono_s() + RETRY_S
        if self._out:
            return []
        self._out = True
        self._outages += 1
        if not _is_told(self._outages):
            return []
        reason = error.strerror or str(error)
        text = f"{name} cannot be written: {reason}; tried again, {MOST_WAITING} messages wait"
        return [self._event("error", text)]

    def _event(self, level: Literal["warning", "error"], text: str) -> Event:
        log.log(logging.ERROR if level == "error" else logging.WARNING, text)
        return Event(stamp_ns=self._stamp_ns, level=level, source=SOURCE, text=text)


def _is_told(times: int) -> bool:
    """Whether what happens again and again is told this time: when it is twice as often."""
    return times & (times - 1) == 0
