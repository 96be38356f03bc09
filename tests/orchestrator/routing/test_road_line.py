"""Which line of the map is offered for the car's position, and where none is."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.world import DrivingSide
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.telemetry.estimator.map_aid import RoadLine
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge
from tests.orchestrator.grid_map import FRAME, drive, graph_of, grid, node, road
from tests.orchestrator.trip import states_along

ROUGH = {"position_std_m": 2.0, "yaw_std_rad": 0.01}
STREET = road(0, 1, 2, [(0.0, 0.0), (300.0, 0.0)])


def offered(
    edges: list[RoadEdge],
    *corners: tuple[float, float],
    side: DrivingSide = "right",
    routes: tuple[Route, ...] = (),
    speed_mps: float = 10.0,
    **said: object,
) -> list[tuple[VehicleState, RoadLine]]:
    """Return the lines offered to a car that drives along these corners, 2 m north of the way."""
    way = WayAhead(graph_of(edges, driving_side=side), (), routes)
    found = []
    for state in states_along(FRAME, drive(list(corners)), speed_mps=speed_mps):
        state = msgspec.structs.replace(state, **{**ROUGH, **said})
        if way.locate(state) is not None and (line := way.road_line(state)) is not None:
            found.append((state, line))
    return found


def place(line: RoadLine) -> np.ndarray:
    return local_from_geo(FRAME, line.position.lat_deg, line.position.lon_deg)


@pytest.mark.parametrize(("side", "left_m"), [("right", -1.5), ("left", 1.5)])
def test_a_line_lies_beside_the_car_in_the_middle_of_its_own_side(
    side: DrivingSide, left_m: float
) -> None:
    found = offered([STREET], (50.0, 2.0), (150.0, 2.0), side=side)

    assert len(found) == pytest.approx(100.0 / 5.0, abs=2)
    for state, line in found:
        here = local_from_geo(FRAME, state.position.lat_deg, state.position.lon_deg)
        assert place(line) == pytest.approx([here[0], left_m], abs=0.01)
        assert line.yaw_rad == pytest.approx(0.0, abs=1e-4)


@settings(max_examples=10, deadline=None)
@given(st.floats(-math.pi, math.pi))
def test_driven_the_other_way_the_line_lies_on_the_other_side(yaw_rad: float) -> None:
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    street = road(0, 1, 2, [(0.0, 0.0), tuple((300.0 * ahead).tolist())])
    way = (tuple((150.0 * ahead).tolist()), tuple((50.0 * ahead).tolist()))
    found = offered([street], *way)

    assert found
    for _, line in found:
        left = np.array([-ahead[1], ahead[0]])
        assert left @ place(line) == pytest.approx(1.5, abs=0.01)


def test_more_lanes_leave_more_unknown() -> None:
    spreads = []
    for count in (1.0, 2.0, 3.0):
        street = road(0, 1, 2, [(0.0, 0.0), (300.0, 0.0)], lanes=(count, count))
        spreads.append(offered([street], (50.0, -4.0), (80.0, -4.0))[0][1].spread_m)

    assert spreads[0] == pytest.approx(math.hypot(1.2, 0.4), abs=0.01)
    assert spreads[1] == pytest.approx(math.hypot(spreads[0], 1.5), abs=0.01)
    assert spreads[2] > spreads[1] + 0.5


@pytest.mark.parametrize(
    "said", [{"position_std_m": 0.02}, {"position_std_m": None}, {"yaw_valid": False}]
)
def test_nothing_is_offered_to_who_knows_better_or_nothing(said: dict[str, object]) -> None:
    assert offered([STREET], (50.0, 2.0), (150.0, 2.0), **said) == []


def test_nothing_is_offered_to_a_car_that_creeps() -> None:
    assert offered([STREET], (50.0, 2.0), (60.0, 2.0), speed_mps=1.0) == []


@pytest.mark.parametrize("beside_m", [6.0, 8.5])
def test_nothing_is_offered_where_another_road_runs_alike(beside_m: float) -> None:
    other = road(1, 3, 4, [(0.0, beside_m), (300.0, beside_m)], backward=False)

    assert offered([STREET, other], (50.0, 2.0), (150.0, 2.0)) == []


def test_a_road_far_off_or_of_the_other_direction_leaves_no_doubt() -> None:
    far = road(1, 3, 4, [(0.0, 30.0), (300.0, 30.0)])
    oncoming = road(2, 6, 5, [(300.0, 8.0), (0.0, 8.0)], backward=False)
    one_way = road(0, 1, 2, [(0.0, 0.0), (300.0, 0.0)], backward=False)

    assert len(offered([one_way, far, oncoming], (50.0, 0.0), (150.0, 0.0))) > 15


def test_nothing_is_offered_in_a_corner_of_the_route() -> None:
    town = grid(4, 3)
    into = next(e for e in town.edges if (e.start_node, e.end_node) == (node(0, 1), node(1, 1)))
    out = next(e for e in town.edges if (e.start_node, e.end_node) == (node(1, 1), node(1, 2)))
    route = Route((DirectedEdge(into, False), DirectedEdge(out, False)))
    corners = (20.0, 100.0), (100.0, 100.0), (100.0, 180.0)
    found = [place(line) for _, line in offered(list(town.edges), *corners, routes=(route,))]

    assert len(found) > 15
    assert min(np.hypot(*(at - [100.0, 100.0])) for at in found) > 10.0


def test_nothing_is_offered_in_a_tight_bend() -> None:
    arc = np.linspace(0.0, math.pi, 25)
    ring = [(40.0 * math.sin(a), 40.0 - 40.0 * math.cos(a)) for a in arc]

    assert offered([road(0, 1, 2, ring)], *ring) == []


def test_a_car_across_the_road_is_offered_nothing() -> None:
    """It turns into a yard that the map does not have."""
    assert offered([STREET], (150.0, -8.0), (150.0, 12.0)) == []


def test_a_given_route_and_the_predicted_way_offer_the_same() -> None:
    town = grid(5, 3)
    along = [edge for edge in town.edges if edge.name == "Row 1"]
    route = Route(tuple(DirectedEdge(edge, False) for edge in along))
    corners = (20.0, 98.0), (380.0, 98.0)
    predicted, given_ = (offered(list(town.edges), *corners, routes=r) for r in ((), (route,)))

    assert len(predicted) > 50
    assert [line for _, line in predicted] == [line for _, line in given_]
