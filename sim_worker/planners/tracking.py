"""Path tracking shared by the built-in planners: pure pursuit and the speed that it can bear."""

from __future__ import annotations

import math

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
    ahead = view.arc_m + lookahead_m(view.states[:, 3], aside_m(view))
    return steer_towards(view, view.path.point_at(ahead, view.desired_offset_m))


def aside_m(view: PlannerView) -> Array:
    """Return how far (S,) the cars are from their lines."""
    aside = view.offset_m - view.desired_offset_m
    return np.abs(aside, out=aside)


def lookahead_m(speed_mps: Array, aside_m: Array) -> Array:
    """Return how far ahead goals lie for cars so far beside their lines, each (S,)."""
    more = aside_m - _KEPT_M
    np.maximum(more, 0.0, out=more)
    more *= _LOOKAHEAD_ASIDE
    lookahead = LOOKAHEAD_TIME_S * speed_mps
    np.maximum(lookahead, MIN_LOOKAHEAD_M, out=lookahead)
    lookahead += more
    return lookahead


def steer_towards(view: PlannerView, goal: Array) -> Array:
    """Return tyre angles (S,) of the circular arcs that lead base_link to goals (S, 2).

    Goals behind the car are those of one that drives backwards.
    """
    states, wheelbase = view.states.T, view.vehicle.wheelbase_m.value
    way = goal.T - states[:2]
    ahead = np.empty_like(way)
    np.cos(states[2], out=ahead[0])
    np.sin(states[2], out=ahead[1])
    ahead *= way[::-1]
    slope = ahead[0] - ahead[1]
    slope *= 2.0 * wheelbase
    way *= way
    distance_square = way[0] + way[1]
    distance_square += 1e-9
    slope /= distance_square
    most = np.maximum(states[3], 1.0)
    most *= most
    np.divide(wheelbase * MAX_LATERAL_ACCEL_MPS2, most, out=most)
    np.minimum(most, math.tan(view.vehicle.max_tire_angle_rad.value), out=most)
    np.minimum(slope, most, out=slope)
    np.negative(most, out=most)
    np.maximum(slope, most, out=slope)
    return np.asarray(np.arctan(slope, out=slope))


def front_from_base_m(vehicle: VehicleParameters) -> float:
    """Return how far the front bumper lies ahead of base_link."""
    return vehicle.length_m.value - vehicle.rear_overhang_m.value


def turning_speed(view: PlannerView, tire_angle_rad: Array, *, lateral_accel_mps2: float) -> Array:
    """Return the speed (S,) that the wheels allow on their way to the wanted angles (S,).

    √(a_lat / |κ|) with κ = tan δ / L of the wider of both angles, and less where the wheels still
    have to turn: a car that starts with wheels turned would drive a loop before they are straight.
    """
    vehicle, present = view.vehicle, view.states[:, 6]
    curvature, turned = np.abs(present), np.abs(tire_angle_rad)
    np.maximum(curvature, turned, out=curvature)
    np.tan(curvature, out=curvature)
    curvature /= vehicle.wheelbase_m.value
    curvature += 1e-6
    np.subtract(present, tire_angle_rad, out=turned)
    np.abs(turned, out=turned)
    turned /= vehicle.max_tire_rate_radps.value
    turned += 1e-6
    # What the car turns by at 1 m/s until the wheels are where they should be.
    turned *= curvature
    np.divide(_MAX_TURN_RAD, turned, out=turned)
    np.divide(lateral_accel_mps2, curvature, out=curvature)
    np.sqrt(curvature, out=curvature)
    return np.minimum(curvature, turned, out=curvature)
