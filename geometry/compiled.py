"""Arithmetic compiled by numba: the same formulas, row by row.

A numpy call costs as much for 64 cars as for one: at 50 ticks a second, some 150 calls took
longer than the physics. Here is nothing but arithmetic on arrays that others own; what it means
stands where it is called. All is compiled at import, for one signature and no other: no drive
waits for a compiler.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np

from foretwin.contracts.arrays import Array

_Function = TypeVar("_Function", bound=Callable[..., Any])

types: Any = numba.types  # whose annotations are incomplete
REAL, WHOLE = types.float64, types.intp
OUT, OUT_ROWS = REAL[:], REAL[:, :]


def given(dimensions: int, layout: str = "A") -> Any:
    """Return the type of what is only read: whatever numpy hands over, slices too, and what a
    message holds, read-only and anywhere; with layout "C" as `np.ascontiguousarray` leaves it."""
    return types.Array(REAL, dimensions, layout, readonly=True, aligned=False)


IN, IN_ROWS = given(1), given(2)
LINE, TABLE = given(1, "C"), given(2, "C")


def kernel(returns: Any, *arguments: Any) -> Callable[[_Function], _Function]:
    """Compile for these types, or take it from the cache: `__pycache__` beside this file, else the
    user's cache folder, or `NUMBA_CACHE_DIR`; where none can be written, for this process alone."""

    def compiled(function: _Function) -> _Function:
        # Without fast-math: the same order of operations gives the same bits on every machine.
        def compile_it(cache: bool) -> _Function:
            jit = numba.njit(returns(*arguments), cache=cache, error_model="numpy")
            found: _Function = jit(function)
            return found

        try:
            return compile_it(cache=True)
        except (RuntimeError, OSError):
            return compile_it(cache=False)

    return compiled


@kernel(types.void, IN_ROWS, IN, TABLE, TABLE, REAL, WHOLE, OUT_ROWS)
def locate(
    xy: Array,
    near_arc_m: Array,
    nodes: Array,
    segments: Array,
    first_arc_m: float,
    either: int,
    found: Array,
) -> None:
    """Fill `found` (2, S): arc length and offset of positions (2, S), as `FrenetPath.locate`."""
    last = nodes.shape[1] - 1
    for car in range(xy.shape[1]):
        x, y = xy[0, car], xy[1, car]
        start = min(max(near_arc_m[car] - (first_arc_m + either), 0.0), float(last - 2 * either))
        if not math.isfinite(x + y + start):
            found[0, car] = found[1, car] = math.nan
            continue
        node, least = int(start), math.inf
        for k in range(int(start), int(start) + 2 * either + 1):
            dx, dy = nodes[0, k] - x, nodes[1, k] - y
            away = dx * dx + dy * dy
            if away < least:
                node, least = k, away
        # The node's own tangent decides between the segment before and the one after.
        if (x - nodes[0, node]) * nodes[3, node] < (y - nodes[1, node]) * nodes[2, node]:
            node -= 1
        node = min(max(node, 0), last - 1)
        dx, dy = x - segments[0, node], y - segments[1, node]
        share = dx * segments[2, node] + dy * segments[4, node]
        found[0, car] = min(max(share, 0.0), 1.0) + segments[6, node]
        found[1, car] = dx * segments[3, node] + dy * segments[5, node]


@kernel(types.void, TABLE, TABLE, LINE, LINE, OUT_ROWS)
def cheapest_walks(x: Array, y: Array, to_x: Array, to_y: Array, found: Array) -> None:
    """Fill `found` (2, S) with Fréchet and warping distances of curves (S, N) from (M,) points."""
    columns = len(to_x)
    widest, total = np.empty(columns), np.empty(columns)
    for curve_of in range(x.shape[0]):
        for i in range(x.shape[1]):
            widest_before = total_before = math.inf  # of the row before, one column before
            widest_left = total_left = math.inf
            for j in range(columns):
                dx, dy = x[curve_of, i] - to_x[j], y[curve_of, i] - to_y[j]
                away = math.sqrt(dx * dx + dy * dy)
                if i == 0 and j == 0:
                    most, least = 0.0, 0.0
                elif i == 0:
                    most, least = widest_left, total_left
                else:
                    most = min(widest_left, widest[j], widest_before)
                    least = min(total_left, total[j], total_before)
                widest_before, total_before = widest[j], total[j]
                widest_left = widest[j] = max(most, away)
                total_left = total[j] = least + away
        found[0, curve_of], found[1, curve_of] = widest[-1], total[-1]
