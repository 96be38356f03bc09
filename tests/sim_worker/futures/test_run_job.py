from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import content_bytes, write_message
from foretwin.contracts.futures import Future, FuturesResult
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.metrics.displacement import distinct_count
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import (
    box,
    crossroads,
    happening,
    job,
    state_at,
    straight_path,
    turning_path,
)

COVERS = (
    "foretwin.sim_worker.futures.closed_loop",
    "foretwin.sim_worker.futures.job_accidents",
    "foretwin.sim_worker.vehicle.seeding",
)

CAR = load_vehicle()
PLANNERS = ("pure_pursuit_idm",)
NOMINAL = (Future(index=0, name="nominal"),)
ICE, LATE = {"friction_factor": 0.3}, {"extra_steering_delay_s": 0.4}
TOO_LATE = {"extra_steering_delay_s": 1.0}
HAPPENINGS = tuple(catalogue()[name] for name in ("scp", "cccscp", "lead_stopping", "cbta"))


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(buildings=(box(40.0, 20.0, 8.0, 8.0),)), CAR, nsim=64)


@pytest.fixture(scope="module")
def round_of_64() -> tuple[Future, ...]:
    return plan_futures(count=64, seed=0, planners=PLANNERS, scenarios=HAPPENINGS)


def _ends(result: FuturesResult) -> np.ndarray:  # type: ignore[type-arg]
    return result.trajectory.states[:, -1, :2]


@pytest.mark.parametrize(
    "setting",
    [
        {"state": state_at(-50.0, -1.5, speed=8.0)},
        {"state": state_at(-30.0, -1.5, speed=8.0), "path": turning_path()},
        {"state": state_at(-50.0, -1.5, speed=0.0)},
        {"state": state_at(-50.0, -1.5, speed=0.0), "cruise": 0.0},
        {"state": state_at(-50.0, -1.5, speed=13.0), "cruise": 13.9},
    ],
    ids=["straight", "turning", "standing", "standing without aim", "fast"],
)
def test_at_least_48_of_64_futures_end_apart(
    stage: BatchSimulation,
    round_of_64: tuple[Future, ...],
    setting: dict,  # type: ignore[type-arg]
) -> None:
    result = run_job(job(round_of_64, **setting), stage)
    assert result.outcome.valid.all()
    assert distinct_count(_ends(result)) >= 48


@pytest.mark.parametrize("seed", [1, 12345])
def test_futures_differ_with_any_seed(stage: BatchSimulation, seed: int) -> None:
    futures = plan_futures(
        count=64, seed=seed, planners=(*PLANNERS, "constant_speed"), scenarios=HAPPENINGS
    )
    result = run_job(job(futures), stage)
    assert distinct_count(_ends(result)) >= 48


def test_the_same_job_gives_the_same_bytes_again_and_on_another_stage(
    stage: BatchSimulation, round_of_64: tuple[Future, ...]
) -> None:
    question = job(round_of_64[:32], path=turning_path(), horizon_s=4.0)
    first = run_job(question, stage)
    run_job(job(round_of_64[32:], state=state_at(-20.0, -1.0, speed=3.0), horizon_s=1.0), stage)
    again = run_job(question, stage)
    other = run_job(question, BatchSimulation(stage.world, CAR, nsim=32, threads=2))
    assert content_bytes(first.trajectory) == content_bytes(again.trajectory)
    assert result_digest(first) == result_digest(again) == result_digest(other)


def test_another_process_computes_the_same_bytes(
    stage: BatchSimulation, round_of_64: tuple[Future, ...], tmp_path: Path
) -> None:
    question = job(round_of_64[:16], horizon_s=3.0)
    assert stage.world is not None
    write_message(question, tmp_path / "job")
    write_message(stage.world, tmp_path / "world")
    program = (
        "import sys; from pathlib import Path; from foretwin.contracts.codec import read_message;"
        "from foretwin.contracts.world import World;"
        "from foretwin.contracts.futures import Job;"
        "from foretwin.sim_worker.futures.result_digest import result_digest;"
        "from foretwin.sim_worker.futures.run_job import run_job;"
        "from foretwin.sim_worker.batch.batch_simulation import BatchSimulation;"
        "from foretwin.sim_worker.vehicle.parameters import load_vehicle; d = Path(sys.argv[1]);"
        "s = BatchSimulation(read_message(d / 'world', World), load_vehicle(), nsim=16);"
        "print(result_digest(run_job(read_message(d / 'job', Job), s)))"
    )
    there = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert there.stdout.strip() == result_digest(run_job(question, stage))


