"""What is missing by the senders' numbering, whatever order, doubling or restart brings.

A key may have several numberings at once: a sender that began anew, or a second one. Each message
counts in the one that it continues best, so that none takes the other's numbers for a gap.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Literal

Heard = Literal["new", "late", "doubled"]

_TURN = 2**64
"""Numbers are 64 bits wide and begin anew after the last."""
MOST_GAP = 30_000
"""Five minutes at 100 Hz: who is farther ahead goes on with another numbering."""
_MOST_HOLES = 1024
"""Of a numbering: what comes late into an older one is not known as late any more."""
_RECENT = 64
"""So many of the last messages are known again when they come twice."""
_BEGINS_BELOW = 64
"""A sender that begins anew is heard by this number at the latest; what came before it is lost."""
_MOST_KEYS = 4096
"""The key that came first is forgotten: who makes up new ones fills no memory."""
_NUMBERINGS = 4
"""Of one key; the one that was silent for longest is forgotten."""


@dataclass(slots=True, eq=False)
class _Numbering:
    """One sender's count from its start: what comes next, and what has not come yet."""

    next_seq: int
    newest_sent_ns: int
    holes: list[tuple[int, int]] = field(default_factory=list)
    """What has not come: the first missing number and how many follow each other."""
    recent: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=_RECENT))

    def ahead(self, seq: int) -> int:
        """Return by how many a number is ahead of the next one, negative where it is behind."""
        return (seq - self.next_seq + _TURN // 2) % _TURN - _TURN // 2

    def fill(self, seq: int) -> bool:
        """Take a number that was missing; returns whether it was."""
        for place, (first, count) in enumerate(self.holes):
            before = (seq - first) % _TURN
            if before < count:
                after = ((seq + 1) % _TURN, count - before - 1)
                self.holes[place : place + 1] = [h for h in ((first, before), after) if h[1]]
                return True
        return False

    def go_on(self, seq: int, sent_ns: int) -> int:
        """Take a number that is not behind; returns how many are missing before it."""
        gap = self.ahead(seq)
        if gap:
            self.holes.append((self.next_seq, gap))
            del self.holes[:-_MOST_HOLES]
        self.next_seq = (seq + 1) % _TURN
        self.newest_sent_ns = max(self.newest_sent_ns, sent_ns)
        return gap


class SequenceGaps:
    """Counts what is missing: `lost` are gaps that no late message has filled."""

    def __init__(self) -> None:
        self.lost = 0
        self.doubled = 0
        self._numberings: dict[Hashable, list[_Numbering]] = {}
        """By key, the one heard last at the end."""

    def take(self, key: Hashable, seq: int, *, sent_ns: int) -> Heard:
        """Take one message's number and its sender's clock; returns what it is to us."""
        known = self._numberings.setdefault(key, [])
        if len(self._numberings) > _MOST_KEYS:
            del self._numberings[next(iter(self._numberings))]
        for numbering in reversed(known):
            if (seq, sent_ns) in numbering.recent:
                self.doubled += 1
                return "doubled"
        heard: Heard = "late"
        late = self._filled(known, seq, sent_ns)
        if late is not None:
            numbering = late
            self.lost -= 1
        else:
            heard = "new"
            numbering = self._continued(known, seq) or self._begun(known, seq, sent_ns)
            self.lost += numbering.go_on(seq, sent_ns)
        numbering.recent.append((seq, sent_ns))
        known.remove(numbering)
        known.append(numbering)
        return heard

    def _filled(self, known: list[_Numbering], seq: int, sent_ns: int) -> _Numbering | None:
        """Return the numbering in which this number was missing, and now is not.

        What was sent after all of a numbering, and begins or continues a newer one, is of that.
        """
        for one in reversed(known):
            newer = sent_ns > one.newest_sent_ns and (
                seq <= _BEGINS_BELOW
                or any(
                    other.newest_sent_ns > one.newest_sent_ns and 0 <= other.ahead(seq) <= MOST_GAP
                    for other in known
                )
            )
            if not newer and one.fill(seq):
                return one
        return None

    def _continued(self, known: list[_Numbering], seq: int) -> _Numbering | None:
        """Return the numbering with the least gap before `seq`, of equals the one heard last."""
        fits = [one for one in reversed(known) if 0 <= one.ahead(seq) <= MOST_GAP]
        return min(fits, key=lambda one: one.ahead(seq), default=None)

    def _begun(self, known: list[_Numbering], seq: int, sent_ns: int) -> _Numbering:
        """Begin a numbering; of one that is newer than all before it, the first ones are lost."""
        anew = known and all(sent_ns > one.newest_sent_ns for one in known)
        first = 0 if anew and seq <= _BEGINS_BELOW else seq
        known.append(_Numbering(first, sent_ns))
        del known[:-_NUMBERINGS]
        return known[-1]
