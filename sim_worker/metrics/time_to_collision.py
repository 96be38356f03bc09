"""Time to collision in two dimensions: oriented boxes that keep their speed and their yaw rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.metrics import compiled_touch
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

EXPOSED_BELOW_S = 1.5
"""Threshold τ* of the exposed and integrated times: Minderhoud and Bovy (2001), section 5."""


class TouchInterval(NamedTuple):
    """When two moving boxes touch (…): first at `from_s`, last at `until_s`; no touch where later
    than that. Either may be negative, which is in the past."""

    from_s: Array
    until_s: Array


def meeting(
    relative: Sequence[Array], half_m: tuple[float, float], other_half_m: tuple[Array, Array]
) -> TouchInterval:
    """Return when boxes that only translate touch each other.

    `relative` holds six arrays (…) in the order of `Relative`: the other's centre, turn and
    velocity in the axes of the first. Half lengths and half widths broadcast against them.

    Separating axes of moving convex shapes: Eberly (2001), Intersection of Convex Objects: The
    Method of Separating Axes, section 4. On each of the four face normals the projections overlap
    during one interval; the boxes touch while all four do.
    """
    ahead, left, cos, sin, ahead_mps, left_mps = relative
    (length, width), (other_length, other_width) = half_m, other_half_m
    along, across = np.abs(cos), np.abs(sin)
    first, last = _interval(ahead, ahead_mps, along * other_length + across * other_width + length)
    for distance, speed, reach in (
        (left, left_mps, across * other_length + along * other_width + width),
        (
            cos * ahead + sin * left,
            cos * ahead_mps + sin * left_mps,
            along * length + across * width + other_length,
        ),
        (
            cos * left - sin * ahead,
            cos * left_mps - sin * ahead_mps,
            across * length + along * width + other_width,
        ),
    ):
        begin, end = _interval(distance, speed, reach)
        np.maximum(first, begin, out=first)
        np.minimum(last, end, out=last)
    return TouchInterval(first, last)


def _interval(distance: Array, speed: Array, reach: Array) -> tuple[Array, Array]:
    per_speed = 1.0 / (speed + compiled_touch.NEVER_ZERO)
    half = np.abs(per_speed)
    half *= reach
    per_speed *= distance
    first = -per_speed
    last = half - per_speed
    first -= half
    return first, last


def ttc_series(view: RolloutView) -> Measure:
    """Least time to collision with any other at each instant (S, N), infinite where with none."""
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
    the road users instead of a common lane. Both keep their speed and yaw rate, so that who drives
    in a bend drives on in it: the model of constant turn rate and velocity of Schubert, Richter,
    Wanielik (2008), Comparison and Evaluation of Advanced Motion Models. It holds for 8 s, or
    half a circle; who goes straight on does so for an hour.
    """
    seen = view.relative
    least = np.full(seen.ahead_m.shape[:2], np.inf)
    speed, slide, rate = (view.states[..., k] for k in (3, 4, 5))
    twist = speed, slide + view.centre_ahead_m * rate, rate
    yaw = view.rollout.users[..., 2]
    compiled_touch.least_until_touch(
        tuple(seen), yaw, view.user_half_m, view.half_m, twist, view.time_s, least
    )
    return least
