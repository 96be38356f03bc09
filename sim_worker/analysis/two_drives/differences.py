"""How two drives differ where both went: beside each other, in speed, time and acceleration.

A pure function of two lines. Differences are the second drive minus the first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.sim_worker.analysis.two_drives.common_stretches import (
    LEAST_M,
    CommonStretch,
    common_ways,
    metres,
    seen,
)
from foretwin.sim_worker.analysis.two_drives.drive_line import STEP_M, DriveLine

UNITS = MappingProxyType(
    {"lateral_m": "m", "speed_mps": "m/s", "time_per_100m_s": "s", "accel_mps2": "m/s²"}
)
"""What is compared place by place. Lateral is to the left of the first drive; time is what 100 m
took, standing still included."""
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
HORIZONS_S = (1.0, 2.0, 4.0, 8.0)
"""As of the gap between car and model."""
LIKE_SPEED_MPS = 0.5
"""What comes after a place is compared from places that both passed at like speed: a model, too,
begins at the car's."""
SPEEDS_UP_MPS2 = 3.0
"""Hardly anybody speeds up by more for seconds. Chosen."""
_OVER_M = 100.0
_EVERY_S = 1.0


class Spread(NamedTuple):
    """Quantiles of differences as of `QUANTILES`, their RMS, the 95th percentile of their size, and
    of how many places they are."""

    quantiles: tuple[float, ...]
    rms: float
    size_p95: float
    places: int


class StretchDifference(NamedTuple):
    """Differences at K places of one stretch: arc lengths and times of both drives there, and
    `values` (K,) by name, NaN where one cannot be told."""

    stretch: CommonStretch
    xy_m: Array
    a_m: Array
    b_m: Array
    a_s: Array
    b_s: Array
    values: Mapping[str, Array]


class AfterDifference(NamedTuple):
    """How far two drives that passed a place at like speed are apart some seconds later.

    `left_out` such places lie so near the end of their stretch that a car might be beyond it by
    then: whether one is says which of them was faster, so it is not asked.
    """

    horizon_s: float
    along: Spread
    across: Spread
    speed: Spread
    left_out: int


class DriveDifference(NamedTuple):
    """Two drives of one road against each other; metres count each place of a drive once."""

    a_m: float
    b_m: float
    common_a_m: float
    common_b_m: float
    opposite_m: float
    """Of the second drive, what the first drove the other way round alone."""
    stretches: tuple[StretchDifference, ...]
    spreads: Mapping[str, Spread]
    after: tuple[AfterDifference, ...]
    std_m: tuple[float | None, float | None]


def difference_of_drives(
    a: DriveLine, b: DriveLine, *, same_drive: bool = False
) -> DriveDifference | None:
    """Compare two drives, or passages of the `same_drive`; None where nothing is common."""
    found = common_ways(a, b, same_drive=same_drive)
    if not found.stretches:
        return None
    stretches = tuple(_at_places(a, b, stretch) for stretch in found.stretches)
    on_a = seen(tuple(one.rows_a for one in found.stretches), len(a.arc_m))
    on_b = seen(tuple(one.rows_b for one in found.stretches), len(b.arc_m))
    both_a, both_b = (on_a | on_b, on_a | on_b) if same_drive else (on_a, on_b)
    pooled = {name: np.concatenate([one.values[name] for one in stretches]) for name in UNITS}
    return DriveDifference(
        a_m=a.length_m,
        b_m=b.length_m,
        common_a_m=min(metres(both_a), a.length_m),
        common_b_m=min(metres(both_b), b.length_m),
        opposite_m=metres(_long(found.opposite_b & ~both_b)),
        stretches=stretches,
        spreads={name: spread(values) for name, values in pooled.items()},
        after=tuple(_after(a, b, stretches)),
        std_m=(a.std_m, b.std_m),
    )


def spread(values: Array) -> Spread:
    """Return the spread of differences; NaN are left out, and of none all is NaN."""
    known = values[np.isfinite(values)]
    if not len(known):
        return Spread((np.nan,) * len(QUANTILES), np.nan, np.nan, 0)
    quantiles = np.quantile(known, QUANTILES).tolist()
    rms = float(np.sqrt(np.mean(np.square(known))))
    return Spread(tuple(quantiles), rms, float(np.quantile(np.abs(known), 0.95)), len(known))


