"""Time to collision in two dimensions: oriented boxes that keep their velocity and heading."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.metrics import compiled_pairs
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

EXPOSED_BELOW_S = 1.5
"""Threshold τ* of the exposed and integrated times: Minderhoud and Bovy (2001), section 5."""


class TouchInterval(NamedTuple):
    """When two moving boxes touch (…): first at `from_s`, last at `until_s`; no touch where later
    than that. Either may be negative, which is in the past."""

    from_s: Array
    until_s: Array


class BoxPairs(NamedTuple):
    """Two boxes each, in the axes of the first: the second's centre, velocity and turn (…).

    Half lengths and half widths broadcast against them.
    """

    ahead_m: Array
    left_m: Array
    ahead_mps: Array
    left_mps: Array
    cos: Array
    sin: Array
    first_half_m: tuple[float, float]
    second_half_m: tuple[Array, Array]


def meeting(pairs: BoxPairs) -> TouchInterval:
    """Return when boxes that only translate touch each other.

    Separating axes of moving convex shapes: Eberly (2001), Intersection of Convex Objects: The
    Method of Separating Axes, section 4. On each of the four face normals the projections overlap
    during one interval; the boxes touch while all four do.
    """
    length, width = pairs.first_half_m
    other_length, other_width = pairs.second_half_m
    cos, sin = np.abs(pairs.cos), np.abs(pairs.sin)
    x, y, vx, vy = pairs.ahead_m, pairs.left_m, pairs.ahead_mps, pairs.left_mps
    first, last = _interval(x, vx, cos * other_length + sin * other_width + length)
    _narrow(first, last, y, vy, sin * other_length + cos * other_width + width)
    _narrow(
        first, last,
        pairs.cos * x + pairs.sin * y, pairs.cos * vx + pairs.sin * vy,
        cos * length + sin * width + other_length,
    )  # fmt: skip
    _narrow(
        first, last,
        pairs.cos * y - pairs.sin * x, pairs.cos * vy - pairs.sin * vx,
        sin * length + cos * width + other_width,
    )  # fmt: skip
    return TouchInterval(first, last)


def _interval(distance: Array, speed: Array, reach: Array) -> tuple[Array, Array]:
    per_speed = 1.0 / (speed + compiled_pairs.NEVER_ZERO)
    half = np.abs(per_speed)
    half *= reach
    per_speed *= distance
    first = -per_speed
    last = half - per_speed
    first -= half
    return first, last


def _narrow(first: Array, last: Array, distance: Array, speed: Array, reach: Array) -> None:
    begin, end = _interval(distance, speed, reach)
    np.maximum(first, begin, out=first)
    np.minimum(last, end, out=last)


def ttc_series(view: RolloutView) -> Measure:
    """Least time to collision with anybody at each instant (S, N), infinite where with nobody."""
    return view.measure(view.keep(_least_at_each_instant))


def ttc(view: RolloutView) -> Measure:
    """Least time to collision of each future (S,)."""
    return view.measure(view.keep(_least_at_each_instant).min(axis=1))


def time_exposed(view: RolloutView) -> Measure:
    """Seconds (S,) with a time to collision below 1.5 s.

    TET of Minderhoud and Bovy (2001), Extended time-to-collision measures, equation 3.
    """
    below = view.keep(_least_at_each_instant)[:, :-1] <= EXPOSED_BELOW_S
    return view.measure((below * np.diff(view.time_s)).sum(axis=1))


def time_integrated(view: RolloutView) -> Measure:
    """By how much and how long (S,), in s², time to collision is below 1.5 s.

    TIT of Minderhoud and Bovy (2001), Extended time-to-collision measures, equation 6.
    """
    short = np.maximum(EXPOSED_BELOW_S - view.keep(_least_at_each_instant)[:, :-1], 0.0)
    return view.measure((short * np.diff(view.time_s)).sum(axis=1))


def _least_at_each_instant(view: RolloutView) -> Array:
    """Return (S, N) seconds until any road user is touched, infinite where none ever is.

    Hayward (1972), Near-miss determination through use of a scale of danger, with the shapes of
    the road users instead of a common lane: both keep their velocity and heading.
    """
    seen = view.relative
    least = np.full(seen.ahead_m.shape[:2], np.inf)
    compiled_pairs.least_until_touch(
        seen[:6], *view.user_half_m, view.half_length_m, view.half_width_m, least
    )
    return least
