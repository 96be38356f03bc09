"""A car that is beside its path stays so in its futures, but aims at nothing that stands there."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.beside_road import Building
from foretwin.contracts.futures import COLLISION_WITH, Future, FuturesResult
from foretwin.contracts.world import Area
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.clear_offsets import ROOM_M, clear_offsets_m
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.scenarios.impact import ego_box
from foretwin.sim_worker.scenarios.walls import Walls
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.ground.islands import RING_ISLAND
from tests.sim_worker.places import box, crossroads, job, state_at, straight_path

CAR = load_vehicle()
HALF_M = CAR.width_m.value / 2.0
PATH_Y_M = -1.5


def beside(x_m: float, edge_m: float) -> Building:
    """Return what stands to the left of the path at x, from `edge_m` beside it on."""
    return box(x_m, PATH_Y_M + edge_m + 1.0, 3.0, 1.0)


def kept_m(*standing: Building, offset_m: float, upto_m: float = 150.0) -> float:
    path = FrenetPath(straight_path().xy_m)
    walls = Walls(crossroads(buildings=standing))
    asked = np.array([offset_m])
    (found,) = clear_offsets_m(walls, ego_box(CAR, path, 10.0), asked, from_m=20.0, upto_m=upto_m)
    return float(found)


def played(*standing: Building, y_m: float) -> FuturesResult:
    world = crossroads(buildings=standing)
    nominal = Future(index=0, name="nominal")
    stage = BatchSimulation(world, CAR, nsim=1)
    return run_job(job((nominal,), state=state_at(-50.0, y_m, speed=8.0)), stage)


@pytest.mark.parametrize("offset_m", [-0.8, 0.0, 0.8])
def test_where_nothing_stands_a_car_stays_where_it_is(offset_m: float) -> None:
    assert kept_m(offset_m=offset_m) == offset_m
    assert kept_m(beside(0.0, HALF_M + 0.8 + ROOM_M + 0.1), offset_m=offset_m) == offset_m


def test_it_comes_as_near_to_what_stands_as_leaves_it_room() -> None:
    free_m = 0.45
    kept = kept_m(beside(0.0, HALF_M + free_m + ROOM_M), offset_m=0.8)
    assert free_m - 0.8 / 8.0 < kept <= free_m


def test_the_middle_of_a_ring_stops_cars_and_a_refuge_does_not() -> None:
    found = []
    for name in (RING_ISLAND, "island:refuge"):
        outline = beside(0.0, HALF_M + 0.45 + ROOM_M).outline
        world = msgspec.structs.replace(crossroads(), islands=(Area(id=name, outline=outline),))
        car = ego_box(CAR, FrenetPath(straight_path().xy_m), 10.0)
        asked = np.array([0.8])
        found += clear_offsets_m(Walls(world), car, asked, from_m=20.0, upto_m=150.0).tolist()
    assert found == [pytest.approx(0.4), 0.8]


def test_each_of_several_aims_stays_where_it_is_clear() -> None:
    walls = Walls(crossroads(buildings=(beside(0.0, HALF_M + 0.45 + ROOM_M),)))
    car = ego_box(CAR, FrenetPath(straight_path().xy_m), 10.0)
    asked = np.array([-0.9, 0.1, 0.3, 0.6, 0.8])
    found = clear_offsets_m(walls, car, asked, from_m=20.0, upto_m=150.0)
    np.testing.assert_allclose(found, [-0.9, 0.1, 0.3, 0.4, 0.4])


def test_what_stands_on_the_other_side_or_farther_on_moves_nobody() -> None:
    near = beside(0.0, HALF_M + 0.4)
    assert kept_m(near, offset_m=-0.8) == -0.8
    assert kept_m(near, offset_m=0.8, upto_m=50.0) == 0.8


def test_where_the_path_leads_into_a_house_the_map_is_wrong_and_the_car_stays() -> None:
    assert kept_m(beside(0.0, -0.5), offset_m=0.8) == 0.8


def test_who_would_drive_a_little_farther_left_aims_at_no_kerb_either() -> None:
    world = crossroads(buildings=(beside(0.0, HALF_M + 0.5),))
    shifted = Future(index=0, name="shift", numbers={"lateral_shift_m": 0.9})
    stage = BatchSimulation(world, CAR, nsim=1)
    result = run_job(job((shifted,), state=state_at(-50.0, PATH_Y_M, speed=8.0)), stage)
    assert COLLISION_WITH[int(result.outcome.collision_with[0])] == ""


def test_the_nominal_future_passes_an_island_that_the_cars_offset_leads_into() -> None:
    aside = PATH_Y_M + 0.7
    free, narrow = played(y_m=aside), played(beside(0.0, HALF_M + 0.5), y_m=aside)
    through = np.abs(free.trajectory.states[0, :, 0]) < 3.0
    np.testing.assert_allclose(free.trajectory.states[0, through, 1], aside, atol=0.05)
    assert through.any()
    assert COLLISION_WITH[int(narrow.outcome.collision_with[0])] == ""
    assert narrow.outcome.progress_m[0] == pytest.approx(free.outcome.progress_m[0], abs=1.0)
