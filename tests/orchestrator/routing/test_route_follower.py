from __future__ import annotations

import numpy as np
import pytest

from foretwin.orchestrator.routing.map_matching import MapMatcher
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_follower import RouteFollower, RouteProgress
from foretwin.world_gen.roads.road_graph import DirectedEdge
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions, TurnRule
from tests.orchestrator.grid_map import drive, graph_of, headings, road
from tests.orchestrator.routing.grid_driver import TOWN, Driver, route_of

COVERS = (
    "foretwin.orchestrator.routing.given_routes",
    "foretwin.orchestrator.routing.junctions_ahead",
    "foretwin.orchestrator.routing.other_turns",
    "foretwin.orchestrator.routing.place_on_route",
)


def along(*steps: tuple[int, bool]) -> Route:
    return Route(tuple(DirectedEdge(TOWN.edges[index], reverse) for index, reverse in steps))


def test_straight_on_passes_every_junction_once_at_its_centre() -> None:
    driver = Driver().go([(20, 100), (380, 100)])

    assert driver.names == ["n102", "n103", "n104"]
    for (_, x, _), centre in zip(driver.passed, (100, 200, 300), strict=True):
        assert x == pytest.approx(centre, abs=3.0)


def test_what_comes_next_is_told_with_its_distance() -> None:
    driver = Driver().go([(20, 100), (150, 100)])

    assert driver.ahead(260.0) == [("n103", 50), ("n104", 150), ("n105", 250)]


def test_a_turn_off_the_predicted_path_predicts_anew_and_still_passes_the_junction() -> None:
    driver = Driver().go([(20, 100), (200, 100), (200, 140)])

    assert driver.names == ["n102", "n103"]
    assert driver.ahead(200.0)[0] == ("n203", 60)
    assert not driver.progress[-1].off_route  # type: ignore[union-attr]


def test_position_along_the_route_never_jumps() -> None:
    driver = Driver().go([(20, 100), (200, 100), (200, 200), (350, 200)])
    s = np.array([now.s_m for now in driver.progress if now])

    assert np.abs(np.diff(s)).max() < 6.0
    assert s[-1] - s[0] == pytest.approx(430.0, abs=8.0)


def test_a_round_trip_passes_a_junction_again() -> None:
    driver = Driver().go([(150, 100), (300, 100), (300, 200), (200, 200), (200, 60)])

    assert driver.names == ["n103", "n104", "n204", "n203", "n103"]


def test_dithering_at_a_junction_passes_it_once() -> None:
    driver = Driver().go([(20, 100), (103, 100)])
    rng = np.random.default_rng(1)
    for _ in range(100):
        point = np.array([101.0, 100.0]) + rng.normal(0.0, 2.0, 2)
        driver.follower.update(driver.matcher.update(point, 0.0, True, 0.0))
    driver.go([(103, 100), (180, 100)])

    assert driver.names == ["n102"]


def test_a_heading_into_a_turn_is_believed_before_the_position_shows_it() -> None:
    driver = Driver().go([(20, 100), (96, 100)])
    straight_on = driver.ahead(250.0)
    for _ in range(2):
        driver.follower.update(driver.matcher.update(np.array([97.0, 100.5]), 0.5, True, 4.0))
    turning = driver.ahead(250.0)
    driver.follower.update(driver.matcher.update(np.array([98.0, 100.5]), 0.0, True, 4.0))
    after_all_not = driver.ahead(250.0)

    assert [name for name, _ in straight_on] == ["n102", "n103", "n104"]
    assert [name for name, _ in turning] == ["n102", "n202", "n302"]
    assert [name for name, _ in after_all_not] == ["n102", "n103", "n104"]


ROUND = along((4, False), (20, False), (9, False), (10, False))


def test_a_given_route_is_foreseen_round_its_corners() -> None:
    driver = Driver((ROUND,)).go([(20, 100), (60, 100)])
    now = driver.progress[-1]

    assert now is not None
    assert not now.off_route
    assert driver.ahead(400.0)[:3] == [("n102", 40), ("n202", 140), ("n203", 240)]


def test_beyond_its_end_a_given_route_goes_on_most_probably() -> None:
    driver = Driver((along((4, False)),)).go([(20, 100), (60, 100)])

    assert driver.ahead(250.0) == [("n102", 40), ("n103", 140), ("n104", 240)]


FORK = graph_of(
    [
        road(0, 1, 2, [(0, 0), (100, 0)], backward=False),
        road(1, 2, 3, [(100, 0), (140, 0), (200, 8)], backward=False),
        road(2, 2, 4, [(100, 0), (112, -2.5), (200, -24)], backward=False),
    ]
)
"""A carriageway that goes on, and a road that leaves it at 14° to the right."""


def through_fork(corners: list[tuple[float, float]]) -> list[tuple[float, RouteProgress]]:
    """Return x and progress of a car whose route leaves the carriageway."""
    to_the_right = Route(tuple(DirectedEdge(FORK.edges[index], False) for index in (0, 2)))
    matcher, follower = MapMatcher(FORK), RouteFollower(FORK, (), (to_the_right,))
    xy = drive(corners, spacing_m=0.5)
    told = []
    for point, yaw in zip(xy, headings(xy), strict=True):
        now = follower.update(matcher.update(point, yaw, True, 8.0))
        assert now is not None
        told.append((float(point[0]), now))
    return told


