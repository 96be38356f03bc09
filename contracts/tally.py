"""What became of every message that was to be recorded, by its sender's numbers.

A recorder keeps it in a file beside the recording, so that one that is started again knows what it
has, and the run's ledger what is missing.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

import msgspec

from foretwin.contracts.numbering import Numberings

Fate = Literal["recorded", "unwritten", "refused"]
RESERVED_BYTES = 16_384
"""Room that is taken while the disk has some: a tally is written on a full one too."""


class Tally(msgspec.Struct):
    """What is known to be recorded or lost, by channel.

    All that came is one of `recorded`, `unwritten` (the file could not take it) and `refused` (no
    file can hold it); together with what is missing they make up what was published.
    """

    numbers: Numberings = msgspec.field(default_factory=Numberings)
    recorded: dict[str, int] = {}
    unwritten: dict[str, int] = {}
    refused: dict[str, int] = {}
    part: int = 1
    """The part of the recording that was written when this was, and how many messages it held."""
    in_part: int = 0

    def settle(self, fate: Fate, channel: str) -> int:
        """Count what became of one message that came; returns how many of its channel fared so."""
        counts: dict[str, int] = getattr(self, fate)
        counts[channel] = counts.get(channel, 0) + 1
        return counts[channel]

    def without(self, waiting: Mapping[str, Iterable[int]]) -> Tally:
        """Return the tally as if numbers that came, by their numberings' names, had not.

        Nobody knows yet what becomes of them.
        """
        known = msgspec.convert(msgspec.to_builtins(self), Tally)
        for name, seqs in waiting.items():
            if name in known.numbers.streams:
                known.numbers.streams[name].give_back(sorted(seqs))
        return known


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
