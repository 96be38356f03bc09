"""Figures of values without end, in memory with one: means, quantiles, and the first of many."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

EXACT = 4096
"""Quantiles of up to so many values are exact."""
ACCURACY = 0.01
"""Those of more are within this part of the value."""
MOST_LISTED = 1000
"""Entries of a list in run.json: the first ones; tables have all."""
OTHER_REASONS = "other reasons"
"""What all are called together that are not told one by one."""
_LEAST, _MOST = 1e-9, 1e12
_LOG = math.log((1.0 + ACCURACY) / (1.0 - ACCURACY))

Kept = TypeVar("Kept")


class RunningMeans:
    """The means of rows that are all equally long."""

    __slots__ = ("_sums", "count")

    def __init__(self, rows: Iterable[Sequence[float]] = ()) -> None:
        self.count = 0
        self._sums: tuple[float, ...] = ()
        for row in rows:
            self.take(row)

    def take(self, row: Sequence[float]) -> None:
        """Count a row."""
        self.count += 1
        sums = self._sums or (0.0,) * len(row)
        self._sums = tuple(map(float.__add__, sums, map(float, row)))

    @property
    def means(self) -> tuple[float, ...]:
        """The mean of each column; none of no row."""
        return tuple(total / self.count for total in self._sums)

    def __add__(self, other: RunningMeans) -> RunningMeans:
        both = RunningMeans()
        both.count = self.count + other.count
        pairs = zip(self._sums or other._sums, other._sums or self._sums, strict=True)
        both._sums = tuple(
            one + another if self.count and other.count else one for one, another in pairs
        )
        return both


class RunningQuantiles:
    """Quantiles of values from 0 on; the same values give the same, in whatever order.

    Beyond `EXACT` values they are counted in bins that grow with the value, as in DDSketch (Masson,
    Rim, Lee 2019: doi.org/10.14778/3352063.3352135).
    """

    __slots__ = ("_bins", "_values", "count")

    def __init__(self) -> None:
        self.count = 0
        self._values: list[float] | None = []
        self._bins: Counter[int] = Counter()

    def take(self, value: float) -> None:
        """Count a value; one below 0 or not a number counts as 0."""
        value = value if value > 0.0 else 0.0
        self.count += 1
        if self._values is None:
            self._bins[_bin(value)] += 1
            return
        self._values.append(value)
        if len(self._values) > EXACT:
            self._bins.update(map(_bin, self._values))
            self._values = None

    def percentile(self, q: float) -> float | None:
        """Return the q-th percentile, None of nothing."""
        if not self.count:
            return None
        if self._values is not None:
            return float(np.percentile(self._values, q))
        places = sorted(self._bins)
        up_to = np.cumsum([self._bins[place] for place in places])
        rank = q / 100.0 * (self.count - 1)
        return _middle(places[int(np.searchsorted(up_to, rank, side="right"))])


class FirstOf(list[Kept]):
    """The first so many of what is appended; the rest are counted."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self.left_out = 0

    def append(self, one: Kept) -> None:
        """Keep one where there is room."""
        if len(self) < self._most:
            super().append(one)
        else:
            self.left_out += 1

    def extend(self, many: Iterable[Kept]) -> None:
        """Keep those for which there is room."""
        for one in many:
            self.append(one)

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle would append before it says how many there may be.
        return _first_of, (self._most, list(self), self.left_out)


def _first_of(most: int, kept: list[Kept], left_out: int) -> FirstOf[Kept]:
    first = FirstOf[Kept](most)
    first.extend(kept)
    first.left_out = left_out
    return first


def _bin(value: float) -> int:
    """Return the bin of a value: 0 for none, then each a little wider than the one before."""
    if value < _LEAST:
        return 0
    return 1 + math.ceil(math.log(min(value, _MOST) / _LEAST) / _LOG)


def _middle(place: int) -> float:
    """Return the value that is as far from one end of a bin as from the other, relatively."""
    if place == 0:
        return 0.0
    return _LEAST * math.exp((place - 1) * _LOG) * (1.0 - ACCURACY)


def with_others(told: Mapping[str, int], total: int) -> dict[str, int]:
    """Return counts by the reason with one of all other reasons, where there are any of `total`."""
    more = total - sum(told.values())
    return {**told, OTHER_REASONS: more} if more else dict(told)
