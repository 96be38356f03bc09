"""Path tracking shared by the built-in planners: pure pursuit and the speed that it can bear."""

from __future__ import annotations

import numpy as np

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from sim_worker.planners.base import PlannerView

MIN_LOOKAHEAD_M = 4.0
LOOKAHEAD_TIME_S = 0.6
_KEPT_M, _LOOKAHEAD_ASIDE = 0.2, 2.0
"""From this far beside its line, a car looks farther ahead by so many times the excess: with the
nearest goal, wheels that turn slowly would swing from side to side for ever."""
MAX_LATERAL_ACCEL_MPS2 = 7.0
"""No more is steered for, so that wheels at speed need little time to come back."""
_MAX_TURN_RAD = 0.4
"""How far the car may turn while its wheels are on their way to the wanted angle."""


def pure_pursuit(view: PlannerView) -> Array:
    """Return tyre angles (S,) that lead base_link to the path's offset line.

    δ = atan(2 L y / d²) with the goal at (x, y) in body axes and distance d
    (Coulter 1992, Implementation of the Pure Pursuit Path Tracking Algorithm).
    """
    aside = np.abs(view.offset_m - view.desired_offset_m)
    lookahead = lookahead_m(view.states[:, 3], aside)
    return steer_towards(view, view.path.point_at(view.arc_m + lookahead, view.desired_offset_m))


def lookahead_m(speed_mps: Array, aside_m: Array) -> Array:
    """Return how far ahead goals lie for cars so far beside their lines, each (S,)."""
    lookahead = np.maximum(MIN_LOOKAHEAD_M, LOOKAHEAD_TIME_S * speed_mps)
    return np.asarray(lookahead + _LOOKAHEAD_ASIDE * np.maximum(aside_m - _KEPT_M, 0.0))


def steer_towards(view: PlannerView, goal: Array) -> Array:
    """Return tyre angles (S,) of the circular arcs that lead base_link to goals (S, 2).

    Goals behind the car are those of one that drives backwards.
    """
    states = view.states
    dx, dy = goal[:, 0] - states[:, 0], goal[:, 1] - states[:, 1]
    cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
    left = cos * dy - sin * dx
    wheelbase = view.vehicle.wheelbase_m.value
    slope = 2.0 * wheelbase * left / (dx * dx + dy * dy + 1e-9)
    most = wheelbase * MAX_LATERAL_ACCEL_MPS2 / np.square(np.maximum(states[:, 3], 1.0))
    most = np.minimum(most, np.tan(view.vehicle.max_tire_angle_rad.value))
    return np.arctan(np.minimum(np.maximum(slope, -most), most))


def front_from_base_m(vehicle: VehicleParameters) -> float:
    """Return how far the front bumper lies ahead of base_link."""
    return vehicle.length_m.value - vehicle.rear_overhang_m.value


def turning_speed(view: PlannerView, tire_angle_rad: Array, *, lateral_accel_mps2: float) -> Array:
    """Return the speed (S,) that the wheels allow on their way to the wanted angles (S,).

    √(a_lat / |κ|) with κ = tan δ / L of the wider of both angles, and less where the wheels still
    have to turn: a car that starts with wheels turned would drive a loop before they are straight.
    """
    vehicle, present = view.vehicle, view.states[:, 6]
    wider = np.maximum(np.abs(present), np.abs(tire_angle_rad))
    curvature = np.tan(wider) / vehicle.wheelbase_m.value + 1e-6
    on_the_way_s = np.abs(present - tire_angle_rad) / vehicle.max_tire_rate_radps.value + 1e-6
    return np.minimum(
        np.sqrt(lateral_accel_mps2 / curvature), _MAX_TURN_RAD / (curvature * on_the_way_s)
    )
