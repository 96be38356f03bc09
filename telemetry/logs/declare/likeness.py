"""How a column is like a signal of the motion: by what size, how late, and whether by chance."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.geometry.shifted_fit import shifted_fit
from foretwin.telemetry.logs.declare.motion import GRID_S, GridMotion

_LATEST_S = 1.2
"""A column is sought so late, or early: telephones and adapters send up to 0.6 s late."""
_STEP = 2
_LEAST_VARIANCE = 1e-18
"""A column that changes by less is constant."""
SURE = 25.0
"""Square of five standard deviations: by chance once in a million columns."""
_MUCH, _LITTLE, _RULED_OUT = 0.3, 0.2, 16.0
"""Another reading leaves so much more unexplained; or less, and four deviations beyond noise. By
less than a fifth a gyro of a town's drive passes for steering (Potsdamer Platz: 0.17)."""
_LEVER_M, _LEVER_STD_M = 0.8, 3.0
"""Receivers sit so far ahead of the rear axle, give or take: the drive tells it, within a car."""
_LEVER_DOUBT_M = 0.3
"""What of that stays, at the usual speed: the smoothing of positions does not know of it."""
LEAST_LATE_S = 0.05
"""Less is not worth correcting: a tick of the grid."""


class Likeness(NamedTuple):
    """A column as `sizes` of reference signals, `late_s` later; what of its variance is left."""

    sizes: Array
    left: float
    """Share of the variance that stays, 0 to 1."""
    chance: float
    """Square of the standard deviations by which the first signal is in it."""
    late_s: float
    together: float
    """Seconds that were compared."""
    independent: float
    """How many samples of them count anew."""

    @property
    def size_doubt(self) -> float:
        """The first size's standard deviation as a share, by what is left of the column."""
        return math.sqrt(self.left / max((1.0 - self.left) * self.independent, 1e-9))

    def plainer_than(self, other: Likeness) -> bool:
        """Tell whether another reading of the same column can be ruled out against this one."""
        more = other.left / max(self.left, 1e-9) - 1.0
        return more > _MUCH or (more > _LITTLE and more * self.independent > _RULED_OUT)


