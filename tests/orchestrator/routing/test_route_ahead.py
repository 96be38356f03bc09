"""The way ahead of a car: which junctions, when, along which path, and at which speed."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    target_from_source,
)
from foretwin.contracts.tracks import DrivenTrack
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_ahead import MIN_PATH_M, WayAhead
from foretwin.orchestrator.routing.speed_ahead import MOST_BEND_MPS2, USUAL_BEND_MPS2
from foretwin.world_gen.roads.road_graph import DirectedEdge
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions, TurnRule
from tests.orchestrator.grid_map import FRAME, drive, graph_of, grid, junctions, road
from tests.orchestrator.routing.path_against_lanes import LanesOfWorld
from tests.orchestrator.trip import (
    states_along,
    town,
    town_line,
    town_world,
    world_named,
)

GRID = grid(5, 4)
CORNERS = junctions(GRID)
EMPTY = msgspec.structs.replace(world_named("empty", FRAME), lanes=(), connections=())


def driven(
    *corners: tuple[float, float], speed_mps: float = 10.0, routes: tuple[Route, ...] = ()
) -> WayAhead:
    """The way ahead of a car that has driven along these corners."""
    way = WayAhead(GRID, CORNERS, routes)
    for state in states_along(FRAME, drive(list(corners)), speed_mps=speed_mps):
        way.take_speed(state)
        way.locate(state)
    return way


def test_a_street_closed_to_cars_is_told_while_the_car_is_on_it() -> None:
    town = grid(4, 3, pedestrian=frozenset([1]))
    way = WayAhead(town, junctions(town), ())
    assert not way.closed_to_cars
    told = []
    for state in states_along(FRAME, drive([(10, 0), (290, 0)])):
        way.take_speed(state)
        way.locate(state)
        told.append(way.closed_to_cars)
    changes = np.flatnonzero(np.diff(told)) * 1.0  # at 10 m/s and 10 Hz a metre each
    assert changes == pytest.approx([90.0, 190.0], abs=8.0)


def test_the_way_that_is_predicted_keeps_to_turn_restrictions() -> None:
    second, north = GRID.edges[5], GRID.edges[20]
    only_left = TurnRule(1, GRID.edges[4].way_id, (), frozenset({north.way_id}), True, False)
    rules = TurnRestrictions({second.start_node: (only_left,)}, ())
    way = WayAhead(GRID, CORNERS, (), restrictions=rules)
    for state in states_along(FRAME, drive([(20, 100), (60, 100)])):
        way.locate(state)

    assert [ahead.junction.summary.id for ahead in way.junctions][:3] == ["n102", "n202", "n302"]


def test_junctions_come_in_order_with_distance_and_time() -> None:
    way = driven((110, 100), (150, 100))
    ids = [ahead.junction.summary.id for ahead in way.junctions[:2]]
    near, far = way.junctions[:2]

    assert ids == ["n103", "n104"]
    assert near.distance_m == pytest.approx(51.0, abs=2.0)
    assert far.distance_m - near.distance_m == pytest.approx(100.0, abs=1.0)
    assert 4.0 < near.in_s < 7.0
    assert far.in_s > near.in_s


def test_a_slower_car_is_there_later() -> None:
    slow, fast = (driven((110, 100), (150, 100), speed_mps=v) for v in (4.0, 12.0))

    assert slow.junctions[0].in_s > fast.junctions[0].in_s


def test_off_the_map_nothing_lies_ahead() -> None:
    way = driven((110, 100), (150, 100))
    away = states_along(FRAME, drive([(150, 100), (150, 160)]), start_s=4.0)
    located = [way.locate(state) for state in away]

    assert located[0] is not None
    assert located[-1] is None
    assert way.junctions == ()


def test_the_path_begins_behind_the_car_and_reaches_past_the_horizon() -> None:
    path = driven((110, 100), (150, 100)).path(EMPTY, speed_mps=10.0, horizon_s=8.0)
    assert path is not None

    assert path.xy_m[0] == pytest.approx([139.0, 98.5], abs=1.5)  # right of the middle
    length_m = np.hypot(*np.diff(path.xy_m, axis=0).T).sum()
    assert length_m > 8.0 * 18.0
    assert len(path.speed_limit_mps) == len(path.xy_m)
    assert path.speed_limit_mps == pytest.approx(50 / 3.6)


def test_the_same_path_in_another_frame() -> None:
    way = driven((110, 100), (150, 100))
    other = LocalFrame(GeoPoint(52.501, 13.403))
    moved = msgspec.structs.replace(EMPTY, frame=other)
    here = way.path(EMPTY, speed_mps=10.0, horizon_s=8.0)
    there = way.path(moved, speed_mps=10.0, horizon_s=8.0)
    assert here is not None
    assert there is not None

    back = target_from_source(FRAME, other, there.xy_m, np.zeros(len(there.xy_m)))
    np.testing.assert_allclose(back.xy_m, here.xy_m, atol=1e-3)
    assert not np.allclose(there.xy_m, here.xy_m, atol=50.0)


def test_in_a_world_the_path_follows_its_lanes() -> None:
    inputs = town()
    way = WayAhead(inputs.graph, inputs.junctions, inputs.routes, index=inputs.index)
    world = town_world("n4")
    lanes = LanesOfWorld(world)
    off_lanes, away = [], []
    for state in states_along(inputs.graph.frame, town_line()[:200]):
        way.locate(state)
        path = way.path(world, speed_mps=10.0, horizon_s=8.0)
        assert path is not None
        beside = lanes.beside(path)
        away.append(beside.away_m[beside.covered & ~beside.turning])
        assert np.isfinite(beside.away_m[beside.covered]).mean() > 0.95  # but near the World's edge
        off_lanes.append(way.off_lanes_m)

    every = np.concatenate(away)
    # Beside turns, where bends are driven as one, and not as the town draws them.
    assert every[np.isfinite(every)].max() < 0.35
    assert np.quantile(every[np.isfinite(every)], 0.95) < 0.2
    assert max(off_lanes) == 0.0
    empty = msgspec.structs.replace(world, id="empty", lanes=(), connections=())
    assert way.path(empty, speed_mps=10.0, horizon_s=8.0) is not None
    assert way.off_lanes_m > 50.0


def test_no_path_where_the_road_ends() -> None:
    street = graph_of([road(0, 1, 2, [(0, 0), (100, 0)])])
    way = WayAhead(street, (), ())
    for state in states_along(FRAME, drive([(20, 0), (78, 0)])):
        way.locate(state)
    assert way.path(EMPTY, speed_mps=10.0, horizon_s=8.0) is not None
    for state in states_along(FRAME, drive([(78, 0), (100 - MIN_PATH_M + 4, 0)]), start_s=5.8):
        way.locate(state)

    assert way.path(EMPTY, speed_mps=10.0, horizon_s=8.0) is None


def test_other_turns_are_looked_down_where_the_way_is_predicted() -> None:
    predicted = driven((110, 100), (150, 100))
    names = {junction.summary.id for junction in predicted.other_turns}
    assert "n203" in names
    assert "n103" not in names

    along_row = Route(tuple(DirectedEdge(GRID.edges[4 + k], False) for k in range(4)), 0.0)
    given = driven((110, 100), (150, 100), routes=(along_row,))
    assert given.other_turns == ()
    assert not given.off_route
    left = driven((110, 100), (200, 100), (200, 160), routes=(along_row,))
    assert left.off_route
    assert left.other_turns != ()


def test_the_road_is_named_for_people() -> None:
    assert driven((110, 100), (150, 100)).road_text == "Row 1 (way 1005)"


def test_the_nominal_speed_is_the_cars_own_and_no_more_than_allowed() -> None:
    assert driven((110, 100), (150, 100), speed_mps=9.0).cruise_speed_mps == pytest.approx(9.0)
    fast = driven((110, 100), (190, 100), speed_mps=20.0)
    assert fast.cruise_speed_mps == pytest.approx(20.0)  # it is not slowed down by the limit


def test_arrivals_heed_the_bends_of_the_rounds_path() -> None:
    """Along a row and up a column: slower to the corner, and slow behind it."""
    turning = Route(tuple(DirectedEdge(GRID.edges[index], False) for index in (4, 5, 23, 24)), 0.0)
    *before, last = states_along(FRAME, drive([(110, 100), (150, 100)]), speed_mps=10.0)
    way = WayAhead(GRID, CORNERS, (turning,))
    for state in before:
        way.take_speed(state)
        way.locate(state)
    straight_s = [arrival.in_s for arrival in way.junctions[:2]]
    assert way.path(EMPTY, speed_mps=10.0, horizon_s=8.0) is not None
    way.take_speed(last)
    way.locate(last)

    later_s = np.array([arrival.in_s for arrival in way.junctions[:2]]) - straight_s
    assert 0.5 < later_s[0] < 1.5
    assert 2.0 < later_s[1] < 3.5


def test_who_comes_to_a_corner_fast_takes_it_faster_than_usual() -> None:
    turning = Route(tuple(DirectedEdge(GRID.edges[index], False) for index in (4, 5, 23, 24)), 0.0)

    def across_mps2(to_x: float, speed_mps: float) -> float:
        way = WayAhead(GRID, CORNERS, (turning,))
        for state in states_along(FRAME, drive([(110, 100), (to_x, 100)]), speed_mps=speed_mps):
            way.take_speed(state)
            way.locate(state)
        assert way.path(EMPTY, speed_mps=speed_mps, horizon_s=8.0) is not None
        return way.bend_accel_mps2

    assert across_mps2(150, 10.0) == USUAL_BEND_MPS2
    assert USUAL_BEND_MPS2 + 0.3 < across_mps2(185, 10.0) < MOST_BEND_MPS2
    assert across_mps2(185, 20.0) == MOST_BEND_MPS2


def test_with_tracks_the_nominal_speed_heeds_how_the_road_was_driven() -> None:
    line = np.column_stack([np.arange(100.0, 400.0), np.full(300, 98.5)])
    lat, lon = geo_from_local(FRAME, line).T
    earlier = DrivenTrack(
        id="0123456789ab", name="earlier", added_utc="2030-01-01T00:00:00Z",
        stamp_ns=np.arange(300) * 10**8, lat_deg=lat, lon_deg=lon, speed_mps=np.full(300, 5.0),
    )  # fmt: skip

    def speeds(*tracks: DrivenTrack) -> np.ndarray:
        way = WayAhead(GRID, CORNERS, (), tracks=tracks)
        for state in states_along(FRAME, drive([(110, 100), (150, 100)]), start_s=1000.0):
            way.take_speed(state)
            way.locate(state)
        path = way.path(EMPTY, speed_mps=10.0, horizon_s=8.0)
        assert path is not None
        return np.asarray(way.speeds_ahead(horizon_s=8.0))

    assert speeds()[-1] > 9.5
    assert 5.0 < speeds(earlier)[-1] < 7.5
