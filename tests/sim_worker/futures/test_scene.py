"""What a job's fields do to its futures: faults, perception, lights, and who was detected."""

from __future__ import annotations

import gc

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.futures import Future, Job, PathAhead, SeenRoadUser
from foretwin.contracts.signals import LearntSignal
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, happening, job, state_at
from tests.sim_worker.road_users.crossroads import crossroads as mapped_crossroads
from tests.sim_worker.road_users.crossroads import straight_on

COVERS = (
    "foretwin.sim_worker.futures.lights",
    "foretwin.sim_worker.futures.measuring",
    "foretwin.sim_worker.futures.play",
)

CAR = load_vehicle()
STANDING_LEAD = {"lead__speed_mps": 0.0, "lead__gap_m": 30.0}


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), CAR, nsim=8)


def faulty(index: int, **faults: float) -> Future:
    return Future(index=index, name=str(index), numbers=faults)


def test_who_believes_to_be_farther_left_drives_farther_right(stage: BatchSimulation) -> None:
    futures = (faulty(0), faulty(1, position_offset_m=0.6))
    states = run_job(job(futures), stage).trajectory.states
    assert states[1, -1, 1] - states[0, -1, 1] == pytest.approx(-0.6, abs=0.05)


def test_a_steering_offset_draws_a_car_aside_and_half_the_steering_turns_less(
    stage: BatchSimulation,
) -> None:
    aside = state_at(-50.0, -0.5)
    shift = Future(index=0, name="shift", numbers={"lateral_shift_m": 2.0})
    weak = msgspec.structs.replace(shift, index=1, numbers=shift.numbers | {"steering_gain": 0.5})
    crooked = faulty(2, steering_offset_rad=0.02)
    states = run_job(job((shift, weak, crooked), state=aside, horizon_s=2.0), stage)
    y = states.trajectory.states[:, 10, 1]
    assert y[0] - 0.05 > y[1] > -0.5
    assert states.trajectory.states[2, 10, 1] > -0.45, "0.02 rad to the left, for a second"


def test_weak_brakes_end_in_the_car_ahead(stage: BatchSimulation) -> None:
    # From 20 m/s, 45 m behind somebody who stands, good brakes just do.
    ahead = {"lead__speed_mps": 0.0, "lead__gap_m": 45.0}
    sound = happening(0, "lead_stopping", **ahead)
    weak = msgspec.structs.replace(
        happening(1, "lead_stopping", **ahead), numbers={"brake_gain": 0.3}
    )
    state = state_at(-59.0, -1.5, speed=18.0)
    outcome = run_job(job((sound, weak), state=state, cruise=18.0), stage).outcome
    assert outcome.collision_with.tolist() == [0, 1]


def test_who_sees_late_or_nothing_brakes_late_or_not_at_all(stage: BatchSimulation) -> None:
    seen = happening(0, "lead_stopping", **STANDING_LEAD)
    late = happening(1, "lead_stopping", faults__perception_delay_s=1.0, **STANDING_LEAD)
    blind = happening(
        2, "lead_stopping", faults__lost_from_s=0.0, faults__lost_for_s=9.0, **STANDING_LEAD
    )
    result = run_job(job((seen, late, blind)), stage)
    assert result.outcome.collision_with.tolist()[::2] == [0, 1]
    speed = result.trajectory.states[:, 20, 3]
    # A lead that always stood is seen where it stands, however late.
    assert speed[1] == pytest.approx(speed[0], abs=0.2)
    assert speed[2] > speed[0] + 0.5


def detected(**changes: object) -> SeenRoadUser:
    car = SeenRoadUser(
        kind="car", x_m=-20.0, y_m=-1.5, yaw_rad=0.0, speed_mps=0.0, length_m=4.5, width_m=1.8
    )
    return msgspec.structs.replace(car, **changes)


def with_users(question: Job, *users: SeenRoadUser) -> Job:
    return msgspec.structs.replace(question, road_users=users)


