"""How far it is to what stands still, compiled: a grid of distances, and who could get so far."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array, Flags
from foretwin.geometry.compiled import IN, IN_ROWS, REAL, TABLE, kernel, types

CELL_M, STEP_M = 0.5, 1.0 / 64.0
"""Sides of a grid's cells, and what the distances in it are whole numbers of."""
FAR = 255
"""Distances of so many steps, or more, are not told apart."""
_HALF_DIAGONAL_M = CELL_M * math.sqrt(0.5)

_Grid = npt.NDArray[np.uint8]
_GRID, _PLACE, _BOX = types.uint8[:, ::1], types.UniTuple(REAL, 2), types.UniTuple(REAL, 6)


@kernel(types.void, TABLE, _PLACE, _GRID)
def come_near(ring: Array, corner: tuple[float, float], steps: _Grid) -> None:
    """Lower a grid's distances to those from a closed convex ring (N + 1, 2), counter-clockwise."""
    reach = FAR * STEP_M + _HALF_DIAGONAL_M
    first, end = np.empty(2, dtype=np.intp), np.empty(2, dtype=np.intp)
    for k in range(2):
        first[k] = max(int((ring[:, k].min() - reach - corner[k]) / CELL_M), 0)
        end[k] = min(int((ring[:, k].max() + reach - corner[k]) / CELL_M) + 1, steps.shape[k])
    for column in range(first[0], end[0]):
        x = corner[0] + (column + 0.5) * CELL_M
        for row in range(first[1], end[1]):
            y = corner[1] + (row + 0.5) * CELL_M
            outside, square = len(ring) < 4, math.inf
            for k in range(len(ring) - 1):
                along_x, along_y = ring[k + 1, 0] - ring[k, 0], ring[k + 1, 1] - ring[k, 1]
                dx, dy = x - ring[k, 0], y - ring[k, 1]
                outside |= dx * along_y > dy * along_x
                length = along_x * along_x + along_y * along_y
                share = min(max((dx * along_x + dy * along_y) / max(length, 1e-18), 0.0), 1.0)
                dx, dy = dx - share * along_x, dy - share * along_y
                square = min(square, dx * dx + dy * dy)
            away = math.sqrt(square) - _HALF_DIAGONAL_M if outside else 0.0
            if away < FAR * STEP_M:
                steps[column, row] = min(steps[column, row], int(max(away, 0.0) / STEP_M))


@kernel(REAL, _GRID, _PLACE, REAL, REAL)
def least_m(steps: _Grid, corner: tuple[float, float], x: float, y: float) -> float:
    """Return how far it is at least from a point to anything; 0 from what is no number."""
    column, row = (x - corner[0]) / CELL_M, (y - corner[1]) / CELL_M
    if not math.isfinite(column + row):
        return 0.0
    if min(column, row) < 0.0 or column >= steps.shape[0] or row >= steps.shape[1]:
        return FAR * STEP_M
    return float(steps[int(column), int(row)]) * STEP_M


@kernel(types.void, _GRID, _PLACE, IN_ROWS, IN_ROWS, IN, _BOX, types.boolean[:])
def may_touch(
    steps: _Grid,
    corner: tuple[float, float],
    states: Array,
    heading: Array,
    drift_m: Array,
    box: tuple[float, ...],
    found: Flags,
) -> None:
    """Fill `found` (S,) as `NearStatics.may_touch`."""
    half_length_m, half_width_m, ahead_m, cog_ahead_m, corner_m, tick_s = box
    for car in range(states.shape[1]):
        cos, sin, rate = heading[0, car], heading[1, car], states[5, car]
        # The centre of gravity goes straight on, but for the drift; the box turns about it.
        along, left = (
            states[3, car] * tick_s / 2.0,
            (states[4, car] + cog_ahead_m * rate) * tick_s / 2.0,
        )
        half, wide = half_length_m + abs(along), half_width_m + abs(left)
        more = drift_m[car] + abs(rate) * tick_s * corner_m
        x = states[0, car] + cos * (ahead_m + along) - sin * left
        y = states[1, car] + sin * (ahead_m + along) + cos * left
        found[car] = False
        if least_m(steps, corner, x, y) > math.hypot(half, wide) + more:
            continue
        # Where a circle about all that the box sweeps does not tell: about parts of it.
        parts = min(max(2.0 * half / wide, 1.0), 64.0)
        parts = math.ceil(parts) if math.isfinite(parts) else 1
        part = half / parts
        reach = math.hypot(part, wide) + more
        for k in range(parts):
            at = (2 * k + 1 - parts) * part
            if not least_m(steps, corner, x + cos * at, y + sin * at) > reach:
                found[car] = True
                break
