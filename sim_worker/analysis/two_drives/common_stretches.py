"""Where two drives went along the same road, place by place, however often each did."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Flags, Indices
from foretwin.sim_worker.analysis.two_drives.drive_line import STEP_M, DriveLine

NEAR_M = 8.0
"""So far beside each other two lanes of one direction lie, and a little more. Chosen."""
LEAST_M = 30.0
"""A shorter stretch is where roads cross, or come near each other. Chosen."""
AGAIN_S = 30.0
"""A drive is compared with itself where it came again after this."""
_ALIKE = 0.8
"""Cosine between two drives of one way: 37°."""
_LOST_M = 15
"""Places in a row that may be missing from a stretch."""
_SLIP_M = 6
"""How much longer one way may be than the other from one place to the next that both have."""
_MOST_NEAR_M = 25.0


class CommonStretch(NamedTuple):
    """K places that two drives passed the same way round: rows of one and of the other, both
    rising."""

    rows_a: Indices
    rows_b: Indices

    @property
    def length_m(self) -> float:
        """Metres from the first place to the last, on the first drive's way."""
        return float(STEP_M * (self.rows_a[-1] - self.rows_a[0]))


class CommonWays(NamedTuple):
    """All stretches that two drives have in common, and which places of the second one the first
    drove the other way round, (N,)."""

    stretches: tuple[CommonStretch, ...]
    opposite_b: Flags


def common_ways(a: DriveLine, b: DriveLine, *, same_drive: bool = False) -> CommonWays:
    """Return where `b` went along `a`'s way; of the `same_drive` where it came again later."""
    near_m = min(NEAR_M + 2.0 * float(np.hypot(a.std_m or 0.0, b.std_m or 0.0)), _MOST_NEAR_M)
    rows_b, rows_a = _near(a, b, near_m)
    if same_drive:
        later = b.time_s[rows_b] - a.time_s[rows_a] > AGAIN_S
        rows_b, rows_a = rows_b[later], rows_a[later]
    same_way = (a.along[rows_a] * b.along[rows_b]).sum(axis=1)
    alike = same_way > _ALIKE
    picked = _nearest_of_passages(a, b, rows_a[alike], rows_b[alike])
    stretches = tuple(_stretches(a, b, *picked))
    opposite = np.zeros(len(b.arc_m), dtype=bool)
    opposite[rows_b[same_way < -_ALIKE]] = True
    return CommonWays(stretches, opposite)


def _near(a: DriveLine, b: DriveLine, near_m: float) -> tuple[Indices, Indices]:
    """Return all pairs of places that lie near each other, (P,) of `b` and of `a`, in order."""
    pairs = cKDTree(b.xy_m).sparse_distance_matrix(cKDTree(a.xy_m), near_m, output_type="ndarray")
    order = np.lexsort([pairs["j"], pairs["i"]])
    return pairs["i"][order], pairs["j"][order]


def _nearest_of_passages(
    a: DriveLine, b: DriveLine, rows_a: Indices, rows_b: Indices
) -> tuple[Indices, Indices]:
    """Return of each place of `b`, and each time that `a` passed it, the nearest place of `a`."""
    if not len(rows_a):
        return rows_a, rows_b
    new = (np.diff(rows_b) > 0) | (np.diff(rows_a) > _LOST_M)
    passage = np.concatenate([[0], np.cumsum(new)])
    away = b.xy_m[rows_b] - a.xy_m[rows_a]
    ahead_m = np.abs((away * a.along[rows_a]).sum(axis=1))
    order = np.lexsort([np.hypot(*away.T), passage])
    _, first = np.unique(passage[order], return_index=True)
    rows = order[first]
    abreast = ahead_m[rows] <= STEP_M  # else the first drive begins or ends beside it
    return rows_a[rows[abreast]], rows_b[rows[abreast]]


def _stretches(
    a: DriveLine, b: DriveLine, rows_a: Indices, rows_b: Indices
) -> Iterator[CommonStretch]:
    """Yield runs of pairs in which both drives go on together."""
    open_: list[list[tuple[int, int]]] = []
    for row_a, row_b in zip(rows_a.tolist(), rows_b.tolist(), strict=True):
        best, least = None, _SLIP_M + 1
        for run in open_:
            step_a, step_b = row_a - run[-1][0], row_b - run[-1][1]
            slip = abs(step_a - step_b)
            if 0 < step_b <= _LOST_M and 0 <= step_a <= _LOST_M + _SLIP_M and slip < least:
                best, least = run, slip
        if best is None:
            open_.append([(row_a, row_b)])
        else:
            best.append((row_a, row_b))
        for run in [run for run in open_ if row_b - run[-1][1] > _LOST_M]:
            open_.remove(run)
            yield from _whole(a, b, run)
    for run in open_:
        yield from _whole(a, b, run)


def _whole(a: DriveLine, b: DriveLine, run: list[tuple[int, int]]) -> Iterator[CommonStretch]:
    """Yield the parts of a run without holes in either drive, where they are long enough."""
    rows_a, rows_b = np.array(run).T
    parts = np.cumsum((np.diff(a.piece[rows_a]) != 0) | (np.diff(b.piece[rows_b]) != 0))
    part = np.concatenate([[0], parts])
    for number in np.unique(part):
        mine = part == number
        found = CommonStretch(rows_a[mine], rows_b[mine])
        if found.length_m >= LEAST_M:
            yield found


def seen(rows: tuple[Indices, ...], count: int) -> Flags:
    """Return which of `count` places lie on one of the stretches with these rows."""
    flags = np.zeros(count, dtype=bool)
    for mine in rows:
        flags[mine[0] : mine[-1] + 1] = True
    return flags


def metres(flags: Flags) -> float:
    """Return how many metres so many places are."""
    return float(STEP_M * np.count_nonzero(flags))
