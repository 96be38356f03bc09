"""One world of twins and boxes: what a twin drives into, by the roles of both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.roles import Role
from foretwin.sim_worker.mirror.role_world import RoleWorld
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered, states

COVERS = ("foretwin.sim_worker.mirror.twin_body",)
CAR = load_vehicle()
FRONT_M = CAR.length_m.value - CAR.rear_overhang_m.value


def driven_on(world: RoleWorld, *, ticks: int = 500) -> set[tuple[str, str]]:
    """Drive the car's twin at 8 m/s along the x axis; return who met whom."""
    twin = world.twins["car"]
    twin.seed(states(1, speed=8.0)[0])
    found: set[tuple[str, str]] = set()
    for _ in range(ticks):
        twin.command(accel_mps2=0.0, tire_angle_rad=0.0)
        world.step()
        twin.read()
        found |= world.contacts()
    return found


@pytest.mark.parametrize("role", ["shadow", "ghost"])
def test_a_shadow_20_m_ahead_stops_a_twin_and_a_ghost_does_not(role: Role) -> None:
    world = RoleWorld(None, {"car": CAR, "van": CAR}, commanded=frozenset({"car"}))
    world.set_role("car", "twin")
    world.set_role("van", role)
    world.place("van", np.array([20.0, 0.0, 0.0]))

    met = driven_on(world)

    state = world.twins["car"].state
    if role == "ghost":
        assert met == set()
        assert state[0] == pytest.approx(40.0, abs=0.01)
    else:
        assert met == {("car", "van")}
        assert state[0] + FRONT_M < 20.0 - CAR.rear_overhang_m.value + 0.3
        assert state[3] < 0.5


def test_a_twin_passes_through_the_shadow_of_its_own_car() -> None:
    world = RoleWorld(None, {"car": CAR}, commanded=frozenset({"car"}))
    world.set_role("car", "all")
    world.place("car", np.array([20.0, 0.0, 0.0]))

    assert driven_on(world) == set()
    assert world.twins["car"].state[0] == pytest.approx(40.0, abs=0.01)


def test_a_reset_keeps_boxes_where_they_are_and_forgets_the_rest() -> None:
    world = RoleWorld(None, {"car": CAR}, commanded=frozenset({"car"}))
    pose = np.array([3.0, -4.0, 2.5])
    world.place("car", pose)
    driven_on(world, ticks=3)
    first = world.twins["car"].state

    world.reset()

    assert world.box_pose("car") == pytest.approx(pose)
    driven_on(world, ticks=3)
    assert (world.twins["car"].state == first).all()


def test_a_nudge_moves_a_twin_in_its_own_axes_and_adds_speed() -> None:
    world = RoleWorld(None, {"car": CAR}, commanded=frozenset({"car"}))
    twin = world.twins["car"]
    start = states(1, speed=8.0)[0]
    start[2] = math.pi / 2
    twin.seed(start)

    twin.nudge(np.array([1.0, 0.5, 0.1]), faster_mps=0.25)

    moved = [start[0] - 0.5, start[1] + 1.0, start[2] + 0.1, 8.25]
    assert twin.state[:4] == pytest.approx(moved)


def test_other_parameters_count_from_the_next_step_on() -> None:
    world = RoleWorld(None, {"car": CAR}, commanded=frozenset({"car"}))
    driven_on(world, ticks=1)
    before = world.twins["car"].state
    weak = altered(CAR, brake_gain=0.5, brake_lag_s=0.0, accel_delay_s=0.0)
    world.use_vehicle("car", weak)
    twin = world.twins["car"]
    assert (twin.state == before).all()

    for _ in range(100):
        twin.command(accel_mps2=-4.0, tire_angle_rad=0.0)
        world.step()
        twin.read()

    assert twin.state[3] == pytest.approx(8.0 - 2.0, abs=0.4)
