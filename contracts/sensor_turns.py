"""How many turns a drive's virtual sensors told and passed over, where their process leaves it."""

from __future__ import annotations

import contextlib
import math
import time
from pathlib import Path

import msgspec

from foretwin.contracts.partial_file import partial_file

_FILE, _EVERY_S = "sensors.turns", 1.0


class SensorTurns(msgspec.Struct, frozen=True, kw_only=True):
    """Of one sensor: turns that were told, and those that were over while others were measured."""

    told: int = 0
    passed_over: int = 0


Turns = dict[str, SensorTurns]
"""By the names of sensors."""


def read_turns(folder: Path) -> Turns:
    """Return what the process wrote last, nothing where it did not."""
    with contextlib.suppress(OSError, msgspec.DecodeError):
        return msgspec.json.decode((folder / _FILE).read_bytes(), type=Turns)
    return {}


class TurnsFile:
    """Where the process says it, once a second; one that is started again counts on."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._before = folder, read_turns(folder)
        self._next_s = -math.inf

    def look(self, now: Turns) -> None:
        """Write where it is time to; call it often."""
        if time.monotonic() >= self._next_s:
            self.write(now)

    def write(self, now: Turns) -> None:
        """Say it; a full disk ends no process."""
        self._next_s = time.monotonic() + _EVERY_S
        whole = {name: _sum(one, self._before.get(name)) for name, one in now.items()}
        with contextlib.suppress(OSError), partial_file(self._folder / _FILE) as partial:
            partial.write_bytes(msgspec.json.encode(self._before | whole))


def passed_over_text(turns: Turns) -> str:
    """Return what the engineer reads, empty where nothing was passed over."""
    of_each = ", ".join(
        f"{one.passed_over} of {one.passed_over + one.told} of {name}"
        for name, one in turns.items()
        if one.passed_over
    )
    return f"turns passed over: {of_each}" if of_each else ""


def _sum(one: SensorTurns, before: SensorTurns | None) -> SensorTurns:
    if before is None:
        return one
    return SensorTurns(
        told=one.told + before.told, passed_over=one.passed_over + before.passed_over
    )
