"""Lights along the stand-in's path: where its driver must stand as long as they let nobody pass."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.frames import local_pose, wrap_angle
from foretwin.contracts.lights import ShownLights, StopPlace
from foretwin.telemetry.standin.obstacles import FRONT_M
from foretwin.telemetry.standin.path import DrivenPath, PathPiece

_SHORT_OF_M = 1.0
"""As far before the line the bumper stops; chosen."""
_ASIDE_M, _TURNED_RAD = 6.0, math.radians(45.0)
"""A path over a stop line is so near to its middle, three lanes to a side, and so much along it."""
_AHEAD_M = 120.0
STALE_NS = 1_000_000_000
"""Ten messages: a light of which nothing is heard any more stops nobody."""


class LightAhead(NamedTuple):
    """Where base_link must stand for a light, as a distance along the path.

    For one that is `amber` nobody stops who cannot do so in comfort.
    """

    s_m: float
    amber: bool


def lights_ahead(
    path: DrivenPath, s_m: float, shown: ShownLights, *, anchor: Anchor | None = None
) -> tuple[LightAhead, ...]:
    """Return the lights that let nobody pass ahead of a car on its path, the nearest first.

    Lights are in the World; with an `anchor` the path is on its lot. Lights that only a plan knows
    count for nobody who follows a real road.
    """
    stops = [
        (light.colour == "amber", stop)
        for light in shown.lights
        if light.binds_car and light.stops_cars and not light.on_foot
        for stop in light.stops
    ]
    ahead = path.piece(s_m, s_m + _AHEAD_M) if stops else None
    if ahead is None:
        return ()
    found = [
        LightAhead(at_m, amber)
        for amber, stop in stops
        if (at_m := _stand_m(path, ahead, stop, anchor)) is not None and at_m > s_m - _SHORT_OF_M
    ]
    return tuple(sorted(found))


def _stand_m(
    path: DrivenPath, ahead: PathPiece, stop: StopPlace, anchor: Anchor | None
) -> float | None:
    """Return where base_link stands before a stop line; None where the path does not cross it."""
    at = stop.position, stop.yaw_rad
    if anchor is not None:
        at = anchor.lot_from_world(*at)
    x_m, y_m, yaw_rad = local_pose(path.frame, *at)
    line_m, left_m, along_rad = (float(one[0]) for one in ahead.locate(np.array([[x_m, y_m]])))
    beyond_m = line_m - float(np.clip(line_m, ahead.s_m[0], ahead.s_m[-1]))
    turned_rad = float(wrap_angle(yaw_rad - along_rad))
    if abs(turned_rad) > _TURNED_RAD or math.hypot(beyond_m, left_m) > _ASIDE_M:
        return None
    return line_m - FRONT_M - _SHORT_OF_M
