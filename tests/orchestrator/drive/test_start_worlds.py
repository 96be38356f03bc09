"""The Worlds where a given route begins are asked for before the vehicle is told to go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.geometry.polyline import points_at
from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.start_worlds import (
    WITHIN_M,
    junctions_at_start,
    prepare_start,
    start_of,
    start_on,
)
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.routing.junctions_ahead import encounters
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.world_gen.junctions.intersections import Junction
from tests.orchestrator.house import House
from tests.orchestrator.trip import states_along, town, town_line, town_plan


@pytest.mark.parametrize(("within_m", "kinds"), [(10.0, []), (150.0, ["t_junction"])])
def test_only_the_beginning_of_a_route_counts(within_m: float, kinds: list[str]) -> None:
    inputs = town()
    found = junctions_at_start(inputs.routes[0], inputs.junctions, within_m)
    assert [junction.summary.kind for junction in found] == kinds


def test_what_was_asked_for_before_the_start_is_not_asked_for_again() -> None:
    inputs = town()
    way = WayAhead(inputs.graph, inputs.junctions, inputs.routes, index=inputs.index)
    mission = Mission(way, settings=MissionSettings())
    first = junctions_at_start(inputs.routes[0], inputs.junctions, 150.0)
    asked = mission.before_start(first, mono_s=0.0)
    assert [order.junction_id for order in asked] == [first[0].summary.id]  # type: ignore[union-attr]
    state = states_along(inputs.graph.frame, town_line())[0]
    again = [getattr(order, "junction_id", "") for order in mission.on_state(state, mono_s=1.0)]
    assert first[0].summary.id not in again


def test_what_is_asked_for_before_the_first_state_is_asked_when_the_drive_begins() -> None:
    inputs = town()
    way = WayAhead(inputs.graph, inputs.junctions, inputs.routes, index=inputs.index)
    mission = Mission(way, settings=MissionSettings(begins_s=640.0))
    first = junctions_at_start(inputs.routes[0], inputs.junctions, 150.0)
    mission.before_start(first, mono_s=0.0)
    assert mission.drive_time_s == 640.0
    assert mission.visits.latest(first[0].summary.id).seen.drive_time_s == 640.0
    state = states_along(inputs.graph.frame, town_line())[0]
    mission.start_stamp_ns = state.stamp_ns - 641 * 10**9
    mission.on_state(state, mono_s=1.0)
    assert mission.drive_time_s == 641.0


def asked_from(folder: Path, plan: DrivePlan) -> list[str]:
    """The junctions whose Worlds are asked for before a drive's car is let go."""
    house = House(folder, at_once=True, plan=plan)
    prepare_start(house.plan, house.conductor, look_after=lambda *_: None, stop=lambda: False)
    house.tables.close()
    return house.builder.asked


def replayed(folder: Path, *, route: str | None, start_s: float, at: int) -> DrivePlan:
    """A drive of a log that begins at one point of the town's route."""
    plan = town_plan(folder)
    config = msgspec.structs.replace(plan.config, route=route, start_s=start_s)
    lat, lon = geo_from_local(plan.graph.frame, town_line()[at])
    frame = LocalFrame(GeoPoint(float(lat), float(lon)))
    return replace(plan, config=config, log_file=folder / "log.mcap", drive_frame=frame)


@pytest.mark.parametrize(("route", "start_s"), [("from-log", 30.0), (None, 0.0), ("r.gpx", 0.0)])
def test_first_worlds_are_made_where_the_route_begins(
    tmp_path: Path, route: str | None, start_s: float
) -> None:
    plan = replayed(tmp_path, route=route, start_s=start_s, at=0)
    first = junctions_at_start(plan.routes[0], plan.junctions, WITHIN_M)
    assert asked_from(tmp_path, plan) == [junction.summary.id for junction in first]


def test_first_worlds_of_a_file_s_route_are_made_where_the_log_begins_on_it(tmp_path: Path) -> None:
    at_start = asked_from(tmp_path, replayed(tmp_path, route="r.gpx", start_s=0.0, at=0))
    later = replayed(tmp_path, route="r.gpx", start_s=30.0, at=len(town_line()) // 2)
    found = start_of(later)
    assert found is not None
    assert found.from_m == pytest.approx(later.routes[0].end_m / 2.0, rel=0.2)
    first = junctions_at_start(found.route, later.junctions, WITHIN_M, from_m=found.from_m)
    asked = asked_from(tmp_path, later)
    assert asked == [junction.summary.id for junction in first]
    assert asked != at_start


def test_a_log_that_begins_beside_the_given_route_has_no_first_worlds(tmp_path: Path) -> None:
    plan = replayed(tmp_path, route="r.gpx", start_s=30.0, at=0)
    away = GeoPoint(plan.drive_frame.origin.lat_deg + 0.01, plan.drive_frame.origin.lon_deg)
    assert asked_from(tmp_path, replace(plan, drive_frame=LocalFrame(away))) == []


def test_a_car_in_a_junction_has_its_world_and_those_ahead() -> None:
    inputs = town()
    (route,), junctions = inputs.routes, inputs.junctions
    junction_at = {node: junction for junction in junctions for node in junction.nodes}
    met = next(iter(encounters(route, junction_at)))
    ids = [junction_ids(route, junctions, met.centre_s_m + past_m) for past_m in (5.0, 30.0)]
    assert met.junction.summary.id in ids[0]
    assert met.junction.summary.id not in ids[1]


def junction_ids(route: Route, junctions: tuple[Junction, ...], from_m: float) -> list[str]:
    return [one.summary.id for one in junctions_at_start(route, junctions, 80.0, from_m=from_m)]


def test_where_a_route_comes_by_twice_it_is_begun_the_first_time() -> None:
    (route,) = town().routes
    there_and_back = Route((*route.edges, *(edge.back for edge in reversed(route.edges))))
    point = points_at(route.line(0, 0), 30.0)
    found = start_on([there_and_back], point)
    assert found is not None
    assert found.from_m == pytest.approx(30.0, abs=1.0)
