"""One number for a future, in the style of the predictive driver model score."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.metrics.comfort import comfortable
from foretwin.sim_worker.metrics.impact import at_fault_collision
from foretwin.sim_worker.metrics.progress import backwards, keeps_to_road, progress
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView
from foretwin.sim_worker.metrics.time_to_collision import ttc

TTC_WEIGHT, PROGRESS_WEIGHT, COMFORT_WEIGHT = 5.0, 5.0, 2.0
TTC_BOUND_S = 1.0
"""No collision with constant velocity sooner than this: NAVSIM's future window."""
_LEAST_PROGRESS_M = 5.0
"""Where no future gets farther than this, waiting is no fault."""
_BACK_M = (2.0, 6.0)
"""Falling back by more halves, or ends, the score: nuPlan's driving direction compliance."""


def driving_score(view: RolloutView) -> Measure:
    """Score (S,) from 0 to 1: gates for safety times a weighted mean of how well it drives.

    NC · DAC · DDC · (5 TTC + 5 EP + 2 C) / 12, after Dauner et al. (2024), NAVSIM: Data-Driven
    Non-Reactive Autonomous Vehicle Simulation and Benchmarking, equation 1 and section 3.2. It is
    not theirs: progress is relative to the farthest of this rollout's futures that passes all
    gates instead of a privileged planner's; the direction counts along the path; time to collision
    is that of `ttc`; and it spans the rollout's horizon instead of 4 s. Needs a World and a path.
    """
    gates = 1.0 - at_fault_collision(view).values
    gates = gates * keeps_to_road(view)
    back = backwards(view).values
    gates = gates * np.where(back <= _BACK_M[0], 1.0, np.where(back <= _BACK_M[1], 0.5, 0.0))
    ratio = relative_progress(view, np.where(gates > 0.0, 1.0, 0.0))
    in_time = (ttc(view).values >= TTC_BOUND_S).astype(np.float64)
    mean = (
        TTC_WEIGHT * in_time + PROGRESS_WEIGHT * ratio + COMFORT_WEIGHT * comfortable(view).values
    ) / (TTC_WEIGHT + PROGRESS_WEIGHT + COMFORT_WEIGHT)
    return view.measure(gates * mean)


def relative_progress(view: RolloutView, gates: Array) -> Array:
    """Return progress (S,) as a share of the most that is made, times `gates` (S,), by any."""
    way = np.maximum(progress(view).values, 0.0)
    farthest = float(np.max((way * gates)[view.valid], initial=0.0))
    if farthest <= _LEAST_PROGRESS_M:
        return np.ones_like(way)
    return np.asarray(np.minimum(way / farthest, 1.0))
