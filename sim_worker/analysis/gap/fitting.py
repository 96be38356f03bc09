"""Straight lines through pairs of signals, with honest deviations, delays and saturation.

Of seconds, many times a second. `analysis.identify` fits lines to minutes: its deviations take
four stretches of three seconds at least and ten times as long, and its actuators follow with a lag,
where here a pure delay must be found even if command and answer differ in sign, or 57 times.

Several departures are fitted to one gap, so that none is put down to another.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.shifted_fit import TOGETHER_S
from foretwin.sim_worker.analysis.motion_record import PERIOD_S


class Line(NamedTuple):
    """y = gain x + offset; deviations count one independent sample per `together_s`."""

    gain: float
    gain_std: float
    offset: float
    offset_std: float
    residual: float
    explained: float
    """Share of the variance of y, 0 to 1."""


class DelayedLine(NamedTuple):
    """How y follows x: the line after the best delay, and the plateau of y where there is one."""

    line: Line
    delay_s: float
    saturated_at: float
    """|y| is held there although x asks for more; NaN where it is not."""


def line_through(x: Array, y: Array, *, independent: float) -> Line | None:
    """Fit by least squares; `independent` says how many of the samples (N,) are.

    None for fewer than three independent samples or an x that does not vary.
    """
    count = len(x)
    if count < 3 or independent < 3.0 or float(np.std(x)) < 1e-9:
        return None
    mean_x, mean_y = float(np.mean(x)), float(np.mean(y))
    spread = float(np.mean((x - mean_x) ** 2))
    gain = float(np.mean((x - mean_x) * (y - mean_y))) / spread
    offset = mean_y - gain * mean_x
    left = y - gain * x - offset
    variance = float(np.sum(left * left)) / count * independent / (independent - 2.0)
    total = float(np.mean((y - mean_y) ** 2))
    return Line(
        gain=gain,
        gain_std=float(np.sqrt(variance / (independent * spread))),
        offset=offset,
        offset_std=float(np.sqrt(variance / independent * (1.0 + mean_x**2 / spread))),
        residual=float(np.sqrt(variance)),
        explained=0.0 if total < 1e-18 else 1.0 - float(np.mean(left * left)) / total,
    )


def late_line(
    x: Array, y: Array, changes: Array, *, independent: float, late_std_s: float
) -> Line | None:
    """Fit as `line_through`, where y may come late by 0 give or take `late_std_s`.

    `changes` (N,) are those of x in a second. What time explains, neither gain nor offset need to.
    """
    line = line_through(x, y, independent=independent)
    if line is None:
        return None
    columns = np.stack([x, np.ones(len(x)), -changes], axis=1)
    prior_std = np.array([np.inf, np.inf, late_std_s * max(abs(line.gain), 0.3)])
    each = max(line.residual, 1e-9) ** 2 * len(x) / independent
    fit = joint_fit(y, columns, variance=np.full(len(x), each), prior_std=prior_std)
    (gain, offset, _), (gain_std, offset_std, _) = fit.sizes.tolist(), fit.std.tolist()
    return line._replace(gain=gain, gain_std=gain_std, offset=offset, offset_std=offset_std)


def delayed_line(x: Array, y: Array, *, longest_s: float = 0.8) -> DelayedLine | None:
    """Fit how y follows x, both (N,) on the grid, with delays from 0 to `longest_s`.

    None where too little is known of both.
    """
    most = min(round(longest_s / PERIOD_S), len(x) // 2)
    count = len(x) - most
    if count < 3:
        return None
    # The same instants for each delay, else one would win by meeting the fewest, across gaps too.
    done = y[most:]
    late = np.lib.stride_tricks.sliding_window_view(x, count)[::-1]
    known = np.isfinite(late).all(axis=0) & np.isfinite(done)
    if not known.any():
        return None
    late, done = late[:, known], done[known]
    shift = int(np.argmin(_residuals(late, done)))
    line = line_through(late[shift], done, independent=len(done) * PERIOD_S / TOGETHER_S)
    if line is None:
        return None
    return DelayedLine(line, shift * PERIOD_S, _plateau(late[shift], done, line))


def _residuals(x: Array, y: Array) -> Array:
    """Return the mean square (S,) that a line through each row of x (S, N) leaves of y (N,)."""
    x = x - x.mean(axis=1)[:, None]
    y = y - y.mean()
    xx, xy = np.einsum("ij,ij->i", x, x), x @ y
    left = y @ y - np.where(xx > 1e-18, xy**2 / np.maximum(xx, 1e-18), 0.0)
    return np.asarray(np.where(xx > 1e-18, left, np.inf))


def _plateau(x: Array, y: Array, line: Line) -> float:
    """Return the |y| beyond which nothing goes although x does, NaN where there is none."""
    sign = 1.0 if line.gain >= 0.0 else -1.0
    x = x * sign
    top = float(np.percentile(np.abs(y), 98))
    small = np.abs(y) < 0.7 * top
    flat = (np.abs(np.abs(y) - top) < 0.07 * top) & (np.sign(x) == np.sign(y))
    if small.sum() < 10 or flat.sum() * PERIOD_S < 0.3:
        return float("nan")
    inner = float(np.sum(x[small] * x[small]))
    if inner < 1e-12:
        return float("nan")
    slope = float(np.sum(x[small] * y[small])) / inner
    if slope <= 0.0:
        return float("nan")
    asked = slope * np.abs(x)
    beyond = flat & (asked > 1.25 * top)
    clipped = np.clip(slope * x, -top, top)
    left = float(np.mean((y - clipped) ** 2))
    straight = float(np.mean((y - line.gain * sign * x - line.offset) ** 2))
    if beyond.sum() * PERIOD_S >= 0.3 and left < 0.6 * straight:
        return top
    return float("nan")


class JointFit(NamedTuple):
    """Sizes (C,) of causes with their standard deviations, and what they leave of the gap."""

    sizes: Array
    std: Array
    left: float
    """Sum of squares of what is left, and of what priors say against the sizes, in deviations."""


def joint_fit(gap: Array, columns: Array, *, variance: Array, prior_std: Array) -> JointFit:
    """Fit gap (K,) = columns (K, C) @ sizes with errors of `variance` (K,).

    Sizes are 0 give or take `prior_std` (C,), infinite for a cause that is free: least squares with
    a Gaussian prior (Gelman et al., Bayesian Data Analysis, 2013, 14.8).
    """
    precision = 1.0 / prior_std**2
    weighted = columns / variance[:, None]
    covariance = np.linalg.pinv(weighted.T @ columns + np.diag(precision))
    sizes = covariance @ (weighted.T @ gap)
    apart = gap - columns @ sizes
    left = float(np.sum(apart**2 / variance) + np.sum(precision * sizes**2))
    return JointFit(sizes, np.sqrt(np.maximum(np.diag(covariance), 0.0)), left)