def test_a_future_does_not_depend_on_its_companions(
    stage: BatchSimulation, round_of_64: tuple[Future, ...]
) -> None:
    together = run_job(job(round_of_64[:32], horizon_s=4.0), stage).trajectory.states
    for chosen in (5, 7):
        alone = run_job(job((round_of_64[chosen],), horizon_s=4.0), stage).trajectory.states[0]
        assert alone == pytest.approx(together[chosen], abs=1e-4)


def test_a_future_keeps_the_cars_present_offset_from_the_path(stage: BatchSimulation) -> None:
    futures = (*NOMINAL, Future(index=1, name="shift", numbers={"lateral_shift_m": 0.5}))
    result = run_job(job(futures, state=state_at(-50.0, -0.8)), stage)
    assert result.trajectory.states[0, :, 1] == pytest.approx(np.full(81, -0.8), abs=0.02)
    assert result.trajectory.states[1, -1, 1] == pytest.approx(-0.3, abs=0.05)


def test_the_first_instant_is_the_seeding_state(stage: BatchSimulation) -> None:
    state = state_at(-40.0, -1.0, 0.05, 9.0, yaw_rate=0.02, tire_angle=0.01, accel=0.3)
    result = run_job(job(NOMINAL, state=state), stage)
    assert result.trajectory.time_s == pytest.approx(np.arange(81) * 0.1)
    start = result.trajectory.states[0, 0]
    assert start[[0, 1, 2, 3, 5, 6, 7]] == pytest.approx(
        [-40.0, -1.0, 0.05, 9.0, 0.02, 0.01, 0.3], abs=1e-5
    )


def test_a_turning_car_without_measured_steering_goes_on_turning(stage: BatchSimulation) -> None:
    state = state_at(0.0, 0.0, 0.0, 8.0, yaw_rate=0.4, tire_angle=None)
    start = run_job(job(NOMINAL, state=state), stage).trajectory.states[0]
    assert start[0, 6] == pytest.approx(np.arctan(CAR.wheelbase_m.value * 0.4 / 8.0), rel=0.02)
    assert start[1, 5] == pytest.approx(0.4, rel=0.05)


def test_only_drops_of_the_speed_limit_ahead_count(stage: BatchSimulation) -> None:
    path = straight_path()
    limits = np.where(path.xy_m[:, 0] < -20.0, 10.0, 5.0)
    slow = msgspec.structs.replace(path, speed_limit_mps=limits)
    end = run_job(job(NOMINAL, path=slow), stage).trajectory.states[0, -1, 3]
    assert end == pytest.approx(4.0, abs=0.4)


def test_low_friction_makes_a_future_slide_and_delay_makes_it_late(stage: BatchSimulation) -> None:
    futures = (
        Future(index=0, name="n", planner="constant_speed"),
        Future(index=1, name="ice", planner="constant_speed", numbers=ICE),
        Future(index=2, name="late", planner="constant_speed", numbers=LATE),
    )
    state = state_at(-20.0, -1.5, speed=9.0)
    question = job(futures, state=state, path=turning_path(), cruise=9.0, horizon_s=4.0)
    ends = _ends(run_job(question, stage))
    assert np.hypot(*(ends[1] - ends[0])) > 1.0
    assert np.hypot(*(ends[2] - ends[0])) > 0.1


def test_a_building_in_the_way_is_a_collision_with_a_building(
    round_of_64: tuple[Future, ...],
) -> None:
    walled = BatchSimulation(crossroads(buildings=(box(0.0, 0.0, 4.0, 20.0),)), CAR, nsim=8)
    outcome = run_job(job(NOMINAL), walled).outcome
    assert outcome.collided.tolist() == [True]
    assert outcome.collision_with.tolist() == [2]
    front = CAR.length_m.value - CAR.rear_overhang_m.value
    assert outcome.collision_time_s[0] == pytest.approx((50.0 - 4.0 - front) / 8.0, abs=0.15)


def test_after_a_collision_with_a_road_user_the_car_stands_where_it_happened(
    stage: BatchSimulation,
) -> None:
    futures = (*NOMINAL, happening(1, "cccscp", planner="constant_speed"))
    result = run_job(job(futures), stage)
    assert result.outcome.collision_with.tolist() == [0, 1]
    states = result.trajectory.states
    after = result.trajectory.time_s > result.outcome.collision_time_s[1] + 0.1
    assert after.sum() > 10
    assert np.ptp(states[1, after, :3], axis=0).max() == 0.0
    assert not states[1, after][:, [3, 4, 5, 7]].any()
    assert np.ptp(states[0, :, 0]) > 1.0