def likeness(column: Array, signals: Array) -> Likeness | None:
    """Fit a column (G,) on the grid by signals (G, K) and a level, at the best lateness.

    None where there is too little of both to say anything.
    """
    most = round(_LATEST_S / GRID_S)
    every = max(len(column) // 3000, 2)
    inner = np.arange(most, len(column) - most, every)
    design = np.column_stack([signals[inner], np.ones(len(inner))])
    known = np.asarray(np.isfinite(design).all(axis=1))
    lates = np.arange(-most, most + 1, _STEP)
    # Later in the column: what the motion did before.
    by_late = column[inner[:, None] + lates]
    used = np.isfinite(by_late) & known[:, None]
    enough = used.sum(axis=0) * every * GRID_S >= 8.0
    if not enough.any():
        return None
    share = _left(by_late, np.where(known[:, None], design, 0.0), used)
    at = int(np.argmin(np.where(enough, share, np.inf)))
    late = int(lates[at])
    rows, wanted = design[used[:, at]], by_late[used[:, at], at]
    total = float(np.var(wanted))
    if total <= _LEAST_VARIANCE:
        return None
    sizes, *_ = np.linalg.lstsq(rows, wanted, rcond=None)
    left = float(np.mean((wanted - rows @ sizes) ** 2)) / total
    without, *_ = np.linalg.lstsq(rows[:, 1:], wanted, rcond=None)
    alone = float(np.mean((wanted - rows[:, 1:] @ without) ** 2)) / total
    together = float(len(wanted) * every * GRID_S)
    # What it leaves errs alike for so long: only what is farther apart counts anew.
    alike_s = _lasts(by_late[:, at] - design @ sizes) * every * GRID_S
    independent = together / max(2.0 * alike_s, 1.0)
    chance = (alone - left) / max(left, 1e-12) * max(independent - len(sizes), 0.0)
    return Likeness(sizes, left, chance, late * GRID_S, together, independent)


def _left(by_late: Array, design: Array, used: Flags) -> Array:
    """Return the share (L,) of the variance of each of (N, L) that a design (N, K) leaves in it.

    By the normal equations, which are the same sums for all: where a column has no variance the
    share is infinite. The design's last column is a level.
    """
    weight = used.astype(np.float64)
    count = np.maximum(weight.sum(axis=0), 1.0)
    y = np.where(used, by_late, 0.0)
    y = np.where(used, y - y.sum(axis=0) / count, 0.0)
    scale = np.std(design, axis=0)
    even = (design - design.mean(axis=0)) / np.where(scale > 0.0, scale, 1.0)
    even[:, -1] = 1.0
    products = (even[:, :, None] * even[:, None, :]).reshape(len(even), -1)
    normal = (weight.T @ products).reshape(len(count), even.shape[1], even.shape[1])
    onto = y.T @ even
    sizes = (np.linalg.pinv(normal, hermitian=True) @ onto[:, :, None])[:, :, 0]
    total = np.einsum("nl,nl->l", y, y)
    share = (total - np.einsum("lk,lk->l", onto, sizes)) / np.maximum(total, 1e-300)
    return np.where(total <= _LEAST_VARIANCE * count, np.inf, share)


def _lasts(values: Array) -> int:
    """Return for how many samples a signal stays like itself: its correlation falls to a third."""
    around = np.nan_to_num(values - np.nanmean(values))
    power = float(around @ around)
    for lag in range(1, len(around) // 4):
        if float(around[lag:] @ around[:-lag]) < power / 3.0:
            return lag
    return max(len(around) // 4, 1)


class Lateness(NamedTuple):
    """A column is stamped `late_s` later than positions, with a standard deviation: infinite where
    nothing tells it. `or_more` says that it is as late as is tried, or later."""

    late_s: float
    std_s: float
    or_more: bool = False

    @property
    def sure(self) -> bool:
        """Whether it is there, and large enough to matter."""
        return abs(self.late_s) > max(3.0 * self.std_s, LEAST_LATE_S)


def lateness(
    motion: GridMotion, column: Array, signals: Array, *, size: float, lever: Array | None = None
) -> Lateness | None:
    """Return by how much a column follows signals (G, K) late; None where nothing tells it.

    A receiver ahead of the rear axle turns before the car does, which looks like lateness: `lever`
    (G,) is what a metre of that adds to the signal, `size` the first signal's in the column.
    """
    columns, around, prior = [*signals.T], [0.0] * signals.shape[1], [np.inf] * signals.shape[1]
    if lever is not None:
        columns.append(lever)
        around.append(-_LEVER_M * size)
        prior.append(_LEVER_STD_M * abs(size))
    found = []
    for over_s in (0.4, 0.8):
        apart = max(round(over_s / GRID_S), motion.half)
        rows = np.column_stack([_change(signal, apart) for signal in columns])
        if not np.isfinite(rows).all(axis=1).any():
            return None
        fit = shifted_fit(
            _change(column, apart),
            rows,
            period_s=GRID_S,
            around=np.array(around),
            prior_std=np.array(prior),
            longest_s=_LATEST_S,
        )
        if fit is None:
            return None
        found.append((fit.shift_std_s, fit.shift_s, fit.at_the_end))
    std_s, late_s, or_more = min(found)
    apart_s = max(abs(late_s - other) for _, other, _ in found)
    doubts_s = [std_s, 0.5 * apart_s, GRID_S / np.sqrt(12.0)]
    if lever is not None:
        doubts_s.append(_LEVER_DOUBT_M / float(np.nanmedian(motion.speed_mps[motion.moves])))
    return Lateness(late_s, float(np.linalg.norm(doubts_s)), or_more)


def _change(values: Array, apart: int) -> Array:
    out = np.full(len(values), np.nan)
    if len(values) > apart:
        out[apart // 2 : apart // 2 + len(values) - apart] = values[apart:] - values[:-apart]
    return out
