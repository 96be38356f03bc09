from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.vehicle.clock import silence_step_clock
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered, drive, seed, states
from tests.sim_worker.places import box, crossroads

COVERS = (
    "foretwin.sim_worker.batch.model",
    "foretwin.sim_worker.batch.physics",
    "foretwin.sim_worker.vehicle.clock",
    "foretwin.sim_worker.vehicle.timestep",
)

CAR = load_vehicle()


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(None, CAR, nsim=8)


def test_the_profiling_clock_is_taken_out_of_the_step() -> None:
    assert silence_step_clock()


def test_a_seeded_future_keeps_steering_through_the_delay(stage: BatchSimulation) -> None:
    # Without its history filled, it would steer to 0 for the length of the delay.
    seed(stage, states(3, speed=8.0, tire=0.2), delay=[0.0, 0.25, 0.5])
    tire = drive(stage, 20, tire=0.2)[:, :, 6]
    assert tire == pytest.approx(np.full_like(tire, 0.2), abs=1e-3)


def test_a_command_acts_after_the_delay_and_not_before(stage: BatchSimulation) -> None:
    delays = np.array([0.0, 0.1, 0.3, 0.6])
    seed(stage, states(4, speed=8.0), delay=delays)
    tire = drive(stage, 20, tire=0.1)[:, :, 6]
    moved = (tire > 0.001).argmax(axis=1) * 0.05
    assert moved == pytest.approx(delays + 0.05, abs=0.051)
    assert (moved > delays).all()


def test_the_delay_is_the_same_however_long_the_car_has_driven(stage: BatchSimulation) -> None:
    """Read at sums of steps, a delay of whole steps was one more from 2.0 s to 16 s."""
    turned = []
    for ticks in (2, 60, 340):
        seed(stage, states(1, speed=8.0), delay=0.1)
        drive(stage, ticks, tire=0.0)
        turned.append(drive(stage, 6, tire=0.1)[0, :, 6])
    assert turned[1] == pytest.approx(turned[0], abs=1e-6)
    assert turned[2] == pytest.approx(turned[0], abs=1e-6)


def test_given_history_is_replayed(stage: BatchSimulation) -> None:
    history = np.zeros((1, 40))
    history[0, 20:] = 0.1
    stage.seed(
        states(1, speed=8.0),
        steering_delay_s=np.array([0.4]),
        friction_factor=np.ones(1),
        steering_history_rad=history,
    )
    tire = drive(stage, 12, tire=0.1)[0, :, 6]
    assert abs(tire[3]) < 1e-3
    assert tire[6] == pytest.approx(0.1, abs=0.01)


def test_a_delay_beyond_the_buffer_is_refused_and_not_shortened(stage: BatchSimulation) -> None:
    with pytest.raises(ValueError, match=r"steering delay 1\.1 s is longer than the buffer"):
        seed(stage, states(1), delay=1.1)


def test_fewer_states_than_simulations_give_the_same_as_a_full_stage(
    stage: BatchSimulation,
) -> None:
    rows = states(8, speed=np.linspace(2.0, 9.0, 8), tire=0.1)
    seed(stage, rows)
    full = drive(stage, 40, accel=0.5, tire=0.1)
    seed(stage, rows[:3])
    part = drive(stage, 40, accel=0.5, tire=0.1)
    assert full[:3].tobytes() == part.tobytes()


def test_what_a_stage_did_before_leaves_no_trace(stage: BatchSimulation) -> None:
    rows = states(8, speed=8.0)
    seed(stage, rows, delay=0.2)
    first = drive(stage, 40, accel=-1.0, tire=0.1)
    seed(stage, states(8, speed=20.0, tire=-0.3), delay=0.6, friction=0.3)
    drive(stage, 30, accel=2.0, tire=0.5)
    seed(stage, rows, delay=0.2)
    assert drive(stage, 40, accel=-1.0, tire=0.1).tobytes() == first.tobytes()


