"""The Worlds where a given route begins are asked for before the vehicle is told to go."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.start_worlds import junctions_at_start
from foretwin.orchestrator.routing.route_ahead import WayAhead
from tests.orchestrator.trip import states_along, town, town_line


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
