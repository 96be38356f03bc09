"""By how much the clocks of two recordings of one drive differ, by what both tell of its motion.

Turning and speed are laid over each other at every offset, then fitted to a part of a tick, as
lateness is within one recording (foretwin.geometry.shifted_fit), and in stretches for the drift.
What a sensor is late by is in the offset: data cannot tell the two apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.signal import fftconvolve

from foretwin.contracts import drive
from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.geometry.shifted_fit import shifted_fit
from foretwin.telemetry.logs.clock_evenness import (
    MOST_DRIFT_PPM,
    drift_ppm_of,
    leap_of,
    stretches_of,
    unevenness_s,
)
from foretwin.telemetry.logs.declare.motion import GRID_S, motion_of, smoothed
from foretwin.telemetry.logs.log import Log, LogError

_LEAST_TOGETHER_S = 40.0
"""So long both must have seen the drive."""
_LEAST_LIKE, _PLAINLY, _ELSEWHERE_S = 0.6, 1.4, 5.0
"""Correlation at the offset; and how many times as much any other one leaves unexplained."""
_LEAST_UNLIKE = 0.02
"""Two recordings are never more alike than that: what would be is a drive that repeats itself."""
_MOST_STD_S = 0.1
_SURE = 3.0
_HALF = round(0.5 / GRID_S)
"""Ticks on either side over which a sensor is smoothed."""
_LEVER_S = 0.15
"""What a metre between receiver and rear axle looks like at 7 m/s, where turning is that of
positions."""


class MotionSignal(NamedTuple):
    """What a recording says of its motion, (G,) from its start; NaN where it is silent."""

    values: Array
    by: str


class ClockBetween(NamedTuple):
    """The second recording's stamps say `offset_s` more than the first's, `at_s` into the first.

    `drift_ppm` is what that grows by, 0 where it is not plain. `like` is the correlation, `by` what
    was compared, `together_s` for how long.
    """

    offset_s: float
    std_s: float
    drift_ppm: float
    drift_std_ppm: float
    at_s: float
    like: float
    by: str
    together_s: float

    def first_from_second(self, start_ns: int) -> Callable[[int], int]:
        """Return what turns the second's stamps into the first's, which starts at `start_ns`."""
        offset_ns, middle_ns = round(self.offset_s * 1e9), start_ns + round(self.at_s * 1e9)
        drift = self.drift_ppm * 1e-6

        def stamp_ns(theirs_ns: int) -> int:
            ours_ns = theirs_ns - offset_ns
            return ours_ns - round((ours_ns - middle_ns) * drift)

        return stamp_ns

    def said(self, second: str, first: str) -> str:
        """Return in a line what was found."""
        drift = f"drift {self.drift_ppm:+z.1f} ± {self.drift_std_ppm:.1f} ppm"
        if self.drift_ppm == 0.0:
            drift = "no drift that can be told"
            if math.isfinite(self.drift_std_ppm):
                drift += f" (± {self.drift_std_ppm:.1f} ppm)"
        return (
            f"{second}: its clock says {self.offset_s:.3f} s more than {first}'s,"
            f" ± {self.std_s:.3f} s, {drift}; by {self.by},"
            f" {self.together_s:.0f} s together, r = {self.like:.3f}"
        )


def clock_between(first: Log, second: Log) -> ClockBetween:
    """Return how the second recording's clock differs from the first's.

    Raises LogError where the drives have too little in common to tell, and says what is missing.
    """
    ours, theirs = signals_of(first), signals_of(second)
    common = [name for name in ours if name in theirs]
    if not common:
        raise LogError(
            f"{second.info.source}: nothing to compare clocks by: {first.info.source} tells"
            f" {', '.join(ours) or 'no motion'}, it tells {', '.join(theirs) or 'no motion'}"
        )
    late, like, together_s = _coarse(
        first, second, [(ours[n].values, theirs[n].values) for n in common]
    )
    found = []
    for name in common:
        x = ours[name].values
        y = _at_ticks_of(x, theirs[name].values, late)
        fit = _fitted(y, x)
        if fit is not None:
            roughly = (
                _LEVER_S
                if name == "turning" and "positions" in (ours[name].by, theirs[name].by)
                else 0.0
            )
            said = f"{name} ({ours[name].by} against {theirs[name].by})"
            found.append((math.hypot(fit[1], roughly), fit[0], said, x, y))
    if not found:
        raise LogError(f"{second.info.source}: the drives share too little turning and braking")
    std_s, shift_s, by, x, y = min(found, key=lambda row: row[0])
    if std_s > _MOST_STD_S:
        raise LogError(
            f"{second.info.source}: its clock cannot be told better than {std_s:.2f} s by {by};"
            " drives that turn and brake more would tell it"
        )
    middle_s = float(np.mean(np.flatnonzero(np.isfinite(x) & np.isfinite(y)))) * GRID_S
    stretches = stretches_of(y, x, _fitted)
    drift, drift_std = drift_ppm_of(stretches)
    if (leap := leap_of(stretches)) is not None:
        raise LogError(
            f"{second.info.source}: its clock leaps by {leap.by_s:+z.2f} s beside"
            f" {first.info.source}'s between {leap.before_s:.0f} and {leap.after_s:.0f} s into"
            " that; cut it there"
        )
    base_s = (second.info.start_stamp_ns - first.info.start_stamp_ns) * 1e-9
    drift = drift if abs(drift) > _SURE * drift_std else 0.0
    if abs(drift) > MOST_DRIFT_PPM:
        raise LogError(
            f"{second.info.source}: its clock drifts by {drift:+z.0f} ppm beside"
            f" {first.info.source}'s, and no clock does by more than {MOST_DRIFT_PPM:.0f}: it leaps"
            " somewhere"
        )
    std_s = math.hypot(std_s, unevenness_s(stretches, drift))
    if std_s > _MOST_STD_S:
        sure = np.hypot(stretches[1:, 2], stretches[:-1, 2])
        where = int(np.argmax(np.abs(np.diff(stretches[:, 1])) / sure))
        (before_s, one_s, _), (after_s, other_s, _) = stretches[where : where + 2]
        raise LogError(
            f"{second.info.source}: its clock does not run evenly beside {first.info.source}'s: it"
            f" changes by {other_s - one_s:+z.2f} s between {before_s:.0f} and {after_s:.0f} s into"
            " that; if it jumps, cut it there"
        )
    return ClockBetween(
        base_s + late * GRID_S + shift_s, std_s, drift, drift_std, middle_s, like, by, together_s
    )


def signals_of(log: Log) -> dict[str, MotionSignal]:
    """Return turning in rad/s and speed in m/s, each by the best sensor for times that there is."""
    rows: dict[str, list[tuple[float, float]]] = {}
    places: list[tuple[float, float, float]] = []
    for _, message in log.samples():
        time_s = (message.stamp_ns - log.info.start_stamp_ns) * 1e-9  # type: ignore[attr-defined]
        match message:
            case drive.ImuSample(rate_radps=rate):
                rows.setdefault("gyro", []).append((time_s, rate[2]))
            case drive.HeadingSample(yaw_rate_radps=float(rate)):
                rows.setdefault("yaw rate", []).append((time_s, rate))
            case drive.SpeedSample(speed_mps=speed):
                rows.setdefault("wheels", []).append((time_s, speed))
            case drive.GnssFix(position=place):
                places.append((time_s, place.lat_deg, place.lon_deg))
    last_s = max(
        [row[-1][0] for row in rows.values()] + [row[0] for row in places[-1:]], default=0.0
    )
    grid = np.arange(0.0, last_s, GRID_S)
    found: dict[str, MotionSignal] = {}
    for name, by in (("turning", "gyro"), ("turning", "yaw rate"), ("speed", "wheels")):
        if name not in found and by in rows:
            time_s, values = np.array(rows[by]).T
            found[name] = MotionSignal(smoothed(time_s, values, grid, half=_HALF), by)
    if len(places) > 20 and len(found) < 2:
        time_s, lat, lon = np.array(places).T
        frame = LocalFrame(GeoPoint(float(np.median(lat)), float(np.median(lon))))
        motion = motion_of(time_s, local_from_geo(frame, lat, lon), whole=True)
        if motion is not None:
            for name, values in (("turning", motion.turn_radps), ("speed", motion.speed_mps)):
                if name not in found:
                    level = np.interp(grid, motion.time_s, np.nan_to_num(values))
                    known = np.interp(grid, motion.time_s, np.isfinite(values).astype(float)) > 0.99
                    found[name] = MotionSignal(np.where(known, level, np.nan), "positions")
    return found


def _coarse(first: Log, second: Log, pairs: list[tuple[Array, Array]]) -> tuple[int, float, float]:
    """Return the offset in ticks at which all pairs agree best, their correlation, and how long."""
    every = max(round(0.2 / GRID_S), 1)
    rows = [_likeness(x[::every], y[::every]) for x, y in pairs]
    long = [
        np.where(count * every * GRID_S >= _LEAST_TOGETHER_S, like, -1.0) for like, count in rows
    ]
    # What does not vary says nothing; of all that do the worst counts.
    total = np.min([np.where(one > -1.0, one, 2.0) for one in long], axis=0)
    total = np.where(total > 1.0, -1.0, total)
    best = int(np.argmax(total))
    like = float(total[best])
    away = np.abs(np.arange(len(total)) - best) * every * GRID_S > _ELSEWHERE_S
    other = float(np.max(total[away], initial=0.0))
    if like < _LEAST_LIKE:
        raise LogError(
            f"{second.info.source}: no offset of its clock makes it the drive of"
            f" {first.info.source} (correlation {max(like, 0.0):.2f} at best)"
        )
    if (1.0 - max(other, 0.0) ** 2) < _PLAINLY * max(1.0 - like**2, _LEAST_UNLIKE):
        raise LogError(
            f"{second.info.source}: more than one offset of its clock fits (correlation {like:.3f},"
            f" and {other:.3f} elsewhere): this drive does not tell"
        )
    late = (best - (len(pairs[0][0][::every]) - 1)) * every
    return late, like, float(rows[0][1][best]) * every * GRID_S


def _likeness(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the correlation of x and y, and how much of them it is of, at every offset.

    At place p of the result y's ticks come p - (len(x) - 1) after the same of x.
    """
    mx, my = np.isfinite(x).astype(float), np.isfinite(y).astype(float)
    x = np.where(mx > 0, x - np.nanmean(x), 0.0)
    y = np.where(my > 0, y - np.nanmean(y), 0.0)

    def over(a: Array, b: Array) -> Array:
        return np.asarray(fftconvolve(b, a[::-1]))

    count = np.maximum(over(mx, my), 1e-9)
    sum_x, sum_y = over(x, my), over(mx, y)
    both = over(x, y) - sum_x * sum_y / count
    of_x = over(x * x, my) - sum_x**2 / count
    of_y = over(mx, y * y) - sum_y**2 / count
    like = both / np.sqrt(np.maximum(of_x * of_y, 1e-12))
    # Where hardly anything varies, noise of the transform would count as likeness.
    varies = (of_x > 0.02 * np.sum(x * x)) & (of_y > 0.02 * np.sum(y * y))
    return np.where(varies, np.clip(like, -1.0, 1.0), -1.0), count


def _at_ticks_of(x: Array, y: Array, late: int) -> Array:
    """Return y on x's ticks if y's ticks come `late` after the same of x."""
    out = np.full(len(x), np.nan)
    at = np.arange(len(x)) + late
    inside = (at >= 0) & (at < len(y))
    out[inside] = y[at[inside]]
    return out


def _fitted(y: Array, x: Array) -> tuple[float, float] | None:
    fit = shifted_fit(
        y,
        np.stack([x, np.ones(len(x))], axis=1),
        period_s=GRID_S,
        around=np.array([1.0, 0.0]),
        prior_std=np.array([0.3, np.inf]),
    )
    if fit is None:
        return None
    return fit.shift_s, math.hypot(fit.shift_std_s, GRID_S / math.sqrt(12.0))