def test_futures_begun_anew_are_as_if_they_had_begun_alone(stage: BatchSimulation) -> None:
    rows = states(8, speed=np.linspace(2.0, 9.0, 8), tire=0.1)
    anew = states(2, speed=12.0, tire=-0.2)
    seed(stage, anew, delay=0.3, friction=0.6)
    alone = drive(stage, 20, accel=1.5, tire=0.1)
    seed(stage, rows, delay=0.1)
    undisturbed = drive(stage, 30, accel=1.5, tire=0.1)

    seed(stage, rows, delay=0.1)
    drive(stage, 10, accel=1.5, tire=0.1)
    stage.reseed(
        np.array([1, 6]),
        anew,
        steering_delay_s=np.full(2, 0.3),
        friction_factor=np.full(2, 0.6),
    )
    after = drive(stage, 20, accel=1.5, tire=0.1)

    others = [0, 2, 3, 4, 5, 7]
    assert after[[1, 6]].tobytes() == alone.tobytes()
    assert after[others][:, 1:].tobytes() == undisturbed[others][:, 11:].tobytes()


def test_threads_change_nothing(stage: BatchSimulation) -> None:
    rows = states(8, speed=np.linspace(1.0, 15.0, 8))
    seed(stage, rows)
    alone = drive(stage, 40, accel=0.3, tire=0.1)
    two = BatchSimulation(None, CAR, nsim=8, threads=2)
    seed(two, rows)
    assert drive(two, 40, accel=0.3, tire=0.1).tobytes() == alone.tobytes()


def test_a_wall_stops_the_car_and_is_felt() -> None:
    stage = BatchSimulation(crossroads(buildings=(box(30.0, 0.0, 2.0, 10.0),)), CAR, nsim=2)
    rows = states(2, speed=8.0)
    rows[1, 1] = 40.0
    seed(stage, rows)
    felt = np.zeros(2, dtype=bool)
    for _ in range(120):
        stage.step(Controls(np.zeros(2), np.zeros(2)))
        felt |= stage.static_contact
    assert felt.tolist() == [True, False]
    front = CAR.length_m.value - CAR.rear_overhang_m.value
    assert stage.states[0, 0] + front < 28.2
    assert stage.states[1, 0] > 45.0


def test_a_vehicle_changed_in_place_is_as_one_compiled_with_it() -> None:
    """Every number of the model, and where contacts are looked for."""
    vehicle = altered(
        CAR, mass_kg=1500.0, yaw_inertia_kgm2=2500.0, wheelbase_m=2.9, cog_from_rear_axle_m=1.5,
        steering_delay_s=0.2, steering_lag_s=0.1, max_tire_angle_rad=0.5, length_m=4.9,
        width_m=1.9, height_m=1.7, rear_overhang_m=1.1,
    )  # fmt: skip
    world = crossroads(buildings=(box(30.0, 0.0, 2.0, 10.0),))
    changed, anew = BatchSimulation(world, CAR, nsim=2), BatchSimulation(world, vehicle, nsim=2)
    changed.use_vehicle(vehicle)
    names = [name for name in dir(anew.model) if not name.startswith("_")]
    arrays = [name for name in names if isinstance(getattr(anew.model, name), np.ndarray)]
    assert len(arrays) > 200
    for name in arrays:
        assert np.array_equal(getattr(changed.model, name), getattr(anew.model, name)), name
    assert changed.model.stat.meaninertia == anew.model.stat.meaninertia
    runs = []
    for stage in (changed, anew):
        seed(stage, states(2, speed=8.0), delay=0.2)
        runs.append(drive(stage, 120, tire=0.01, accel=0.5))
        assert stage.states[:, 0].max() < 30.0
    assert np.array_equal(runs[0], runs[1])


def test_the_control_rate_must_fit_the_physics() -> None:
    with pytest.raises(ValueError, match="control rate 30 Hz"):
        BatchSimulation(None, CAR, nsim=1, control_hz=30.0)
    with pytest.raises(ValueError, match="9 states for a stage of 8"):
        seed(BatchSimulation(None, CAR, nsim=8), states(9))