def test_detected_road_users_are_part_of_every_future(stage: BatchSimulation) -> None:
    futures = (faulty(0), Future(index=1, name="careless", planner="constant_speed"))
    result = run_job(with_users(job(futures), detected()), stage)
    assert result.outcome.collision_with.tolist() == [0, 1]
    assert result.road_users.poses.shape[2] == 1
    stands = result.road_users.poses[:, :, 0, :2]
    assert np.ptp(stands, axis=1).max() == 0.0


def test_a_detected_car_goes_on_along_its_lane_and_a_walker_straight_on(
    stage: BatchSimulation,
) -> None:
    driver = detected(x_m=1.5, y_m=-60.0, yaw_rad=np.pi / 2, speed_mps=6.0)
    walker = detected(kind="pedestrian", x_m=-30.0, y_m=12.0, yaw_rad=0.3, speed_mps=1.5)
    result = run_job(
        with_users(job((faulty(0),), state=state_at(-59, -1.5)), driver, walker), stage
    )
    poses = result.road_users.poses[0]
    assert poses[:, 0, 0] == pytest.approx(np.full(81, 1.5), abs=0.2)
    assert poses[-1, 0, 1] > -30.0
    moved = poses[-1, 1, :2] - poses[0, 1, :2]
    assert moved == pytest.approx(12.0 * np.array([np.cos(0.3), np.sin(0.3)]), abs=0.05)


@pytest.fixture(scope="module")
def lit(tmp_path_factory: pytest.TempPathFactory) -> World:
    return mapped_crossroads(tmp_path_factory.mktemp("map"), centre={"highway": "traffic_signals"})


def approach(world: World) -> tuple[Job, SceneMaker, BatchSimulation]:
    """A job that drives east towards the lights, which are 60 m away."""
    path = straight_on(world, (1.0, 0.0))
    arc = float(path.locate(np.zeros((1, 2))).arc_m[0]) - 60.0
    pose = path.pose_at(np.array([arc]))
    start = np.array([[*pose.xy_m[0], pose.yaw_rad[0], 9.0, 0.0, 0.0, 0.0, 0.0]])
    arcs = np.arange(0.0, path.length_m)
    question = Job(
        round_id=0, job_index=0, world_id=world.id, state=state_at(0.0, 0.0),
        path=PathAhead(xy_m=path.point_at(arcs), speed_limit_mps=np.full(len(arcs), 13.9)),
        futures=(Future(index=0, name="a"),), horizon_s=12.0, step_s=0.1, seed=0,
        cruise_speed_mps=9.0, starts=start,
    )  # fmt: skip
    return question, SceneMaker(world), BatchSimulation(world, CAR, nsim=1)


@pytest.mark.parametrize(("colour", "stops"), [("red", True), ("green", False), ("dark", False)])
def test_lights_that_are_heard_are_obeyed(lit: World, colour: str, stops: bool) -> None:
    question, scenes, stage = approach(lit)
    groups = scenes.scene(question, CAR, tick_s=0.05).rules.groups
    heard = tuple(SignalState(stamp_ns=0, group_id=g, colour=colour) for g in groups)  # type: ignore[arg-type]
    result = run_job(msgspec.structs.replace(question, signals=heard), stage, scenes=scenes)
    end = result.trajectory.states[0, -1]
    assert (end[3] < 0.3) == stops
    front_m = end[0] + CAR.length_m.value - CAR.rear_overhang_m.value
    assert (front_m < -4.0) == stops, "it stands before the junction"