def _long(flags: Flags) -> Flags:
    """Return those of `flags` (N,) that stand in runs of `LEAST_M` and more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    kept = np.zeros_like(flags)
    for begin, end in edges.reshape(-1, 2).tolist():
        kept[begin:end] = (end - begin) * STEP_M >= LEAST_M
    return kept


def _at_places(a: DriveLine, b: DriveLine, stretch: CommonStretch) -> StretchDifference:
    rows_a, rows_b = stretch.rows_a, stretch.rows_b
    away, along = b.xy_m[rows_b] - a.xy_m[rows_a], a.along[rows_a]
    b_m = b.arc_m[rows_b]
    a_m = np.maximum.accumulate(a.arc_m[rows_a] + (away * along).sum(axis=1))
    a_s, b_s = a.at_m(a.time_s, a_m), b.time_s[rows_b]
    lost_s = b_s - a_s
    values = {
        "lateral_m": along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0],
        "speed_mps": b.speed_mps[rows_b] - a.at_m(a.speed_mps, a_m),
        "time_per_100m_s": _over(a_m, lost_s),
        "accel_mps2": b.accel_mps2[rows_b] - a.at_m(a.accel_mps2, a_m),
    }
    return StretchDifference(stretch, b.xy_m[rows_b], a_m, b_m, a_s, b_s, values)


def _over(a_m: Array, lost_s: Array) -> Array:
    """Return what is lost over the next 100 m at each place, NaN where the stretch ends before."""
    later = np.interp(a_m + _OVER_M, a_m, lost_s)
    return np.where(a_m + _OVER_M <= a_m[-1], later - lost_s, np.nan)


def _after(
    a: DriveLine, b: DriveLine, stretches: Sequence[StretchDifference]
) -> list[AfterDifference]:
    fastest_mps = max(
        float(max(b.speed_mps[one.stretch.rows_b].max(), a.at_m(a.speed_mps, one.a_m).max()))
        for one in stretches
    )
    starts = [_at_like_speed(one) for one in stretches]
    found = []
    for horizon_s in HORIZONS_S:
        kept = [
            at[_stays(b, one, at, horizon_s, fastest_mps=fastest_mps)]
            for one, at in zip(stretches, starts, strict=True)
        ]
        parts = [_apart(a, b, one, at, horizon_s) for one, at in zip(stretches, kept, strict=True)]
        along, across, speed = (np.concatenate(column) for column in zip(*parts, strict=True))
        left_out = sum(map(len, starts)) - len(along)
        found.append(
            AfterDifference(horizon_s, spread(along), spread(across), spread(speed), left_out)
        )
    return found


def _at_like_speed(one: StretchDifference) -> Indices:
    """Return the places of a stretch, once a second, that both passed at like speed."""
    at = np.unique(np.searchsorted(one.a_s, np.arange(one.a_s[0], one.a_s[-1], _EVERY_S)))
    return np.asarray(at[np.abs(one.values["speed_mps"][at]) <= LIKE_SPEED_MPS])


def _stays(
    b: DriveLine, one: StretchDifference, at: Indices, horizon_s: float, *, fastest_mps: float
) -> Flags:
    """Return at which places no car can leave the stretch within `horizon_s`.

    It is asked of what is known at the place alone: a car that speeds up at once from the faster
    of both speeds, up to the fastest that either drove anywhere in common.
    """
    b_mps = b.speed_mps[one.stretch.rows_b[at]]
    begins_mps = np.maximum(b_mps, b_mps - one.values["speed_mps"][at])
    speeding_s = np.minimum((fastest_mps - begins_mps) / SPEEDS_UP_MPS2, horizon_s)
    gained_m = SPEEDS_UP_MPS2 * speeding_s * (horizon_s - 0.5 * speeding_s)
    left_m = np.minimum(one.a_m[-1] - one.a_m[at], one.b_m[-1] - one.b_m[at])
    return np.asarray(begins_mps * horizon_s + gained_m <= left_m)


def _apart(
    a: DriveLine, b: DriveLine, one: StretchDifference, at: Indices, horizon_s: float
) -> tuple[Array, Array, Array]:
    """Return how far both are apart `horizon_s` after places: along, across and in speed."""
    then_a_m, then_b_m = a.come_m(one.a_s[at] + horizon_s), b.come_m(one.b_s[at] + horizon_s)
    along = (then_b_m - one.b_m[at]) - (then_a_m - one.a_m[at])
    lateral = one.values["lateral_m"]
    across = np.interp(then_a_m, one.a_m, lateral) - lateral[at]
    speed = b.at_m(b.speed_mps, then_b_m) - a.at_m(a.speed_mps, then_a_m)
    return along, across, speed
