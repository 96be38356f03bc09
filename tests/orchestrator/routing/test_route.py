from __future__ import annotations

import pytest

from foretwin.orchestrator.routing.route import Route, RouteError, extend_most_probable, turn_angle
from foretwin.world_gen.roads.road_graph import DirectedEdge
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions, TurnRule
from tests.orchestrator.grid_map import graph_of, grid, road

TOWN = grid(4, 3)


def forward(*indices: int) -> Route:
    return Route(tuple(DirectedEdge(TOWN.edges[index], False) for index in indices))


def keys(route: Route) -> list[tuple[int, bool]]:
    return [edge.key for edge in route.edges]


def test_positions_count_from_the_origin() -> None:
    route = Route(forward(0, 1).edges, origin_m=500.0)

    assert route.end_m == pytest.approx(700.0)
    assert route.index_at(650.0) == 1


def test_the_most_probable_way_is_straight_on() -> None:
    extended = extend_most_probable(TOWN, forward(0), until_m=300.0)

    assert keys(extended) == [(0, False), (1, False), (2, False)]


def test_at_the_end_of_a_street_it_turns_rather_than_back() -> None:
    extended = extend_most_probable(TOWN, forward(0, 1, 2), until_m=350.0)

    assert keys(extended)[3] == (14 + 1, False)


def test_what_is_already_long_enough_stays() -> None:
    route = forward(0, 1)

    assert extend_most_probable(TOWN, route, until_m=150.0) is route


def test_a_dead_end_ends_the_route() -> None:
    lane = graph_of([road(0, 1, 2, [(0, 0), (80, 0)])])
    route = Route((DirectedEdge(lane.edges[0], False),))

    assert extend_most_probable(lane, route, until_m=1000.0).end_m == pytest.approx(80.0)


def test_a_one_way_street_is_not_entered_the_wrong_way() -> None:
    #        2 ── against ──> (ahead)       only the turn to the left may be driven
    crossing = graph_of(
        [
            road(0, 1, 2, [(0, 0), (100, 0)]),
            road(1, 3, 2, [(200, 0), (100, 0)], backward=False),
            road(2, 2, 4, [(100, 0), (100, 100)]),
        ]
    )
    route = Route((DirectedEdge(crossing.edges[0], False),))

    assert keys(extend_most_probable(crossing, route, until_m=150.0)) == [(0, False), (2, False)]


def test_a_car_road_to_the_side_beats_a_slight_bend_into_a_pedestrian_street() -> None:
    fork = graph_of(
        [
            road(0, 1, 2, [(0, 0), (100, 0)], name="Market"),
            road(1, 2, 3, [(100, 0), (200, 10)], car=False, name="Mall"),
            road(2, 2, 4, [(100, 0), (180, 60)], name="Ring"),
        ]
    )
    route = Route((DirectedEdge(fork.edges[0], False),))

    assert keys(extend_most_probable(fork, route, until_m=150.0))[1] == (2, False)


def test_a_restriction_is_kept_to_where_another_way_leads_on() -> None:
    not_ahead = TurnRule(1, 1000, (), frozenset({1001}), only=False, u_turn=False)
    crossing = graph_of(
        [
            road(0, 1, 2, [(0, 0), (100, 0)]),
            road(1, 2, 3, [(100, 0), (200, 0)]),
            road(2, 2, 4, [(100, 0), (100, 100)]),
        ]
    )
    at_node = TurnRestrictions({2: (not_ahead,)}, ())
    over_ways = TurnRestrictions({}, (not_ahead._replace(from_way=1003, via_ways=(1000,)),))
    before = DirectedEdge(road(3, 5, 1, [(-50, 0), (0, 0)]), False)

    def taken(route: Route, restrictions: TurnRestrictions) -> tuple[int, bool]:
        until_m = route.end_m + 50.0
        found = extend_most_probable(crossing, route, until_m=until_m, restrictions=restrictions)
        return keys(found)[-1]

    from_west = Route((DirectedEdge(crossing.edges[0], False),))
    from_far = Route((before, *from_west.edges))
    assert taken(from_west, at_node) == taken(from_far, over_ways) == (2, False)
    assert taken(from_west, over_ways) == (1, False)


def test_a_restriction_ends_no_way_that_has_no_other() -> None:
    not_ahead = TurnRule(1, 1000, (), frozenset({1001}), only=False, u_turn=False)
    lane = graph_of([road(0, 1, 2, [(0, 0), (80, 0)]), road(1, 2, 3, [(80, 0), (160, 0)])])
    route = Route((DirectedEdge(lane.edges[0], False),))

    restrictions = TurnRestrictions({2: (not_ahead,)}, ())
    found = extend_most_probable(lane, route, until_m=150.0, restrictions=restrictions)
    assert keys(found) == [(0, False), (1, False)]


def test_a_pedestrian_street_straight_on_is_taken_where_nothing_else_leads_on() -> None:
    town = grid(4, 1, pedestrian=frozenset([1]))
    route = Route((DirectedEdge(town.edges[0], False),))

    assert keys(extend_most_probable(town, route, until_m=300.0)) == [
        (0, False), (1, False), (2, False),
    ]  # fmt: skip


def test_a_left_turn_is_positive() -> None:
    assert turn_angle(forward(0).edges, forward(10).edges[0]) == pytest.approx(1.57, abs=0.01)


def test_a_route_with_a_jump_names_the_place() -> None:
    with pytest.raises(RouteError, match=r"jumps from way 1000 .* to way 1002"):
        forward(0, 2).validate()


def test_a_route_without_roads_is_refused() -> None:
    with pytest.raises(RouteError, match="without roads"):
        Route(()).validate()