@pytest.mark.parametrize(
    "corners",
    [
        [(20, 1.5), (104, 1.0), (113, -2), (180, -19)],
        [(20, 0), (108, 0), (116, -2.5), (180, -18.5)],
        [(20, 2), (112, 1.5), (125, -3.5), (180, -18)],
    ],
    ids=["soon", "on the line", "late"],
)
def test_a_route_that_forks_at_a_small_angle_is_not_left_while_both_roads_are_alike(
    corners: list[tuple[float, float]],
) -> None:
    told = through_fork(corners)
    s_m = np.array([now.s_m for _, now in told])

    assert not any(now.off_route for _, now in told)
    assert np.diff(s_m).max() < 2.0


def test_a_car_that_takes_the_other_road_of_a_fork_has_left_its_route() -> None:
    off = [x for x, now in through_fork([(20, -2), (138, -2), (195, 6)]) if now.off_route]

    assert 110.0 < off[0] < 155.0
    assert off[-1] == 195.0


def test_leaving_a_given_route_is_told_and_rejoining_it_too() -> None:
    driver = Driver((ROUND,)).go([(20, 100), (150, 100)])
    off = driver.progress[-1]
    driver.go([(150, 100), (200, 100), (200, 200), (230, 200)])
    back = driver.progress[-1]

    assert off is not None
    assert back is not None
    assert off.off_route
    assert not back.off_route
    assert driver.names == ["n102", "n103", "n203"]


def test_of_a_road_driven_three_times_the_next_time_is_foreseen() -> None:
    corners = [(20, 98), (150, 98), (150, 104), (60, 103), (60, 98), (300, 98), (300, 180)]
    driver = Driver(route_of(corners)).go([*corners[:5], (80, 98)])

    assert [name for name, _ in driver.ahead(330.0)] == ["n102", "n103", "n104", "n204"]


def test_who_leaves_a_route_and_comes_back_to_a_road_of_two_laps_is_on_the_one_not_driven_yet() -> (
    None
):
    lap = [(0, 100), (300, 100), (300, 200), (0, 200)]
    driver = Driver(route_of([*lap, (0, 100), (200, 100), (200, 0), (400, 0)]))
    driver.go([*lap[:3], (100, 200), (100, 100), (180, 100)])

    assert [name for name, _ in driver.ahead(330.0)] == ["n103", "n3", "n4"]


def test_other_turns_within_reach_are_told_for_building_worlds_ahead() -> None:
    driver = Driver().go([(120, 100), (160, 100)])
    others = [
        (a.junction.summary.id, round(a.distance_m)) for a in driver.follower.alternatives(150)
    ]

    assert ("n203", 140) in others
    assert ("n3", 140) in others
    assert "n103" not in [name for name, _ in others]


NO_RIGHT_TURN = TurnRule(1, 1005, (), frozenset({1022}), only=False, u_turn=False)
"""From the second street's way to the one that leads south at its third node."""
THEN_NO_RIGHT_TURN = TurnRule(2, 1005, (1022,), frozenset({1001}), only=False, u_turn=False)


@pytest.mark.parametrize(
    "restrictions",
    [
        TurnRestrictions({103: (NO_RIGHT_TURN,)}, ()),
        TurnRestrictions({}, (THEN_NO_RIGHT_TURN,)),
    ],
    ids=["at a node", "over a way"],
)
def test_a_turn_that_a_restriction_forbids_is_no_other_turn(restrictions: TurnRestrictions) -> None:
    def found(driver: Driver) -> set[str]:
        driver.go([(120, 100), (160, 100)])
        return {one.junction.summary.id for one in driver.follower.alternatives(250)}

    assert "n2" in found(Driver()) - found(Driver(restrictions=restrictions))


def test_off_the_map_ends_the_route_and_the_return_begins_a_new_one() -> None:
    driver = Driver().go([(20, 0), (20, -200), (400, -200), (400, 60)])

    assert None in driver.progress
    assert driver.progress[-1] is not None
    assert driver.names == []


def test_the_future_changes_nothing_before_it() -> None:
    corners = [(20.0, 100.0), (200.0, 100.0), (200.0, 300.0)]
    whole, cut = Driver().go(corners), Driver().go(corners[:2])

    assert whole.progress[: len(cut.progress)] == cut.progress


def test_a_route_given_while_driving_counts_from_where_the_car_is_on_it() -> None:
    driver = Driver().go([(20, 100), (150, 100)])
    assert driver.ahead(300.0)[:2] == [("n103", 50), ("n104", 150)]
    driver.follower.give((along((4, False), (5, False), (23, False)),))
    driver.go([(151, 100), (160, 100)])
    assert driver.progress[-1] is not None
    assert not driver.progress[-1].off_route
    assert driver.ahead(300.0)[:2] == [("n103", 40), ("n203", 140)]
    # One that lies elsewhere is given all the same, and told of as left.
    driver.follower.give(
        (
            along(
                (12, False),
            ),
        )
    )
    driver.go([(161, 100), (170, 100)])
    assert driver.progress[-1] is not None
    assert driver.progress[-1].off_route
