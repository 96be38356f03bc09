"""Values of a report by where they came from, and what they add up to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import msgspec

from foretwin.contracts.provenance import PROVENANCES, Provenance

SOURCE_CONFIDENCE: Mapping[Provenance, float] = {"tagged": 1.0, "inferred": 0.7, "default": 0.3}
"""What a value is worth by where it came from: a convention to compare junctions by.

What the map says outright counts in full. What follows from other tags is usually right, and a
default is right where a place is ordinary; the two figures say no more than that.
"""
_GUESSED: tuple[Provenance, ...] = PROVENANCES[:0:-1]
"""From the least known on."""
SUBJECT_WEIGHT: Mapping[str, float] = {
    "kind": 2.0,
    "lane counts": 3.0,
    "lane widths": 1.0,
    "turns": 2.0,
    "directions": 2.0,
    "speed limits": 1.0,
    "control": 3.0,
    "signals": 2.0,
    "right of way": 3.0,
    "crossings": 1.0,
    "building heights": 1.0,
}
"""How much a subject counts in a junction: most, what would hurt a driver if it were wrong."""


class SubjectReport(msgspec.Struct, frozen=True, kw_only=True):
    """How many values of one subject came from where, and in words those that were guessed.

    `confidence` is the mean of `SOURCE_CONFIDENCE` over the values; None where there are none.
    """

    subject: str
    tagged: int
    inferred: int
    default: int
    driven: int | msgspec.UnsetType = msgspec.UNSET
    """How many were learnt from the car's own passes, where some were; they count in full."""
    confidence: float | None
    guessed: tuple[str, ...]
    """One sentence for each road and value that the map does not say outright."""


class Value(msgspec.Struct, frozen=True):
    """One value of a subject: of which road, what it is, where it came from."""

    of: str
    words: str
    source: Provenance


def subject_report(subject: str, values: Sequence[Value]) -> SubjectReport:
    """Count values by source, and put those that were guessed into sentences."""
    count = Counter(value.source for value in values)
    worth = sum(SOURCE_CONFIDENCE.get(source, 1.0) * n for source, n in count.items())
    alike = Counter((v.of, v.words, v.source) for v in values if v.source in _GUESSED)
    order = sorted(alike, key=lambda key: (_GUESSED.index(key[2]), *key[:2]))
    return SubjectReport(
        subject=subject,
        **{source: count[source] for source in PROVENANCES},
        driven=count["driven"] or msgspec.UNSET,
        confidence=round(worth / len(values), 2) if values else None,
        guessed=tuple(
            f"{of}: {words}, {source}" + (f" ({n} times)" if n > 1 else "")
            for (of, words, source), n in ((key, alike[key]) for key in order)
        ),
    )
