"""The Worlds where a given route begins are asked for before the vehicle is told to go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.start_worlds import junctions_at_start, prepare_start
from foretwin.orchestrator.routing.route_ahead import WayAhead
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


@pytest.mark.parametrize(
    ("route", "start_s", "asked"),
    [("from-log", 30.0, 1), (None, 0.0, 1), ("route.gpx", 30.0, 0)],
    ids=["a log's own route begins where the car does", "the route's start", "a file's may not"],
)
def test_first_worlds_are_made_where_the_car_starts_on_its_route(
    tmp_path: Path, route: str | None, start_s: float, asked: int
) -> None:
    plan = town_plan(tmp_path)
    config = msgspec.structs.replace(plan.config, route=route, start_s=start_s)
    house = House(tmp_path, at_once=True, plan=replace(plan, config=config))
    prepare_start(house.plan, house.conductor, look_after=lambda *_: None, stop=lambda: False)
    assert len(house.builder.asked) == asked
    house.tables.close()
