"""A future ends where it hits a road user."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future, FuturesResult
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.outcomes import OVERLAP_STEPS, Collisions
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, happening, job, state_at

METRICS = (
    "collided",
    "at_fault_collision",
    "progress",
    "max_deceleration",
    "pet",
    "driving_score",
)
FUTURES = (
    Future(index=0, name="nominal"),
    happening(1, "cccscp", planner="constant_speed"),
)


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), load_vehicle(), nsim=len(FUTURES))


def play(stage: BatchSimulation, x_m: float) -> FuturesResult:
    asked = job(FUTURES, state=state_at(x_m, -1.5, speed=8.0))
    return run_job(msgspec.structs.replace(asked, metrics=METRICS), stage)


def test_progress_and_metrics_end_at_the_collision(stage: BatchSimulation) -> None:
    result = play(stage, -50.0)
    states = result.trajectory.states
    driven_m = np.hypot(*(states[1, -1, :2] - states[1, 0, :2]))
    assert result.outcome.progress_m[1] == pytest.approx(driven_m, abs=1.0)
    assert result.outcome.progress_m[0] > driven_m + 10.0
    assert result.metrics["progress"].tolist() == pytest.approx(result.outcome.progress_m.tolist())
    assert result.metrics["max_deceleration"][1] < 1.0, "its stop is that of a picture"
    assert result.metrics["pet"][1] == 0.0, "both meet where their ways cross"


def test_outlines_have_overlapped_for_a_fifth_of_a_step_where_metrics_end() -> None:
    """A hit at an instant itself, as staged ones are, shows at the next one alone."""
    times = np.array([4.0, 3.99, 3.97, 3.92, 7.99, np.inf])
    hit = np.isfinite(times)
    found = Collisions(times, hit, touches=None, counts=hit)  # type: ignore[arg-type]
    ends = found.last_instants(81, step_s=0.1, after_steps=OVERLAP_STEPS)
    assert ends.tolist() == [41, 41, 40, 40, 80, 80]
    assert found.last_instants(81, step_s=0.1).tolist() == [40, 40, 40, 40, 80, 80]


def test_metrics_see_the_collision_wherever_between_two_instants_it_is(
    stage: BatchSimulation,
) -> None:
    phases = []
    for x_m in np.arange(-50.0, -49.2, 0.08):
        result = play(stage, float(x_m))
        assert result.outcome.collision_with.tolist() == [0, 1]
        assert result.metrics["collided"].tolist() == [0.0, 1.0]
        assert result.metrics["at_fault_collision"][1] == 1.0
        assert result.metrics["driving_score"][1] == 0.0
        phases.append(result.outcome.collision_time_s[1] / 0.1 % 1.0)
    assert np.ptp(phases) > 0.8
