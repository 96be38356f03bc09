"""Bends of roads as arcs, so that lanes beside a way can be driven."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import Flags, left_of, turn_rad
from foretwin.geometry.polyline_batch import Polylines

MIN_STEP_M = 0.25
"""Nodes of a way closer than this to the one before give no direction."""
_SHARE = 0.45
_DEVIATION_M, _WIDEST_DEVIATION_M = 0.35, 2.5
_SOFTEST_RAD, _SHARPEST_RAD = math.radians(3.0), math.radians(150.0)
_SOFTEST_SHARED_RAD = math.radians(0.05)
_STEP_RAD, _STEP_M = math.radians(16.0), 12.0
"""Two chords of an arc turn no farther, and are no longer."""


_KINK_RAD, _STUB_M = math.radians(15.0), 1.5


class Rounded(NamedTuple):
    """Rounded lines, and (L, 2) unit directions of what lies beyond their ends; NaN: nothing."""

    lines: Polylines
    before: Array
    after: Array


def thinned(lines: Polylines) -> Polylines:
    """Return the lines without points nearer than `MIN_STEP_M` to the one before; ends stay."""
    for _ in range(12):
        near = np.zeros(len(lines.xy_m), dtype=bool)
        near[1:] = lines.steps[1][:-1] < MIN_STEP_M
        first, last = lines.first[:-1], lines.first[1:] - 1
        near[first] = False
        # In place of a line's end its neighbour goes.
        at_end = last[near[last] & (np.diff(lines.first) > 2)]
        near[last] = False
        near[1:] &= ~near[:-1]
        near[at_end - 1] = True
        if not near.any():
            break
        lines = lines.keep(~near)
    return lines


def without_end_kinks(lines: Polylines, at_start: Flags, at_end: Flags) -> Polylines:
    """Return the lines without a bend just behind a start, or before an end, flagged (L,).

    A stub of a road left over where a junction begins would turn its lanes aside.
    """
    gap, step = lines.steps
    into = np.roll(gap, 1, axis=0)
    bend = np.abs(turn_rad(into, gap))
    keep = np.ones(len(lines.xy_m), dtype=bool)
    long = np.diff(lines.first) > 2
    second, last_but_one = lines.first[:-1] + 1, lines.first[1:] - 2
    for at, flags, stub_m in ((second, at_start, np.roll(step, 1)), (last_but_one, at_end, step)):
        rows = np.nonzero(flags & long)[0]
        kinks = at[rows]
        keep[kinks[(bend[kinks] > _KINK_RAD) & (stub_m[kinks] < _STUB_M)]] = False
    return lines.keep(keep)


def with_ends(lines: Polylines, before: Array, after: Array) -> Polylines:
    """Return the lines with a point (L, 2) more at each end; rows of NaN add none."""
    on_before, on_after = np.isfinite(before[:, 0]), np.isfinite(after[:, 0])
    sizes = np.diff(lines.first) + on_before + on_after
    first = np.concatenate([[0], np.cumsum(sizes)])
    xy = np.empty((first[-1], 2))
    moved = (first[:-1] + on_before - lines.first[:-1])[lines.line]
    xy[np.arange(len(lines.xy_m)) + moved] = lines.xy_m
    xy[first[:-1][on_before]] = before[on_before]
    xy[first[1:][on_after] - 1] = after[on_after]
    return Polylines(xy, first)


def rounded_through(lines: Polylines, radius_m: Array, before: Array, after: Array) -> Rounded:
    """Return the lines with arcs in place of bends; ends and their directions stay.

    An arc takes at most 0.45 of the shorter neighbouring segment. It keeps within 0.35 m of its
    corner, farther (2.5 m) only as needed for a radius of `radius_m` (L,). Where a road goes on
    beyond an end, `before` and `after` (L, 2) are its next points there (else NaN): the bend at
    the end is rounded too, however small, and each of the two lines gets half of the arc. Both
    end in the middle of one chord of it, so that what is offset from them is cut square there.
    """
    on_before, on_after = np.isfinite(before[:, 0]), np.isfinite(after[:, 0])
    whole = with_ends(lines, before, after)
    xy, first = whole.xy_m, whole.first
    gap, seg = whole.steps
    u = gap / np.maximum(seg, 1e-9)[:, None]
    into = np.roll(u, 1, axis=0)
    bend = turn_rad(into, u)
    bend[first[:-1]] = bend[first[1:] - 1] = 0.0
    angle = np.abs(bend)
    head, tail = first[:-1][on_before] + 1, first[1:][on_after] - 2
    softest = np.full(len(xy), _SOFTEST_RAD)
    softest[head] = softest[tail] = _SOFTEST_SHARED_RAD
    arc = (angle > softest) & (angle < _SHARPEST_RAD)
    half = np.where(arc, angle, 1.0) / 2.0
    outside = 1.0 / np.cos(half) - 1.0
    wanted = np.minimum(radius_m[whole.line], _WIDEST_DEVIATION_M / outside)
    tangent = np.maximum(_DEVIATION_M / outside, wanted) * np.tan(half)
    tangent = np.minimum(tangent, _SHARE * np.minimum(seg, np.roll(seg, 1)))
    arc &= tangent > 0.05
    pairs = np.maximum(angle / _STEP_RAD, tangent / np.tan(half) * angle / _STEP_M)
    steps = np.where(arc, 2 * np.ceil(pairs), 0).astype(np.int64)
    steps[head] += arc[head]
    steps[tail] += arc[tail]

    # A shared arc has an odd number of chords: half of them, and half of the middle one, are ours.
    counts = steps + 1
    begin = np.zeros(len(xy), dtype=np.int64)
    begin[head] = steps[head] // 2
    counts[head] -= begin[head]
    counts[tail] -= steps[tail] // 2
    counts[first[:-1][on_before]] = 0
    counts[first[1:][on_after] - 1] = 0
    at = np.repeat(np.arange(len(xy)), counts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    number = np.arange(len(at)) - starts[at] + begin[at]
    radius = np.where(arc, tangent / np.tan(half), 0.0)[at]
    chord_rad = angle[at] / np.maximum(steps[at], 1)
    turned = chord_rad * number
    from_centre = radius.copy()
    cut = np.concatenate([starts[head], starts[tail + 1] - 1])
    cut = cut[arc[at[cut]]]
    turned[cut] = angle[at[cut]] / 2.0
    from_centre[cut] *= np.cos(chord_rad[cut] / 2.0)
    ahead = into[at]
    inward = left_of(ahead) * np.sign(bend)[at][:, None]
    points = xy[at] - ahead * np.where(arc, tangent, 0.0)[at][:, None]
    points += ahead * (from_centre * np.sin(turned))[:, None]
    points += inward * (radius - from_centre * np.cos(turned))[:, None]

    # What lies beyond a shared end is the other half of the chord.
    share = np.where(arc, 0.5, 0.0)
    beyond_before, beyond_after = np.full_like(before, np.nan), np.full_like(after, np.nan)
    beyond_before[on_before] = _turned(into[head], (bend * share)[head])
    beyond_after[on_after] = _turned(u[tail], -(bend * share)[tail])
    return Rounded(Polylines(points, starts[first]), beyond_before, beyond_after)


def _turned(direction: Array, angle: Array) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = direction[:, 0], direction[:, 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
