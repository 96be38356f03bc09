"""How often a junction is passed, by what a car's way through drawn maps says."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.world import IntersectionSummary
from foretwin.orchestrator.routing.line_matching import match_line
from foretwin.orchestrator.routing.map_matching import MapMatcher
from foretwin.orchestrator.routing.route_follower import RouteFollower
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.road_graph import RoadGraph
from tests.orchestrator.grid_map import FRAME, drive, graph_of, grid, headings, junctions, road

RING_M = 70.0
TOWN = grid(5, 4)


def circle(start_deg: float, end_deg: float) -> list[tuple[float, float]]:
    """Points counter-clockwise on the ring about the origin, 2 m apart."""
    count = round(abs(end_deg - start_deg) * np.pi / 180.0 * RING_M / 2.0)
    angles = np.radians(np.linspace(start_deg, end_deg, count + 1))
    return [(float(RING_M * np.cos(a)), float(RING_M * np.sin(a))) for a in angles]


def roundabout() -> RoadGraph:
    """A ring with arms to the east, north, west and south, each 300 m long."""
    out = [(RING_M, 0.0), (0.0, RING_M), (-RING_M, 0.0), (0.0, -RING_M)]
    far = [(x * (1.0 + 300.0 / RING_M), y * (1.0 + 300.0 / RING_M)) for x, y in out]
    ring = [
        road(k, k + 1, (k + 1) % 4 + 1, circle(90.0 * k, 90.0 * (k + 1)), backward=False)
        for k in range(4)
    ]
    arms = [road(4 + k, k + 1, 11 + k, [out[k], far[k]]) for k in range(4)]
    return graph_of([*ring, *arms])


def one_junction(nodes: set[int], *, at: tuple[float, float], radius_m: float) -> Junction:
    geo = geo_from_local(FRAME, np.array(at))
    summary = IntersectionSummary(
        id="j", kind="crossing", lat=float(geo[0]), lon=float(geo[1]), arms=4,
        control="uncontrolled", driving_side="right", osm_nodes=tuple(sorted(nodes)),
    )  # fmt: skip
    return Junction(
        summary=summary, centre_xy_m=np.array(at), nodes=frozenset(nodes),
        inner=(), arms=(), radius_m=radius_m,
    )  # fmt: skip


def passed(
    graph: RoadGraph,
    found: tuple[Junction, ...],
    corners: list[tuple[float, float]],
    *,
    given: bool,
) -> list[str]:
    """Return the junctions told as passed on a way, with the way as its route or without one."""
    xy = drive(corners)
    routes = match_line(graph, np.asarray(geo_from_local(FRAME, xy))).routes if given else ()
    matcher, follower = MapMatcher(graph), RouteFollower(graph, found, routes)
    told = []
    for point, yaw in zip(xy, headings(xy), strict=True):
        now = follower.update(matcher.update(point, float(yaw), True, 8.0))
        assert now is not None
        told += [one.junction.summary.id for one in now.passed]
    return told


def test_a_roundabout_that_is_turned_back_in_is_passed_once() -> None:
    graph = roundabout()
    ring = (one_junction({1, 2, 3, 4}, at=(0.0, 0.0), radius_m=RING_M),)
    way = [(300.0, 0.0), *circle(0.0, 360.0), (360.0, 0.0)]

    assert passed(graph, ring, way, given=True) == ["j"]
    assert passed(graph, ring, way, given=False) == ["j"]


def test_a_drive_that_begins_within_a_roundabout_does_not_pass_it_once_outside() -> None:
    graph = roundabout()
    ring = (one_junction({1, 2, 3, 4}, at=(0.0, 0.0), radius_m=RING_M),)
    way = [*circle(10.0, 180.0), (-360.0, 0.0)]

    assert passed(graph, ring, way, given=True) == []
    assert passed(graph, ring, way, given=False) == []


def test_a_loop_back_to_a_junction_passes_it_twice_and_not_at_every_state() -> None:
    graph = graph_of(
        [
            road(0, 1, 2, [(0, 0), (200, 0)]),
            road(1, 2, 4, [(200, 0), (180, 40), (200, 40)], backward=False),
            road(2, 4, 2, [(200, 40), (220, 40), (200, 0)], backward=False),
            road(3, 2, 3, [(200, 0), (500, 0)]),
        ]
    )
    way = [(20.0, 0.0), (200.0, 0.0), (180.0, 40.0), (220.0, 40.0), (200.0, 0.0), (460.0, 0.0)]
    found = (one_junction({2}, at=(200.0, 0.0), radius_m=0.0),)

    assert passed(graph, found, way, given=True) == ["j", "j"]


def test_who_turns_back_beyond_a_junction_has_it_ahead_again_and_passes_it_again() -> None:
    found = tuple(msgspec.structs.replace(one, radius_m=20.0) for one in junctions(TOWN))
    there = [(120.0, 100.0), (235.0, 100.0), (235.0, 103.0), (215.0, 103.0)]
    matcher, follower = MapMatcher(TOWN), RouteFollower(TOWN, found)
    told: list[str] = []

    def go(corners: list[tuple[float, float]]) -> None:
        xy = drive(corners)
        for point, yaw in zip(xy, headings(xy), strict=True):
            now = follower.update(matcher.update(point, float(yaw), True, 8.0))
            assert now is not None
            told.extend(one.junction.summary.id for one in now.passed)

    go(there)
    assert follower.upcoming(100.0)[0].junction.summary.id == "n103"
    go([there[-1], (120.0, 103.0)])
    assert told == ["n103", "n103"]
