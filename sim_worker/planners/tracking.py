"""Path tracking shared by the built-in planners: pure pursuit with a speed-dependent look-ahead."""

from __future__ import annotations

import numpy as np

from contracts.arrays import Array
from sim_worker.planners.base import PlannerView

MIN_LOOKAHEAD_M = 4.0
LOOKAHEAD_TIME_S = 0.6


def pure_pursuit(view: PlannerView) -> Array:
    """Return tyre angles (S,) that lead base_link to the path's offset line.

    δ = atan(2 L y / d²) with the goal at (x, y) in body axes and distance d
    (Coulter 1992, Implementation of the Pure Pursuit Path Tracking Algorithm).
    """
    states = view.states
    lookahead = np.maximum(MIN_LOOKAHEAD_M, LOOKAHEAD_TIME_S * states[:, 3])
    goal = view.path.point_at(view.arc_m + lookahead, view.desired_offset_m)
    dx, dy = goal[:, 0] - states[:, 0], goal[:, 1] - states[:, 1]
    cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
    left = cos * dy - sin * dx
    angle = np.arctan(2.0 * view.vehicle.wheelbase_m.value * left / (dx * dx + dy * dy + 1e-9))
    limit = view.vehicle.max_tire_angle_rad.value
    return np.asarray(np.minimum(np.maximum(angle, -limit), limit))
