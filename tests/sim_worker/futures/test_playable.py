"""Where scenarios can be played: what is placed is what a job plays, and refusals say why."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Job
from foretwin.contracts.world import Area, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.playable import job_at, places, playable
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.futures.swept_ground import met_on_the_way
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.fitting import LEAST_RUN_UP_S
from foretwin.sim_worker.scenarios.places import Unplaced
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import box
from tests.sim_worker.scenarios.worlds import after_a_bend, cross, tee
from tests.world_gen.drawn_maps import drawn_map, world_of

COVERS = ("foretwin.sim_worker.futures.swept_ground",)

CAR = load_vehicle()


def with_house(world: World, x: float, y: float, half_m: float = 2.0) -> World:
    return msgspec.structs.replace(world, buildings=(box(x, y, half_m, half_m),))


@pytest.mark.parametrize("id_", ["ccftap", "latency", "ltip"])
def test_a_job_plays_what_was_placed_and_meets_what_was_promised(id_: str) -> None:
    scenario, world = catalogue()[id_], cross()
    found = places(scenario, world, vehicle=CAR, most=1)
    played = [case for case in found.cases[0] if isinstance(case, StagedCase)]
    job = job_at(found.places[0], scenario, [case.values for case in played], world)
    job = msgspec.structs.replace(job, accidents=True)
    result = run_job(job, BatchSimulation(world, CAR, nsim=len(played)))
    assert result.unplaced == ()
    assert result.planned is not None
    assert result.planned.met == tuple(case.impact_with for case in played)
    assert np.nanmax(result.planned.off_m) <= 0.1
    assert not np.isnan(result.planned.off_m).any()


@pytest.mark.parametrize("late_s", [-0.3, 0.01, 2.0])
def test_who_is_early_or_late_is_so_by_the_line_that_a_car_really_drives(late_s: float) -> None:
    scenario, world = catalogue()["latency"], cross()
    found = places(scenario, world, vehicle=CAR, most=1)
    on_time = found.cases[0][-1]
    assert isinstance(on_time, StagedCase)
    values = on_time.values | {"walker.arrives_after_s": late_s}
    (late,) = playable(scenario, [values], found.places[0], SceneMaker(world), rehearsal_stage(CAR))
    assert isinstance(late, StagedCase)
    assert late.impact_with == ""
    there = [
        case.actors[0]
        .moving(FrenetPath(case.actors[0].xy_m))
        .rectangles(np.array([case.actors[0].start_arc_m + case.actors[0].speed_mps * after_s]))
        for case, after_s in ((on_time, on_time.meets_s), (late, late.meets_s + late_s))
    ]
    np.testing.assert_allclose(there[0].centre_m, there[1].centre_m, atol=0.05)
    ego_m = [case.ego_arc_m + case.ego_speed_mps * case.meets_s for case in (on_time, late)]
    assert ego_m[0] == pytest.approx(ego_m[1], abs=0.05)


def test_what_becomes_of_a_case_does_not_depend_on_those_beside_it() -> None:
    scenario, world = catalogue()["ccftap"], cross()
    together = places(scenario, world, vehicle=CAR, most=1)
    for values, case in zip(draw_cases(scenario), together.cases[0], strict=True):
        alone = places(scenario, world, vehicle=CAR, cases=[values], most=1).cases[0][0]
        assert isinstance(case, StagedCase)
        assert isinstance(alone, StagedCase)
        assert alone.impact_time_s == case.impact_time_s
        assert alone.actors[0].start_arc_m == case.actors[0].start_arc_m


def test_a_case_that_no_job_can_play_is_listed_with_the_same_words() -> None:
    """Too fast for the bend: the job refuses what the placement refuses."""
    scenario, world = catalogue()["latency"], cross()
    fast = [{**draw_cases(scenario)[0], "ego.speed_mps": 10.0}]
    found = places(scenario, world, vehicle=CAR, cases=fast, most=1)
    assert not found.places
    reason = found.unplaced[0].reason
    assert found.unplaced[0].applies
    slow = places(scenario, world, vehicle=CAR, most=1).places[0]
    job: Job = job_at(slow, scenario, fast, world)
    assert run_job(job, BatchSimulation(world, CAR, nsim=1)).unplaced == ((0, reason),)


def test_nobody_drives_through_a_house() -> None:
    """The east arm, way 11, is built over: nobody comes out of it."""
    scenario = catalogue()["scp"]
    free = [place.name for place in places(scenario, cross(), vehicle=CAR).places]
    built = places(scenario, with_house(cross(), 14.0, 0.0), vehicle=CAR)
    left = [place.name for place in built.places]
    assert len(free) == 4
    assert left == [name for name in free if "w11.0.1.b0>" not in name] != free


def test_a_vehicle_needs_room_beside_houses() -> None:
    """A lane's middle lies 1.4 m from the road's; the house begins 0.5 m beside the ego."""
    scenario, world = catalogue()["steering_fault"], cross()
    place = places(scenario, world, vehicle=CAR, most=1).places[0]
    x, y = place.ego.path.point_at(np.array([place.ego.entry_m - 8.0]), 0.9 + 0.5 + 2.0)[0]
    beside = places(scenario, with_house(world, x, y), vehicle=CAR)
    assert place.name not in [one.name for one in beside.places]


def test_nobody_is_placed_on_what_was_cut_of_a_house() -> None:
    """The lane was cleared of it: nothing else stands near."""
    scenario, world = catalogue()["steering_fault"], cross()
    place = places(scenario, world, vehicle=CAR, most=1).places[0]
    before = np.array([place.ego.entry_m - 8.0])
    for beside_m, stays in ((0.5, False), (1.2, True)):
        x, y = place.ego.path.point_at(before, 0.9 + beside_m + 0.7)[0]
        away = Area(id="w20", outline=box(x, y, 0.7, 0.7).outline)
        cleared = msgspec.structs.replace(world, cut_away=(away,))
        found = places(scenario, cleared, vehicle=CAR)
        assert (place.name in [one.name for one in found.places]) == stays


def test_a_van_is_passed_with_the_same_room_where_the_ego_cuts_a_bend_either_way() -> None:
    """It is parked beside the line that a car drives, a third of a metre off its path there."""
    scenario, rooms_m = catalogue()["occluded_pedestrian"], []
    for left in (1.0, -1.0):
        world = after_a_bend(left)
        found = places(scenario, world, vehicle=CAR, most=1)
        case = found.cases[0][1]
        assert isinstance(case, StagedCase)
        assert case.ego_speed_mps == pytest.approx(11.111)
        result = run_job(
            job_at(found.places[0], scenario, [case.values], world),
            BatchSimulation(world, CAR, nsim=1),
        )
        before = result.trajectory.time_s < case.impact_time_s
        ego = ego_rectangles(CAR, result.trajectory.states[0])
        van = result.road_users.poses[0, :, 1]
        box = Rectangles(van[:, :2], van[:, 2], *result.road_users.size_m[0, 1])
        rooms_m.append(float(clearance(ego, box)[before].min()))
    assert min(rooms_m) > 0.3
    assert rooms_m[0] == pytest.approx(rooms_m[1], abs=0.1)


def test_who_is_parked_where_the_ego_really_drives_is_in_its_way() -> None:
    """On its path nothing is touched; a car that drives a metre beside it touches the van."""
    case = places(catalogue()["occluded_pedestrian"], cross(), vehicle=CAR, most=1).cases[0][0]
    assert isinstance(case, StagedCase)
    assert met_on_the_way(case, None, CAR, horizon_s=8.0) == ""
    aside = case._replace(ego_lateral_m=-case.place.near_sign)
    assert met_on_the_way(aside, None, CAR, horizon_s=8.0) == (
        "the ego would touch parked_van on its way"
    )


def test_streets_that_are_too_short_are_no_run_up() -> None:
    scenario = catalogue()["rtip"]
    ends = {0: (0.0, 0.0), 1: (25.0, 0.0), 2: (-25.0, 0.0), 3: (0.0, -100.0)}
    street = {"highway": "residential", "maxspeed": "50"}
    streets = [(10 + i, [i, 0], {**street, "name": f"Arm {i}"}) for i in (1, 2, 3)]
    (cases,) = places(scenario, world_of(drawn_map(ends, streets)), vehicle=CAR).cases
    reasons = {case.reason for case in cases if isinstance(case, Unplaced)}
    assert reasons == {"a road leaves less than 2.5 s before the impact"}
    played = [case for case in cases if isinstance(case, StagedCase)]
    assert min(case.impact_time_s for case in played) >= LEAST_RUN_UP_S
    far = ends | {1: (120.0, 0.0), 2: (-120.0, 0.0)}
    (all_,) = places(scenario, world_of(drawn_map(far, streets)), vehicle=CAR).cases
    assert len(played) < sum(isinstance(case, StagedCase) for case in all_)


def test_a_road_that_is_too_slow_is_none_that_a_scenario_is_for() -> None:
    """On 30 km/h nobody drives 50: the scenario does not apply, which is no failure to place it."""
    found = places(catalogue()["lead_stopping"], tee(), vehicle=CAR)
    assert found.unplaced == (
        Unplaced("n0", "the ego would drive 50 km/h on a road of 30 km/h", False),
    )
