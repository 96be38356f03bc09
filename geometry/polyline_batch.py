"""Many polylines in one array: what `polyline` does to one, done to thousands at once.

A region has ten thousand lanes of a few points each; one numpy call for each costs a hundred
times the arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import left_of, rays_between

Indices = np.ndarray[Any, np.dtype[np.int64]]


class Polylines(msgspec.Struct, frozen=True, dict=True):
    """L polylines: line i owns the points `xy_m[first[i]:first[i + 1]]`; `first` is (L + 1,)."""

    xy_m: Array
    first: Indices

    @staticmethod
    def of(lines: Sequence[Array]) -> Polylines:
        """Join polylines (N, 2) of at least two points each."""
        if not lines:
            return Polylines(np.zeros((0, 2)), np.zeros(1, dtype=np.int64))
        counts = np.array([len(line) for line in lines], dtype=np.int64)
        return Polylines(np.concatenate(lines), _starts(counts))

    def split(self) -> list[Array]:
        """Return the polylines one by one, as views."""
        ends = self.first.tolist()
        return [self.xy_m[a:b] for a, b in pairwise(ends)]

    def rows(self, which: Indices) -> Polylines:
        """Return chosen lines, in the order of their numbers in `which`, repeats allowed."""
        counts = np.diff(self.first)[which]
        first = _starts(counts)
        points = np.arange(first[-1]) - np.repeat(first[:-1] - self.first[:-1][which], counts)
        return Polylines(self.xy_m[points], first)

    def __len__(self) -> int:
        return len(self.first) - 1

    @cached_property
    def line(self) -> Indices:
        """To which line each point belongs, (P,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    @cached_property
    def is_last(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether each point is its line's last, (P,)."""
        flags = np.zeros(len(self.xy_m), dtype=bool)
        flags[self.first[1:] - 1] = True
        return flags

    @cached_property
    def steps(self) -> tuple[Array, Array]:
        """Gaps (P, 2) to the next point and their lengths (P,); zero at each line's last point."""
        gap = np.zeros_like(self.xy_m)
        gap[:-1] = self.xy_m[1:] - self.xy_m[:-1]
        gap[self.is_last] = 0.0
        return gap, np.hypot(gap[:, 0], gap[:, 1])

    @cached_property
    def arc_m(self) -> Array:
        """Metres along its line to each point, (P,)."""
        total = np.concatenate([[0.0], np.cumsum(self.steps[1])])
        arc: Array = total[:-1] - total[self.first[:-1]][self.line]
        return arc

    @property
    def length_m(self) -> Array:
        """Length of each line, (L,)."""
        return self.arc_m[self.first[1:] - 1]

    def keep(self, wanted: np.ndarray[Any, np.dtype[np.bool_]]) -> Polylines:
        """Return the lines with the wanted points (P,) alone."""
        counts = np.bincount(self.line[wanted], minlength=len(self))
        return Polylines(self.xy_m[wanted], _starts(counts))


def _starts(counts: Indices) -> Indices:
    first = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=first[1:])
    return first


def points_at(lines: Polylines, which: Indices, at_m: Array) -> Array:
    """Return points (M, 2) at arc lengths `at_m` (M,), clamped, of the lines `which` (M,)."""
    at = np.clip(at_m, 0.0, lines.length_m[which])
    i = segments_at(lines, which, at)
    gap, length = lines.steps
    share = (at - lines.arc_m[i]) / np.maximum(length[i], 1e-12)
    found: Array = lines.xy_m[i] + np.clip(share, 0.0, 1.0)[:, None] * gap[i]
    return found


def segments_at(lines: Polylines, which: Indices, at_m: Array) -> Indices:
    """Return (M,) the points behind which arc lengths `at_m` (M,) of the lines `which` (M,) lie."""
    # A key that grows along each line and from line to line finds all in one search.
    room = np.concatenate([[0.0], np.cumsum(lines.length_m + 1.0)])
    i = np.searchsorted(lines.arc_m + room[lines.line], at_m + room[which], side="right") - 1
    return np.asarray(np.clip(i, lines.first[which], lines.first[which + 1] - 2))


def without_repeats(lines: Polylines, *, tolerance_m: float = 0.01) -> Polylines:
    """Drop points closer than `tolerance_m` to the one before; in place of an end, that one."""
    wanted = np.ones(len(lines.xy_m), dtype=bool)
    wanted[1:] = lines.steps[1][:-1] > tolerance_m
    first, last = lines.first[:-1], lines.first[1:] - 1
    wanted[first] = True
    at_end = last[~wanted[last] & (last - first > 1)]
    wanted[at_end], wanted[at_end - 1] = True, False
    return lines.keep(wanted)


def cut(lines: Polylines, from_m: Array, to_m: Array) -> Polylines:
    """Return of each line the piece between two arc lengths (L,), as `polyline.cut`."""
    every = np.arange(len(lines))
    ends = points_at(lines, np.repeat(every, 2), np.stack([from_m, to_m], axis=1).ravel())
    arc, line = lines.arc_m, lines.line
    inside = (arc > from_m[line] + 1e-6) & (arc < to_m[line] - 1e-6)
    counts = np.bincount(line[inside], minlength=len(lines)) + 2
    first = _starts(counts)
    xy = np.empty((first[-1], 2))
    xy[first[:-1]], xy[first[1:] - 1] = ends[::2], ends[1::2]
    middle = np.ones(len(xy), dtype=bool)
    middle[first[:-1]] = middle[first[1:] - 1] = False
    xy[middle] = lines.xy_m[inside]
    return Polylines(xy, first)


def directions(lines: Polylines) -> tuple[Array, Array]:
    """Return the unit directions (P, 2) into and out of each point; those of the ends are alike."""
    gap, length = lines.steps
    unit = gap / np.maximum(length, 1e-9)[:, None]
    after = unit.copy()
    last = lines.first[1:] - 1
    after[last] = unit[last - 1]
    before = np.empty_like(unit)
    before[1:] = unit[:-1]
    before[lines.first[:-1]] = unit[lines.first[:-1]]
    return before, after


def offset(
    lines: Polylines, left_m: Array, *, before: Array | None = None, after: Array | None = None
) -> Polylines:
    """Shift each line to its left by `left_m` (L,), as `polyline.offset` does.

    `before` and `after` (L, 2) are the directions of what continues beyond the ends; NaN: none.
    """
    into, out = directions(lines)
    first, last = lines.first[:-1], lines.first[1:] - 1
    at_start = left_of(out[first])
    if before is not None:
        into[first] = np.where(np.isnan(before), into[first], before)
    if after is not None:
        out[last] = np.where(np.isnan(after), out[last], after)
    normal, stretch = rays_between(into, out, at_start[lines.line])
    shift = left_m[lines.line]
    moved = lines.xy_m + normal * (shift * stretch)[:, None]
    shifted = np.where((np.abs(shift) < 1e-9)[:, None], lines.xy_m, moved)
    return _without_backward_runs(Polylines(shifted, lines.first), lines)


def _without_backward_runs(shifted: Polylines, lines: Polylines) -> Polylines:
    """Drop points of stretches that run against the line they were shifted from, again where what
    is then joined does so."""
    forward = (shifted.steps[0] * lines.steps[0]).sum(axis=1) > 0.0
    segments = ~lines.is_last
    ahead = np.bincount(lines.line[segments & forward], minlength=len(lines))
    folded = (ahead > 0) & (ahead < np.diff(lines.first) - 1)
    keep = np.ones(len(lines.xy_m), dtype=bool)
    keep[:-1] &= forward[:-1] | lines.is_last[:-1]
    keep[1:] &= forward[:-1] | lines.is_last[:-1]
    keep[lines.first[:-1]] = keep[lines.first[1:] - 1] = True
    keep |= ~folded[lines.line]
    return shifted if keep.all() else _without_backward_runs(shifted.keep(keep), lines.keep(keep))
