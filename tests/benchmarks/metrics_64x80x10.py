"""All metrics of 64 futures of 80 instants among 10 road users, against the 20 ms they may take."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Context, Rollout
from foretwin.sim_worker.metrics.table import METRICS
from tests.benchmarks.measuring import Measurement, cpu_minimum_s
from tests.sim_worker.metrics.junction import context
from tests.sim_worker.metrics.motions import (
    VEHICLE,
    Mover,
    states_of_centre,
    steady_poses,
    times,
)

FUTURES, INSTANTS = 64, 80
ALLOWED_S = 0.020
REPEATS = 40


def measure() -> Measurement:
    """Return CPU seconds of one call, its World and path prepared, as they are once per round."""
    rollout, given = scene()
    found = evaluate(rollout, context=given)
    if set(found) != set(METRICS) or not found["collided"].values.any():
        raise AssertionError("the scene leaves out metrics, or nobody is hit in it")
    seconds = cpu_minimum_s(lambda: evaluate(rollout, context=given), repeats=REPEATS)
    first = cpu_minimum_s(lambda: evaluate(scene()[0], context=scene()[1]), repeats=1)
    return Measurement(seconds, "CPU s", ALLOWED_S, {"world_and_path_too_s": first})


def scene() -> tuple[Rollout, Context]:
    """An ego that meanders over the crossroads with lights at 64 speeds, among crossing, oncoming,
    leading, following, beside and parked road users; two are missing half of the time."""
    time_s = times((INSTANTS - 1) * 0.1)
    random = np.random.default_rng(0)
    states = np.stack([states_of_centre(_ego(8.0 + 0.1 * k, time_s), time_s) for k in range(64)])
    others = (
        Mover(1.5, -35.0, np.pi / 2, 8.0), Mover(-1.5, 40.0, -np.pi / 2, 9.0),
        Mover(60.0, 1.5, np.pi, 10.0), Mover(90.0, 1.5, np.pi, 7.0), Mover(-25.0, -1.5, 0.0, 7.0),
        Mover(-60.0, -1.5, 0.0, 9.0), Mover(-20.0, -4.5, 0.0, 0.0), Mover(8.0, -4.0, 1.6, 1.4, 0.6),
        Mover(-4.0, -30.0, 1.2, 6.0), Mover(30.0, -6.0, 0.0, 0.0),
    )  # fmt: skip
    users = np.stack([steady_poses(other, time_s) for other in others], axis=1)
    jitter = random.normal(0.0, 0.5, (FUTURES, 1, len(others), 3)) * (1.0, 1.0, 0.05)
    moved = users[None] + jitter
    speeds = np.broadcast_to([o.speed for o in others], moved.shape[:3]).copy()
    moved[:, 40:, 8], moved[:, :40, 9] = np.nan, np.nan
    rollout = Rollout(
        time_s=time_s, states=states, users=moved, user_speed_mps=speeds,
        user_size_m=np.broadcast_to([(o.length, o.width) for o in others], (64, 10, 2)).copy(),
        valid=np.ones(FUTURES, dtype=bool), vehicle=VEHICLE,
    )  # fmt: skip
    given = context(lights=True, start_s=8.0)._replace(
        reference=states[20, :, :3] + 0.3, user_mass_kg=np.full((FUTURES, 10), 1500.0)
    )
    return rollout, given


def _ego(speed_mps: float, time_s: Array) -> Array:
    x = -45.0 + speed_mps * time_s
    y = -1.5 + 0.2 * np.sin(x / 9.0)
    return np.column_stack([x, y, np.arctan(0.2 / 9.0 * np.cos(x / 9.0))])