def test_an_accident_is_run_on_when_asked_for(stage: BatchSimulation) -> None:
    futures = (*NOMINAL, happening(1, "cccscp", planner="constant_speed"))
    result = run_job(job(futures, accidents=True), stage)
    (accident,) = result.accidents
    assert (accident.future, accident.road_user) == (1, 0)
    assert accident.time_s == pytest.approx(float(result.outcome.collision_time_s[1]))
    assert accident.ego_delta_v_mps > 1.0
    after = result.trajectory.time_s > accident.time_s
    moved = np.ptp(result.trajectory.states[1, after, :2], axis=0).max()
    assert moved > 0.5, "a car that was hit moves on"


def test_a_planned_impact_happens_where_it_was_planned(stage: BatchSimulation) -> None:
    """The car keeps its speed, and so does who crosses: they meet on the crossing."""
    hit = happening(0, "cccscp", planner="constant_speed", crossing_car__impact_share=0.5)
    outcome = run_job(job((hit,)), stage).outcome
    assert outcome.collision_with.tolist() == [1]
    late = happening(0, "cccscp", planner="constant_speed", crossing_car__arrives_after_s=3.0)
    assert run_job(job((late,)), stage).outcome.collision_with.tolist() == [0]


def test_a_scenario_behind_the_car_says_so(stage: BatchSimulation) -> None:
    state = state_at(40.0, -1.5)
    result = run_job(job((*NOMINAL, happening(1, "cccscp")), state=state), stage)
    assert result.left_out[0] == ""
    assert "no junction" in result.left_out[1] or "behind" in result.left_out[1]
    assert result.outcome.valid.all()


def test_a_diverged_future_is_marked_and_spoils_no_other(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    stage = BatchSimulation(crossroads(), CAR, nsim=2)
    futures = tuple(Future(index=i, name=str(i)) for i in range(2))
    sound = run_job(job(futures, horizon_s=2.0), stage)
    seed = stage.seed

    def seed_badly(states: np.ndarray, **others: np.ndarray) -> None:  # type: ignore[type-arg]
        states = states.copy()
        states[1, 3] = 1e200
        seed(states, **others)

    monkeypatch.setattr(stage, "seed", seed_badly)
    result = run_job(job(futures, horizon_s=2.0), stage)
    assert result.outcome.valid.tolist() == [True, False]
    assert np.isnan(result.outcome.progress_m[1])
    assert np.isnan(result.outcome.min_clearance_m[1])
    assert not result.outcome.collided[1]
    assert result.trajectory.states[0] == pytest.approx(sound.trajectory.states[0], abs=1e-6)
    # MuJoCo's warnings stand in the log and in no file of its own.
    assert "unstable" in caplog.text
    assert list(tmp_path.iterdir()) == []


def test_results_survive_the_codec(stage: BatchSimulation, round_of_64: tuple[Future, ...]) -> None:
    from foretwin.contracts.codec import decode, encode

    result = run_job(job(round_of_64[:8]), stage)
    back = decode(encode(result), FuturesResult).message
    assert result_digest(back) == result_digest(result)
    assert back.road_users.poses.dtype == np.float32
    assert back.outcome.collided.dtype == np.bool_


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"world_id": "elsewhere"}, "world elsewhere on a stage that holds crossroads"),
        ({"step_s": 0.07}, "step_s 0.07 must be a multiple"),
        ({"horizon_s": 0.05}, "horizon_s 0.05 must be a multiple"),
        ({"futures": NOMINAL * 65}, "65 states for a stage of 64"),
        ({"futures": (Future(index=0, name="x", planner="magic"),)}, "unknown planner 'magic'"),
        ({"futures": (Future(index=0, name="x", numbers=TOO_LATE),)}, "must be from 0 to 0.4"),
        ({"futures": (Future(index=0, name="x", numbers={"mood": 1.0}),)}, "'mood'; known"),
        ({"schema_version": 0}, "schema version 0; this foretwin plays version 1"),
        ({"anchor": "wall"}, "knows neither"),
        ({"model": {"mass": 1.0}}, "knows neither"),
        ({"control_hz": 50.0}, "50 control ticks a second on a stage of 20"),
        ({"state": state_at(0.0, 0.0, speed=float("nan"))}, "not finite"),
    ],
)
def test_a_job_that_cannot_be_done_says_why(
    stage: BatchSimulation,
    changes: dict,  # type: ignore[type-arg]
    said: str,
) -> None:
    with pytest.raises(ValueError, match=said):
        run_job(msgspec.structs.replace(job(NOMINAL), **changes), stage)
