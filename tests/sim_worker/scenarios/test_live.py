"""Scenarios around a car as it drives: who comes to meet it is on the World's roads, or nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.futures import FuturesResult
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.scenarios.live import KnownScenarios
from foretwin.sim_worker.scenarios.placement import PassageFinder
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.roads import Passage, RoadNetwork
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_region
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.places import crossroads, happening, job, state_at, straight_path
from tests.world_gen.drawn_maps import STREET, drawn_map


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), load_vehicle(), nsim=2)


def coming(stage: BatchSimulation, *, speed: float, late_s: float = 0.0) -> FuturesResult:
    """A car 59 m before the crossing, and who comes from the near side at 14 m/s to meet it."""
    values = {"crossing_car__speed_mps": 14.0, "crossing_car__arrives_after_s": late_s}
    case = happening(0, "cccscp", **values)
    return run_job(job((case,), state=state_at(-59.0, -1.5, speed=speed)), stage)


def test_who_meets_the_car_soon_is_on_the_roads_of_the_world(stage: BatchSimulation) -> None:
    result = coming(stage, speed=10.0)
    assert result.left_out == ("",)
    (begins,) = result.road_users.poses[0, 0, :, :2]
    assert np.hypot(*begins) < 141.0, "where its lane ends"


@pytest.mark.parametrize(("speed", "late_s"), [(2.0, 0.0), (4.0, 0.0), (10.0, 9.0)])
def test_who_would_begin_where_the_world_has_no_road_is_nowhere(
    stage: BatchSimulation, speed: float, late_s: float
) -> None:
    result = coming(stage, speed=speed, late_s=late_s)
    assert result.left_out == ("crossing_car would begin beyond the roads of the World",)
    assert not np.isfinite(result.road_users.poses).any()
    assert result.outcome.valid.all(), "the car drives all the same"


def test_the_car_ahead_stops_though_the_junction_is_behind_the_car(stage: BatchSimulation) -> None:
    case = happening(0, "lead_stopping")
    result = run_job(job((case,), state=state_at(4.0, -1.5, speed=10.0)), stage)
    assert result.left_out == ("",)
    (begins,) = result.road_users.poses[0, 0, :, :2]
    assert 5.0 < begins[0] - 4.0 < 60.0, "ahead on the car's own lane"
    assert begins[1] == pytest.approx(-1.5, abs=0.1)


def test_a_crossing_that_the_car_has_passed_is_left_out(stage: BatchSimulation) -> None:
    result = run_job(job((happening(0, "scp"),), state=state_at(7.0, -1.5, speed=10.0)), stage)
    assert result.left_out == ("the place of the impact is behind the car",)


@pytest.mark.parametrize(
    ("x", "speed", "left"),
    [
        (-40.0, 10.0, {"occluded_pedestrian", "cccscp", "lead_stopping"}),
        (-23.0, 10.0, {"cccscp", "lead_stopping"}),  # its walker is met at -12 m
        (-18.0, 1.0, {"occluded_pedestrian", "cccscp", "lead_stopping"}),
        (-2.0, 10.0, {"lead_stopping"}),
    ],
)
def test_what_can_take_place_is_ahead_of_the_car(x: float, speed: float, left: set[str]) -> None:
    path = straight_path()
    on = KnownScenarios(RoadNetwork(crossroads())).on(FrenetPath(path.xy_m), 0.0, load_vehicle())
    asked = [catalogue()[id_] for id_ in ("occluded_pedestrian", "cccscp", "lead_stopping", "ltip")]
    found = on.ahead(asked, ego_arc_m=x + 60.0, ego_speed_mps=speed)
    assert {one.id for one in found} == left


def test_of_two_junctions_on_a_path_the_next_one_counts() -> None:
    nodes = {n: (80.0 * n, 0.0) for n in range(-2, 4)} | {10: (0.0, 90.0), 11: (80.0, 90.0)}
    street = list(range(-2, 4))
    osm = drawn_map(nodes, [(1, street, STREET), (2, [0, 10], STREET), (3, [1, 11], STREET)])
    roads = RoadNetwork(build_region(osm, build_road_graph(osm), osm.bounds))
    finder = PassageFinder(roads)

    def next_junctions(passage: Passage, *arcs_m: float) -> list[str]:
        way = roads.way(passage)
        begin, end = way.path.point_at(np.array([way.entry_m, way.exit_m]))
        whole = FrenetPath(begin + np.linspace(-6.0, 8.0, 250)[:, None] * (end - begin))
        found = [finder.first_on(whole, arc_m) for arc_m in arcs_m]
        return [passage.junction_id for passage in found if passage is not None]

    straight = [p for p in roads.passages("n0") if p.turn == "straight"]
    east, west = sorted(straight, key=lambda passage: abs(passage.exit_heading_rad))
    assert next_junctions(east, 5.0, 125.0) == ["n0", "n1"]
    assert next_junctions(west, 5.0, 50.0, 125.0) == ["n1", "n0"]
