"""How soon a collision could be if everybody did the worst."""

from __future__ import annotations

import numpy as np

from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.metrics import compiled_touch
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView


def worst_time_to_collision(view: RolloutView) -> Measure:
    """Least worst time to collision (S,): if both at once accelerate as hard as they can to meet.

    Wachenfeld, Junietz, Wenzel, Winner (2016), The Worst-Time-to-Collision Metric for Situation
    Identification: each is anywhere in a disc that moves on with its velocity and grows by
    a t² / 2. The discs begin around the outlines; a is `MAX_DECEL_MPS2`, also of those who walk.
    """
    least = np.full(len(view.valid), np.inf)
    if view.there.any():
        reach_m = float(np.hypot(view.half_length_m, view.half_width_m))
        seen = view.relative
        # The middle of a car that turns goes aside of base_link.
        aside_mps = seen.left_mps - (view.centre_ahead_m * view.states[..., 5])[..., None]
        compiled_touch.least_worst_case(
            (*seen[:5], aside_mps), view.user_half_m, reach_m, 2.0 * MAX_DECEL_MPS2, least
        )
        least[~view.there.any(axis=(1, 2))] = np.inf
    return view.measure(least)
