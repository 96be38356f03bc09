"""What was refused at the boundary, counted by sender and reason, each to be told once."""

from __future__ import annotations

from collections import Counter
from typing import Any

from foretwin.contracts.guard import Refused
from foretwin.contracts.keys import PREFIX

MOST_KINDS = 200
"""Of sender and reason together: who makes up new keys fills no memory; the rest is one kind."""
_REST = ("others", "various")


class Refusals:
    """Counts; `take` returns what to tell, the first time of each sender and reason."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str]] = Counter()

    def __len__(self) -> int:
        return self._counts.total()

    def take(self, refused: Refused) -> str | None:
        """Count something that was refused; returns a line where it is the first of its kind."""
        return self.note(refused.sender, refused.reason, text=str(refused))

    def note(self, sender: str, reason: str, *, count: int = 1, text: str = "") -> str | None:
        """Count things that were left out; returns a line for the first of their kind."""
        sender, reason = sender.removeprefix(f"{PREFIX}/")[:200], reason[:200]
        kind = (sender, reason)
        if kind not in self._counts and len(self._counts) >= MOST_KINDS:
            kind = _REST
        first = kind not in self._counts
        self._counts[kind] += count
        if not first:
            return None
        said = text.removeprefix(f"{PREFIX}/") or f"{sender}: {reason}"
        return f"refused: {said[:500]}; more of the kind are counted"

    def counts(self) -> dict[str, int]:
        """Return how often each was refused, by sender and reason in one text."""
        return {f"{sender}: {reason}": count for (sender, reason), count in self._counts.items()}

    def record(self) -> dict[str, Any]:
        """Return the `refused` part of run.json."""
        return {
            "count": len(self),
            "by_sender": [
                {"sender": sender, "reason": reason, "count": count}
                for (sender, reason), count in sorted(self._counts.items())
            ],
        }
