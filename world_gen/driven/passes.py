"""Tracks of earlier drives as a World sees them: pieces at even metres in its frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.tracks import DrivenTrack
from foretwin.geometry.polyline import apart, kept_apart, length, points_at, units
from foretwin.world_gen.extent import Extent

STEP_M = 2.0
"""Chosen: a lane or a turn of 10 m is seen by five points."""
_STILL_M = 0.5
"""Nearer points of a car that stands or creeps are noise of the receiver."""
_JUMP_M = 40.0
"""Points farther apart belong to two pieces: 1 s at the speed of a motorway."""
_LEAST_M = 20.0
"""A shorter piece does not tell its lane."""
_HEADING_M = 4.0
"""Directions are taken over so far before and behind: single fixes are off by decimetres."""


class Pass(NamedTuple):
    """One piece of a track at every 2 m: places (N, 2), unit directions (N, 2), and how far off
    its places are, as a standard deviation."""

    xy_m: Array
    along: Array
    std_m: float


def passes_within(tracks: Iterable[DrivenTrack], frame: LocalFrame, extent: Extent) -> list[Pass]:
    """Return the pieces of tracks that lie in a World, in its frame."""
    found = []
    for track in tracks:
        xy_m = local_from_geo(frame, track.lat_deg, track.lon_deg)
        inside = extent.holds(xy_m)
        far = np.concatenate([[True], np.hypot(*np.diff(xy_m, axis=0).T) > _JUMP_M])
        piece_of = np.cumsum(far | np.concatenate([[True], inside[1:] != inside[:-1]]))
        for number in np.unique(piece_of[inside]).tolist():
            piece = pass_along(xy_m[piece_of == number], std_m=track.position_std_m)
            if piece is not None:
                found.append(piece)
    return found


def pass_along(xy_m: Array, *, std_m: float = 0.0) -> Pass | None:
    """Return places (N, 2) in driving order as a pass; None where they are no 20 m."""
    line = xy_m[apart(xy_m, tolerance_m=0.0)]
    line = line[kept_apart(line, least_m=_STILL_M)]
    length_m = length(line)
    if length_m < _LEAST_M:
        return None
    at_m = np.arange(0.0, length_m, STEP_M)
    ahead = points_at(line, np.minimum(at_m + _HEADING_M, length_m))
    behind = points_at(line, np.maximum(at_m - _HEADING_M, 0.0))
    return Pass(points_at(line, at_m), units(ahead - behind), std_m)
