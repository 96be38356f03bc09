"""A car on a slope: what it loses, what holds it, and what its planners make of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlCommand
from foretwin.contracts.futures import Future
from foretwin.contracts.roles import FollowLimits
from foretwin.geometry.slopes import slopes_of
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.driver_model import HOLD_MPS2
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.mirror.member import GroupMember
from foretwin.sim_worker.mirror.mirror import Mirror
from foretwin.sim_worker.mirror.vehicle_group import VehicleGroup
from foretwin.sim_worker.vehicle.gravity import climb_mps2
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2, load_vehicle
from tests.sim_worker.driving import altered, drive, seed
from tests.sim_worker.hilly import hilly
from tests.sim_worker.places import FRAME, happening, job, state_at

CAR = altered(load_vehicle(), drag_npv2=0.0, rolling_resistance_n=0.0, drive_gain=1.0)
GRADE = 0.08
LOST_MPS2 = GRAVITY_MPS2 * math.sin(math.atan(GRADE))


def uphill(*, speed: float, x: float = 20.0, yaw: float = 0.0, count: int = 1) -> Array:
    rows = np.zeros((count, 8))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = x, -1.5, yaw, speed
    return rows


def stage(grade: float = GRADE, *, nsim: int = 1) -> BatchSimulation:
    return BatchSimulation(hilly(grade), CAR, nsim=nsim)


def test_a_rolling_car_loses_what_gravity_takes_along_its_heading() -> None:
    place = stage()
    effective = CAR.wheel_inertia_mass_factor.value
    for yaw, sign in ((0.0, -1.0), (math.pi, 1.0)):
        seed(place, uphill(speed=10.0, x=50.0, yaw=yaw))
        speed = drive(place, 20)[0, :, 3]
        assert speed[20] - speed[0] == pytest.approx(sign * LOST_MPS2 / effective, rel=0.01)


def test_a_car_square_to_the_slope_feels_none() -> None:
    place = stage()
    rows = uphill(speed=10.0, x=1.5)
    rows[:, 1], rows[:, 2] = 30.0, math.pi / 2
    seed(place, rows)

    assert drive(place, 20)[0, -1, 3] == pytest.approx(10.0, abs=1e-3)


def test_a_car_that_stands_is_held_by_its_brakes_and_rolls_back_without() -> None:
    place = stage(nsim=3)
    seed(place, uphill(speed=0.0, count=3))
    told = drive(place, 60, accel=np.array([HOLD_MPS2, -LOST_MPS2 * 1.05, 0.0]))

    assert np.abs(told[:2, :, :2] - told[:2, :1, :2]).max() < 1e-3
    assert told[2, -1, 3] < -1.5
    # As strongly as gravity pulls, a drive holds it as well.
    seed(place, uphill(speed=0.0, count=3))
    assert drive(place, 60, accel=LOST_MPS2)[0, -1, 0] == pytest.approx(20.0, abs=0.1)


def test_brakes_take_longer_downhill() -> None:
    place = stage(nsim=2)
    rows = uphill(speed=12.0, x=50.0, count=2)
    rows[1, 2] = math.pi
    seed(place, rows)
    speed = drive(place, 20, accel=-3.0)[:, 20, 3]

    effective = CAR.wheel_inertia_mass_factor.value
    assert speed[1] - speed[0] == pytest.approx(2.0 * LOST_MPS2 / effective, rel=0.02)


def test_the_same_car_in_a_flat_world_has_the_same_bits_as_one_without_heights() -> None:
    flat = BatchSimulation(None, CAR, nsim=1)
    assert flat.climb_mps2 is None
    assert climb_mps2(None, np.zeros((1, 8))) is None
    level = BatchSimulation(hilly(0.0), CAR, nsim=1)
    for place in (flat, level):
        seed(place, uphill(speed=8.0))
    assert (drive(flat, 40, accel=0.7) == drive(level, 40, accel=0.7)).all()


@pytest.mark.parametrize("planner", ["pure_pursuit_idm", "constant_speed", "frenet_lattice"])
@pytest.mark.parametrize("grade", [0.1, -0.1])
def test_planners_keep_their_speed_up_and_down_a_hill(planner: str, grade: float) -> None:
    futures = (Future(index=0, name="f", planner=planner),)
    speeds = []
    for climb in (0.0, grade):
        place = BatchSimulation(hilly(climb), load_vehicle(), nsim=1)
        speeds.append(run_job(job(futures), place).trajectory.states[0, :, 3])

    assert np.abs(speeds[1] - speeds[0]).max() < 0.35


def test_a_car_stops_before_the_same_line_up_and_down_a_hill() -> None:
    futures = (happening(0, "lead_stopping", lead__speed_mps=0.0, lead__gap_m=30.0),)
    ends = []
    for grade in (0.0, 0.1, -0.1):
        place = BatchSimulation(hilly(grade), load_vehicle(), nsim=1)
        states = run_job(job(futures, horizon_s=16.0), place).trajectory.states[0]
        ends.append(states[-1, 0])
        assert abs(states[-1, 3]) < 0.3
    assert max(ends) - min(ends) < 1.0


@pytest.mark.parametrize("commanded", [True, False])
def test_the_twin_climbs_as_its_car_does(commanded: bool) -> None:
    """A car holds 8 m/s uphill: by its own commands, or by those its motion asks for."""
    gaps = {}
    for grade in (GRADE, 0.0):
        mirror = Mirror(CAR, drive_frame=FRAME, commands_recorded=commanded, window_s=60.0)
        mirror.set_world(hilly(grade), from_stamp_ns=0)
        for k in range(251):
            t = k / 50.0
            if commanded:
                push = ControlCommand(
                    stamp_ns=round(t * 1e9), accel_mps2=LOST_MPS2, tire_angle_rad=0.0
                )
                mirror.handle_command(push)
            sample = mirror.handle_state(state_at(10.0 + 8 * t, -1.5, stamp_ns=round(t * 1e9)))
        assert sample is not None
        gaps[grade] = sample.gap_m
    assert gaps[GRADE] < 0.15
    # On a road that is thought to be level, the car's own commands would make it run away.
    assert not commanded or gaps[0.0] > 5.0


def test_slopes_are_asked_with_the_heading_that_is_known() -> None:
    slopes = slopes_of(hilly(GRADE))
    row = uphill(speed=8.0, yaw=math.pi)
    found = climb_mps2(slopes, row)
    assert found == pytest.approx([-LOST_MPS2])
    assert climb_mps2(slopes, row, np.array([[1.0], [0.0]])) == pytest.approx([LOST_MPS2])


def test_another_vehicle_s_twin_climbs_by_its_motion_as_well() -> None:
    group = VehicleGroup(hilly(GRADE), FRAME, (GroupMember("van", CAR),), limits=FollowLimits())
    group.set_roles({"van": "twin"})
    for k in range(251):
        t = k / 50.0
        group.take_state("van", state_at(10.0 + 8.0 * t, -1.5, stamp_ns=k * 20_000_000))
        group.advance(k * 20_000_000)

    assert group.members["van"].twin().pose[0] == pytest.approx(50.0, abs=0.3)
