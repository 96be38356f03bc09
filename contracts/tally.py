"""What became of every message that was to be recorded, by its sender's numbers.

A recorder keeps it in a file beside the recording, so that one that is started again knows what it
has, and the run's ledger what is missing.
"""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from pathlib import Path
from typing import Literal

import msgspec

Fate = Literal["recorded", "unwritten", "refused"]
MOST_HOLES = 256
"""Of one sender on one channel; what comes late into an older one is not taken any more."""
RESERVED_BYTES = 16_384
"""Room that is taken while the disk has some: a tally is written on a full one too."""


class Numbering(msgspec.Struct):
    """What of one sender's messages on one channel has come; grows as they come."""

    channel: str
    first: int
    next: int
    holes: list[tuple[int, int]] = []
    """What has not come: first number, and the one after the last."""
    given_up: int = 0
    """Numbers of holes that were too many to be kept."""

    @property
    def missing(self) -> int:
        """How many numbers have not come."""
        return self.given_up + sum(end - begin for begin, end in self.holes)

    def take(self, seq: int) -> bool:
        """Take one number; False where it has come before."""
        if seq >= self.next:
            self.reach(seq)
            self.next = seq + 1
            return True
        for place, (begin, end) in enumerate(self.holes):
            if begin <= seq < end:
                left = ((begin, seq), (seq + 1, end))
                self.holes[place : place + 1] = [one for one in left if one[0] < one[1]]
                return True
        return False

    def reach(self, count: int) -> None:
        """Count as missing what has not come below a number."""
        if count > self.next:
            self.holes.append((self.next, count))
            self.next = count
        while len(self.holes) > MOST_HOLES:
            begin, end = self.holes.pop(0)
            self.given_up += end - begin


class Numberings(msgspec.Struct):
    """The numberings of all senders on all channels."""

    streams: dict[str, Numbering] = {}

    def take(self, channel: str, sender: int, seq: int) -> bool:
        """Take one message's number; False where it has come before.

        Of senders that do not tell who they are (0), a number that came before is one of another.
        """
        if self._of(channel, sender, first=seq).take(seq):
            return True
        if sender:
            return False
        self.streams[f"{channel} 0.{len(self.streams)}"] = self.streams.pop(f"{channel} 0")
        return self._of(channel, sender, first=seq).take(seq)

    def begin(self, channel: str, sender: int, seq: int) -> None:
        """Expect a sender's numbers from this one on, where it is not known yet."""
        self._of(channel, sender, first=seq)

    def reach(self, channel: str, sender: int, count: int) -> None:
        """Count as missing what has not come of the first `count` messages of a sender."""
        self._of(channel, sender, first=0).reach(count)

    def _of(self, channel: str, sender: int, *, first: int) -> Numbering:
        stream = f"{channel} {sender}"
        found = self.streams.get(stream)
        if found is None:
            found = self.streams[stream] = Numbering(channel, first, first)
        return found

    @property
    def missing(self) -> Counter[str]:
        """How many messages have not come, by channel."""
        return self._by_channel({name: one.missing for name, one in self.streams.items()})

    @property
    def published(self) -> Counter[str]:
        """How many messages there must have been, by channel, since each sender was first heard."""
        return self._by_channel({name: one.next - one.first for name, one in self.streams.items()})

    def _by_channel(self, counts: dict[str, int]) -> Counter[str]:
        found: Counter[str] = Counter()
        for name, count in counts.items():
            found[self.streams[name].channel] += count
        return found


class Tally(msgspec.Struct):
    """What is known to be recorded or lost, by channel.

    All that came is one of `recorded`, `unwritten` (the file could not take it) and `refused` (no
    file can hold it); together with what is missing they make up what was published.
    """

    settled: Numberings = msgspec.field(default_factory=Numberings)
    recorded: dict[str, int] = {}
    unwritten: dict[str, int] = {}
    refused: dict[str, int] = {}

    def settle(self, fate: Fate, channel: str, sender: int, seq: int) -> int:
        """Count what became of one message; returns how many of its channel fared so."""
        counts: dict[str, int] = getattr(self, fate)
        counts[channel] = counts.get(channel, 0) + 1
        self.settled.take(channel, sender, seq)
        return counts[channel]


def tally_file(recording: Path) -> Path:
    """Return where the tally of a recording lies: drive.tally.json beside drive.mcap."""
    return recording.with_suffix(".tally.json")


def read_tally(path: Path) -> Tally | None:
    """Return a recorder's tally, None where there is none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Tally)
    except (OSError, msgspec.DecodeError):
        return None


def write_tally(tally: Tally, path: Path) -> None:
    """Write a tally over the one before, in one call, so that a kill leaves one of them.

    What cannot be written (a full disk without room for it) is left as it was.
    """
    data = msgspec.json.encode(tally).ljust(RESERVED_BYTES - 1) + b"\n"
    with contextlib.suppress(OSError):
        target = os.open(path, os.O_WRONLY | os.O_CREAT, 0o644)
        try:
            if os.pwrite(target, data, 0) == len(data):
                os.ftruncate(target, len(data))
        finally:
            os.close(target)
