"""When a recorder asks once more for what it missed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

FIRST_S, TRIES = 2.0, 3
"""After so long, in which what is missing may come by itself, and then after twice as long each."""


@dataclass(slots=True)
class _Asked:
    missing: int
    due_s: float
    tries: int = 0


@dataclass(slots=True)
class MissedSamples:
    """Tells of which channels something is missing for a while, a few times for each growth.

    A subscriber that finds a gap asks for it by itself, but once; where the sender's link is just
    coming back, or it stood still, nobody answers.
    """

    first_s: float = FIRST_S
    """How long to wait where something is missing for the first time."""
    _asked: dict[str, _Asked] = field(default_factory=dict)

    def due(self, missing: Mapping[str, int], now_s: float, *, at_once: bool = False) -> list[str]:
        """Return the channels to be asked for now; `missing` is how many samples by channel.

        With `at_once` all of which something is missing: there is no time to wait.
        """
        due = []
        for channel, count in missing.items():
            known = self._asked.get(channel)
            if not count:
                self._asked.pop(channel, None)
                continue
            if known is None or (count > known.missing and known.tries):
                wait_s = self.first_s if known is None else FIRST_S
                known = self._asked[channel] = _Asked(count, now_s + wait_s)
            known.missing = max(known.missing, count)
            if at_once or (known.tries < TRIES and now_s >= known.due_s):
                known.tries += 1
                known.due_s = now_s + FIRST_S * 2.0**known.tries
                due.append(channel)
        return due
