"""A path bent so that it begins as the car drives now.

A driver holds the heading that the car has for some seconds before the road's counts: where map and
car disagree by a few degrees, one that turned to the map's at once would be 0.15 m beside the car
after a second, on the average. So the way from the path's heading to the car's fades over
`HEADING_S`. What the car lies beside its lane fades as well, later and in part: the map's error
stays.

Both were chosen on drives through Chemnitz and Boulder along roads drawn as maps have them
(tests/trust/drawn_road.py), and are measured on others (docs/trust.md).
"""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.futures import CAR_WITHIN_M
from foretwin.geometry.polyline import arc_lengths, left_of, units

HEADING_S, HEADING_M = 2.6, 2.0
"""The car's heading leads farthest aside after what is driven in so long, and so many metres."""
ASIDE_S, ASIDE_M = 5.0, 1.0
ASIDE_SHARE = 0.33
"""This share of what the car lies aside fades, by 1/e over what is driven in so long."""
_MOST_TURNED_RAD, _MOST_ASIDE_M = 0.5, 3.0
"""A car that heads or lies farther aside is turning, or on another lane: so much of it counts."""


def led_from_car(xy_m: Array, *, car_xy_m: Array, car_yaw_rad: float, speed_mps: float) -> Array:
    """Return a path (N, 2), about 1 m apart, with points moved to where the car's motion leads.

    o(d) = d tan ψ e^(-d/L) - c o₀ (1 - e^(-d/M)), moved to the left at a distance d ahead of the
    car, where ψ is its heading from the path's, and o₀ how far it lies to the left.
    """
    arc = arc_lengths(xy_m)
    tangent = units(np.gradient(xy_m, arc, axis=0))
    near = int(np.searchsorted(arc, CAR_WITHIN_M))
    here = int(np.hypot(*(xy_m[:near] - car_xy_m).T).argmin())
    way, (cos, sin) = car_xy_m - xy_m[here], tangent[here]
    aside_m = float(np.clip(cos * way[1] - sin * way[0], -_MOST_ASIDE_M, _MOST_ASIDE_M))
    turned_rad = float(wrap_angle(car_yaw_rad - math.atan2(sin, cos)))
    turned_rad = float(np.clip(turned_rad, -_MOST_TURNED_RAD, _MOST_TURNED_RAD))
    ahead = arc - arc[here] - float(cos * way[0] + sin * way[1])
    speed_mps = max(speed_mps, 0.0)
    heading_m, fading_m = HEADING_S * speed_mps + HEADING_M, ASIDE_S * speed_mps + ASIDE_M
    moved = math.tan(turned_rad) * ahead * np.exp(-np.abs(ahead) / heading_m)
    moved -= ASIDE_SHARE * aside_m * -np.expm1(-np.maximum(ahead, 0.0) / fading_m)
    return np.asarray(xy_m + moved[:, None] * left_of(tangent))
