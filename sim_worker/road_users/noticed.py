"""What drivers know of what is ahead: what they saw when they last reacted, carried on.

After the human driver model (Treiber, Kesting, Helbing 2006, Delays, inaccuracies and anticipation
in microscopic traffic models, Physica A 360): a driver sees late, but expects whoever is ahead to
keep the speed. So steady following is as without delay; what changes is noticed late.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices

_FIELDS = 3
_LONGEST_S = 3.0
"""Nobody is remembered to have seen anything longer ago."""


class Noticed:
    """What K road users, each in one of S futures, saw at their last decisions.

    `reaction_s` (K,) is how late they do, `rows` (K,) and `columns` (K,) are who they are. Who has
    just come to be has known for long what it sees.
    """

    def __init__(self, reaction_s: Array, rows: Indices, columns: Indices) -> None:
        self._reaction_s, self._rows, self._columns = reaction_s, rows, columns
        self._number = np.arange(len(rows))
        self._seen = np.zeros((0, _FIELDS, len(rows)))
        self._late, self._known = np.zeros((2, len(rows)), dtype=np.intp)
        self._count, self._every_s = 0, 0.0

    def after(self, ahead: Array, *, every_s: float) -> Array:
        """Return (3, K) what they know, given what is there now (3, K).

        Both are the arc length of what is ahead, its speed, and the gap wanted before it at rest;
        `every_s` passes between two calls.
        """
        if not len(self._seen):
            self._late = np.rint(self._reaction_s / every_s).astype(np.intp)
            self._every_s = every_s
            self._seen = np.zeros((round(_LONGEST_S / every_s) + 1, *ahead.shape))
        depth = len(self._seen)
        self._seen[self._count % depth] = ahead
        late = np.minimum(self._late, np.minimum(self._known, depth - 1))
        place = (self._count - late) % depth * ahead.size + self._number
        found = np.stack([self._seen.take(place + n * len(late)) for n in range(_FIELDS)])
        self._count += 1
        self._known += 1
        found[0] += found[1] * (late * every_s)
        return found

    def carry_on(self, before: Noticed, futures: Flags) -> None:
        """Let those of the `futures` (S,) know what they knew before; the others begin anew."""
        self.take_over(before, self.same_as(before, futures))

    def take_over(self, before: Noticed, same: Indices, shift_m: Array | float = 0.0) -> None:
        """Let those in places `same` (2, N) here and there know what they knew before, where arc
        lengths of their paths are `shift_m` (N,) more; the others begin anew."""
        if not len(before._seen):
            return
        to, of = same
        self._seen = np.zeros((*before._seen.shape[:2], len(self._number)))
        self._seen[:, :, to], self._known[to] = before._seen[:, :, of], before._known[of]
        self._seen[:, 0, to] += shift_m
        self._count, self._every_s = before._count, before._every_s
        self._late = np.rint(self._reaction_s / self._every_s).astype(np.intp)

    def same_as(self, before: Noticed, futures: Flags) -> Indices:
        """Return (2, N) places here and there of those of the `futures` (S,) who are the same."""
        mine, theirs = ({who: k for k, who in enumerate(one._who())} for one in (self, before))
        pairs = [(k, theirs[who]) for who, k in mine.items() if who in theirs and futures[who[0]]]
        return np.array(pairs, dtype=np.intp).reshape(-1, 2).T

    def _who(self) -> list[tuple[int, int]]:
        return list(zip(self._rows.tolist(), self._columns.tolist(), strict=True))
