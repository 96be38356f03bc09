"""How much of a run is kept while it goes on: the newest hours, or so many bytes."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from foretwin.contracts.errors import UserError
from foretwin.contracts.segments import Roll

_UNITS = {"h": 1.0, "MB": 1e6, "GB": 1e9, "TB": 1e12}
LEAST_HOURS, LEAST_BYTES = 0.1, 50_000_000
_VIEW_BYTES = 32 * 2**20
_PARTS = 8
"""What is kept is cut into so many parts at least, since whole parts go."""


class Keep(NamedTuple):
    """The bound of a run's folder; one of the two, or none."""

    hours: float = math.inf
    total_bytes: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether anything ever goes."""
        return self != Keep()

    @property
    def recordings(self) -> Roll:
        """When a part of a recording ends."""
        usual = Roll()
        return Roll(
            most_bytes=round(min(usual.most_bytes, self.total_bytes / (4 * _PARTS))),
            most_s=min(usual.most_s, 3600.0 * self.hours / _PARTS),
        )

    @property
    def view(self) -> Roll:
        """When a part of what was shown ends: Rerun's index of a file grows as the file does."""
        of_recordings = self.recordings
        most_bytes = min(_VIEW_BYTES, of_recordings.most_bytes)
        return Roll(most_bytes=most_bytes, most_s=of_recordings.most_s)

    @property
    def tables(self) -> Roll:
        """When a part of a table of results ends: of an unbounded run only where it is large."""
        of_recordings = self.recordings
        if self.bounded:
            return of_recordings
        return Roll(most_bytes=4 * of_recordings.most_bytes, most_s=math.inf)


def parse_keep(text: str | None) -> Keep:
    """Return the bound that a text says, such as 12h or 20GB; raises UserError for another."""
    if text is None:
        return Keep()
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?(h|MB|GB|TB)", text)
    if found is None:
        raise UserError(f"--keep {text}: hours or a size, such as 12h, 500MB or 20GB")
    amount = float(found[1]) * _UNITS[found[2]]
    keep = Keep(hours=amount) if found[2] == "h" else Keep(total_bytes=amount)
    if keep.hours < LEAST_HOURS or keep.total_bytes < LEAST_BYTES:
        least = f"at least {LEAST_HOURS:g}h or {LEAST_BYTES / 1e6:g}MB"
        raise UserError(f"--keep {text}: {least}")
    return keep
