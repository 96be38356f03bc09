"""What was refused at the boundary, counted by sender and reason, each to be told once."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.guard import Refused
from foretwin.contracts.keys import PREFIX
from foretwin.contracts.refusal_counts import RefusalCounts


class Refusals(RefusalCounts):
    """Counts; `take` returns what to tell, the first time of each sender and reason."""

    def take(self, refused: Refused) -> str | None:
        """Count something that was refused; returns a line where it is the first of its kind."""
        return self.note(refused.sender, refused.reason, text=str(refused))

    def note(self, sender: str, reason: str, *, count: int = 1, text: str = "") -> str | None:
        """Count things that were left out; returns a line for the first of their kind."""
        sender = sender.removeprefix(f"{PREFIX}/")
        if not self.add(sender, reason, count=count):
            return None
        said = text.removeprefix(f"{PREFIX}/") or f"{sender}: {reason}"
        return f"refused: {said[:500]}; more of the kind are counted"

    def counts(self) -> dict[str, int]:
        """Return how often each was refused, by sender and reason in one text."""
        return {f"{one.sender}: {one.reason}": one.count for one in self.kinds()}

    def record(self) -> dict[str, Any]:
        """Return the `refused` part of run.json."""
        return {
            "count": len(self),
            "by_sender": [
                {"sender": one.sender, "reason": one.reason, "count": one.count}
                for one in self.kinds()
            ],
        }
