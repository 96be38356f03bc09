"""Path tracking shared by the built-in planners: pure pursuit and the speed that it can bear."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.planner_interface import PlannerView

MIN_LOOKAHEAD_M = 4.0
LOOKAHEAD_TIME_S = 0.6
KEPT_M, LOOKAHEAD_ASIDE = 0.2, 2.0
"""From this far beside its line, a car looks farther ahead by so many times the excess: with the
nearest goal, wheels that turn slowly would swing from side to side for ever."""
MAX_LATERAL_ACCEL_MPS2 = 7.0
"""No more is steered for, so that wheels at speed need little time to come back."""
MAX_TURN_RAD = 0.4
"""How far the car may turn while its wheels are on their way to the wanted angle."""


def pure_pursuit(view: PlannerView) -> Array:
    """Return tyre angles (S,) that lead base_link to the path's offset line.

    δ = atan(2 L y / d²) with the goal at (x, y) in body axes and distance d
    (Coulter 1992, Implementation of the Pure Pursuit Path Tracking Algorithm).
    """
    aside = np.abs(view.offset_m - view.desired_offset_m)
    ahead = view.arc_m + lookahead_m(view.states[:, 3], aside)
    return steer_towards(view, view.path.point_at(ahead, view.desired_offset_m))


def lookahead_m(speed_mps: Array, aside_m: Array) -> Array:
    """Return how far ahead goals lie for cars so far beside their lines, each (S,)."""
    lookahead = np.maximum(LOOKAHEAD_TIME_S * speed_mps, MIN_LOOKAHEAD_M)
    return np.asarray(lookahead + LOOKAHEAD_ASIDE * np.maximum(aside_m - KEPT_M, 0.0))


def steer_towards(view: PlannerView, goal: Array) -> Array:
    """Return tyre angles (S,) of the circular arcs that lead base_link to goals (S, 2).

    Goals behind the car are those of one that drives backwards.
    """
    states, wheelbase = view.states.T, view.vehicle.wheelbase_m.value
    heading = view.heading
    if heading is None:
        heading = np.array([np.cos(states[2]), np.sin(states[2])])
    way = goal.T - states[:2]
    ahead = heading * way[::-1]
    distance_square = np.square(way[0]) + np.square(way[1]) + 1e-9
    slope = (ahead[0] - ahead[1]) * (2.0 * wheelbase) / distance_square
    most = wheelbase * MAX_LATERAL_ACCEL_MPS2 / np.square(np.maximum(states[3], 1.0))
    most = np.minimum(most, math.tan(view.vehicle.max_tire_angle_rad.value))
    return np.asarray(np.arctan(np.maximum(np.minimum(slope, most), -most)))


def turning_speed(view: PlannerView, tire_angle_rad: Array, *, lateral_accel_mps2: float) -> Array:
    """Return the speed (S,) that the wheels allow on their way to the wanted angles (S,).

    √(a_lat / |κ|) with κ = tan δ / L of the wider of both angles, and less where the wheels still
    have to turn: a car that starts with wheels turned would drive a loop before they are straight.
    """
    vehicle, present = view.vehicle, view.states[:, 6]
    wheelbase, rate = vehicle.wheelbase_m.value, vehicle.max_tire_rate_radps.value
    # κ L of the wider angle, and what the car turns by at 1 m/s until the wheels are where they
    # should be, times their rate; neither may be zero.
    bend = np.tan(np.maximum(np.abs(present), np.abs(tire_angle_rad))) + 1e-6 * wheelbase
    turned = (np.abs(present - tire_angle_rad) + 1e-6 * rate) * bend
    allowed = np.sqrt(lateral_accel_mps2 * wheelbase / bend)
    return np.minimum(allowed, MAX_TURN_RAD * wheelbase * rate / turned)