@pytest.mark.parametrize(
    ("shown", "changes_s", "stops"),
    [("red", 4.0, False), ("red", 40.0, True), ("green", 2.0, True), ("green", 40.0, False)],
)
def test_a_learnt_cycle_tells_when_lights_change(
    lit: World, shown: SignalColour, changes_s: float, stops: bool
) -> None:
    question, scenes, stage = approach(lit)
    groups = scenes.scene(question, CAR, tick_s=0.05).rules.groups
    other: SignalColour = "green" if shown == "red" else "red"
    learnt = tuple(
        LearntSignal(
            group_id=g, begins_ns=question.state.stamp_ns, cycle_s=100.0, cycles=3, spread_s=0.1,
            from_s=(0.0, changes_s), colours=(shown, other),
        )
        for g in groups
    )  # fmt: skip
    heard = tuple(SignalState(stamp_ns=0, group_id=g, colour=shown) for g in groups)
    asked = msgspec.structs.replace(
        question, signals=heard, learnt_signals=learnt, metrics=("red_light_violations",)
    )
    result = run_job(asked, stage, scenes=scenes)
    assert (result.trajectory.states[0, -1, 3] < 0.3) == stops
    assert result.metrics["red_light_violations"].tolist() == [0.0]


def test_a_plan_that_no_map_tells_stops_nobody_unless_asked_for(lit: World) -> None:
    question, scenes, stage = approach(lit)
    free = run_job(question, stage, scenes=scenes).trajectory.states[0, :, 3]
    assert free.min() > 7.0
    slowest = []
    for drive_time_s in np.arange(0.0, 60.0, 10.0):
        asked = msgspec.structs.replace(
            question, lights_by_plan=True, drive_time_s=float(drive_time_s)
        )
        slowest.append(run_job(asked, stage, scenes=scenes).trajectory.states[0, :, 3].min())
    assert min(slowest) < 0.5, "at some time of the cycle it is red"
    assert max(slowest) > 7.0, "and at another green"


def test_an_unknown_scenario_names_those_that_the_job_defines(stage: BatchSimulation) -> None:
    future = Future(index=0, name="x", scenario_id="flood")
    question = msgspec.structs.replace(job((faulty(0),)), futures=(future,))
    with pytest.raises(ValueError, match="scenario 'flood'; the job defines none"):
        run_job(question, stage)


def test_metrics_that_a_job_names_come_back_for_every_future(stage: BatchSimulation) -> None:
    futures = (faulty(0), happening(1, "lead_stopping", planner="constant_speed", **STANDING_LEAD))
    question = msgspec.structs.replace(job(futures), metrics=("ttc", "max_jerk", "on_road"))
    metrics = run_job(question, stage).metrics
    assert set(metrics) == {"ttc", "max_jerk", "on_road"}
    assert np.isinf(metrics["ttc"][0])
    assert metrics["ttc"][1] < 0.2
    with pytest.raises(ValueError, match="unknown metric fame"):
        run_job(msgspec.structs.replace(question, metrics=("fame",)), stage)


def test_what_a_job_needed_is_gone_with_it(stage: BatchSimulation) -> None:
    crossing = happening(1, "cccscp", planner="pure_pursuit_idm")
    lead = happening(2, "lead_stopping", planner="constant_speed", **STANDING_LEAD)
    question = job((faulty(0), crossing, lead))
    run_job(question, stage)
    gc.collect()
    gc.disable()
    try:
        run_job(question, stage)
        assert gc.collect() == 0, "what holds itself stays until garbage is sought"
    finally:
        gc.enable()


def test_a_worlds_first_job_makes_nothing_that_its_scenes_have_ready(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenes = SceneMaker(crossroads())
    scenes.warm_up()

    def made_again(*_: object) -> None:
        raise AssertionError("made by a job")

    for where, name in (
        ("futures.scene", "DrivableGround"),
        ("futures.scene", "LaneAreas"),
        ("futures.scene", "opaque_grid"),
        ("scenarios.roads", "Walls"),
    ):
        monkeypatch.setattr(f"foretwin.sim_worker.{where}.{name}", made_again)
    asked = msgspec.structs.replace(
        job((happening(0, "occluded_pedestrian"),)), metrics=("on_road", "epdms")
    )
    stage = BatchSimulation(crossroads(), CAR, nsim=1)
    assert run_job(asked, stage, scenes=scenes).metrics["on_road"] == 1.0
    with pytest.raises(AssertionError, match="made by a job"):
        run_job(asked, stage, scenes=SceneMaker(crossroads()))
