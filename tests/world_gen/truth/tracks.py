"""Real vehicles' tracks against lanes: how far beside, and how wide turns are driven."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import (
    arc_lengths,
    headings_rad,
    kept_apart,
    length,
    points_at,
    unit,
)
from tests.world_gen.truth.lane_model import LaneModel, Nearby

STEP_M = 0.5
_SMOOTH_M = 1.5
"""Tracks are smoothed so far before headings are read: recorders are off by decimetres."""
_TURN_WINDOW_M = 10.0
_TURN_RAD = math.radians(20.0)
_CORNER_RAD = (math.radians(55.0), math.radians(125.0))
_SHARE = (0.2, 0.8)
_BESIDE_TURN_M = 3.0
_LEAST_TURN_M = 4.0
_STILL_M = 0.3
_LEAST_DRIVE_M = 5.0


class Driven(NamedTuple):
    """A track metre by metre: places (N, 2), unit directions (N, 2), and where it turns (N,)."""

    xy_m: Array
    along: Array
    turning: np.ndarray


def driven(xy_m: Array) -> Driven:
    """Return a track at even metres, without its standstills.

    It turns where its direction changes by more than 20° within 10 m.
    """
    line = xy_m[kept_apart(xy_m, least_m=_STILL_M)]
    even = points_at(line, np.arange(0.0, max(length(line), 2.0 * STEP_M), STEP_M))
    smooth = np.stack(
        [gaussian_filter1d(even[:, k], _SMOOTH_M / STEP_M, mode="nearest") for k in (0, 1)], axis=1
    )
    yaw = np.unwrap(headings_rad(smooth))
    ahead = round(_TURN_WINDOW_M / 2.0 / STEP_M)
    padded = np.pad(yaw, ahead, mode="edge")
    turning = np.abs(padded[2 * ahead :] - padded[: -2 * ahead]) > _TURN_RAD
    return Driven(even, np.stack([np.cos(yaw), np.sin(yaw)], axis=1), turning)


class Beside(NamedTuple):
    """How far tracks lie from the nearest line that heads their way, each half metre.

    NaN where none is within 8 m; `turning` tells where the track turns.
    """

    away_m: Array
    turning: np.ndarray


def beside(model: LaneModel, tracks: Iterable[Array], *, within: Array | None = None) -> Beside:
    """Return the distances of all tracks; `within` are bounds (2, 2) beyond which none counts."""
    nearby = Nearby(model.lines())
    away, turning = [np.empty(0)], [np.empty(0, dtype=bool)]
    for xy_m in tracks:
        if len(xy_m) < 5 or arc_lengths(xy_m)[-1] < _LEAST_DRIVE_M:
            continue
        track = driven(xy_m)
        known = np.ones(len(track.xy_m), dtype=bool)
        if within is not None:
            known = ((track.xy_m > within[0]) & (track.xy_m < within[1])).all(axis=1)
        away.append(np.abs(nearby.lateral(track.xy_m, track.along)[0])[known])
        turning.append(track.turning[known])
    return Beside(np.concatenate(away), np.concatenate(turning))


def extended(line: Array, by_m: float = 8.0) -> Array:
    """Return a line that goes straight on at both ends, as the lanes before and behind do."""
    before, after = unit(line[0] - line[1]), unit(line[-1] - line[-2])
    return np.concatenate([[line[0] + by_m * before], line, [line[-1] + by_m * after]])


def corner_radius_m(xy_m: Array, *, left: bool) -> float | None:
    """Return the radius of a near-side turn, from 20 to 80 % of its angle; None where it is none.

    It is the way driven over the angle turned, so that a track's noise counts little. A near-side
    turn is one by 55 to 125° to the right, where traffic keeps right.
    """
    line = driven(xy_m)
    yaw = np.unwrap(np.arctan2(line.along[:, 1], line.along[:, 0]))
    turned = yaw - yaw[0] if left else yaw[0] - yaw
    total = turned[-1]
    if not _CORNER_RAD[0] < total < _CORNER_RAD[1]:
        return None
    at = [int(np.argmax(turned > share * total)) for share in _SHARE]
    # Between two metres the place is found by proportion.
    places = [
        i - (turned[i] - share * total) / max(turned[i] - turned[i - 1], 1e-9)
        for i, share in zip(at, _SHARE, strict=True)
    ]
    return float((places[1] - places[0]) * STEP_M / ((_SHARE[1] - _SHARE[0]) * total))


def corner_radii_m(xy_m: Array, *, left: bool) -> list[float]:
    """Return the radius of each near-side turn of a whole drive (N, 2)."""
    track = driven(xy_m)
    turning = np.flatnonzero(track.turning)
    beside_turn = round(_BESIDE_TURN_M / STEP_M)
    found = []
    for turn in np.split(turning, np.flatnonzero(np.diff(turning) > 1) + 1):
        if len(turn) * STEP_M < _LEAST_TURN_M:
            continue
        first, last = max(turn[0] - beside_turn, 0), turn[-1] + beside_turn
        radius_m = corner_radius_m(track.xy_m[first:last], left=left)
        if radius_m is not None:
            found.append(radius_m)
    return found
