"""Which lanes of a drawn crossing a route is driven along, and how the path is led onto them."""

from __future__ import annotations

import math
from functools import lru_cache

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import target_from_source_m
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths
from foretwin.orchestrator.routing.driving_path import PathGeometry, driving_path
from foretwin.orchestrator.routing.edge_parts import part_of
from foretwin.orchestrator.routing.lane_chain import BLEND_M, LaneGuide, LaneRun, on_lanes
from foretwin.orchestrator.routing.rounding import TIGHT_M, curvature_pm, normals
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.world_lanes import WorldLanes
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph
from tests.world_gen.drawn_maps import crossing, world_of

COVERS = ("foretwin.orchestrator.routing.world_lanes",)

WEST, EAST, NORTH, SOUTH = 13, 11, 12, 14
"""The crossing's ways; its western one is driven towards node 0."""
TWO_LANES = {"highway": "secondary", "name": "Street", "oneway": "yes", "lanes": "2"}
ARROWS = TWO_LANES | {"turn:lanes": "left|through;right"}


class Town:
    """A crossing, its World, and a route over it from the west."""

    def __init__(self, osm: OsmMap, leave_by: int, *, without: str = "", radius_m: float = 150.0):
        self.graph: RoadGraph = build_road_graph(osm)
        self.world = world_of(osm, radius_m=radius_m)
        if without:
            gone = {c.id for c in self.world.connections if without in c.id}
            assert gone
            kept = tuple(c for c in self.world.connections if c.id not in gone)
            self.world = msgspec.structs.replace(self.world, connections=kept)
        edges = {edge.way_id: edge for edge in self.graph.edges}
        self.route = Route(
            (DirectedEdge(edges[WEST], False), DirectedEdge(edges[leave_by], leave_by == SOUTH))
        )
        self.path: PathGeometry | None = None

    def guided(self, at: tuple[float, float], s_m: float | None = None) -> LaneGuide:
        """The guide of a car at metres east and north of the crossing, after its path was made.

        `s_m` is where on the route that is, if not on its first road.
        """
        xy = np.array(at)
        s_m = 100.0 + at[0] if s_m is None else s_m
        lanes = WorldLanes(self.world, self.graph)
        guide = LaneGuide(lanes, self.route, car_s_m=s_m, car_xy_m=xy)
        self.path = driving_path(
            self.route,
            s_from_m=s_m - 10.0,
            s_to_m=self.route.end_m,
            onto_lanes=guide.onto_lanes,
        )
        return guide

    def ids(self, at: tuple[float, float]) -> list[list[str]]:
        """The lanes of each run, by way and number; connections left out."""
        return [
            [".".join(np.array(name.split("."))[[0, -1]]) for name in run.ids if ">" not in name]
            for run in self.guided(at).runs
        ]

    def away_m(self) -> Array:
        """How far each of the path's points is from the nearest lane or connection."""
        assert self.path is not None
        xy = target_from_source_m(self.world.frame, self.graph.frame, self.path.xy_m)
        lines = [lane.centerline for lane in self.world.lanes]
        lines += [connection.centerline for connection in self.world.connections]
        return np.min([_away(xy, line) for line in lines], axis=0)


def _even(line: Array, spacing_m: float = 0.5) -> Array:
    arc = arc_lengths(line)
    at = np.linspace(0.0, arc[-1], max(2, round(arc[-1] / spacing_m)))
    return np.stack([np.interp(at, arc, line[:, k]) for k in (0, 1)], axis=-1)


def _away(xy: Array, line: Array) -> Array:
    gaps = np.moveaxis(xy[:, None] - _even(line, 0.1), -1, 0)
    return np.asarray(np.hypot(*gaps).min(axis=1))


@lru_cache(maxsize=8)
def one_way(arrows: bool = True) -> OsmMap:
    return crossing(street=ARROWS if arrows else TWO_LANES)


@pytest.mark.parametrize("lateral_m", [1.6, -1.6])
def test_where_both_lanes_go_on_the_car_stays_in_its_own(lateral_m: float) -> None:
    town = Town(one_way(arrows=False), EAST)

    lane = "f0" if lateral_m > 0.0 else "f1"
    assert town.ids((-70.0, lateral_m)) == [[f"w13.{lane}", f"w11.{lane}"]]
    assert town.away_m().max() < 0.1


@pytest.mark.parametrize("lateral_m", [1.6, -1.6])
def test_the_lane_that_may_turn_is_taken_whichever_the_car_is_in(lateral_m: float) -> None:
    left, right = Town(one_way(), NORTH), Town(one_way(), SOUTH)

    assert left.ids((-60.0, lateral_m)) == [["w13.f0", "w12.f0"]]
    assert right.ids((-60.0, lateral_m)) == [["w13.f1", "w14.b0"]]


@pytest.mark.parametrize("leave_by", [NORTH, SOUTH])
def test_a_turn_tighter_than_cars_are_driven_is_widened_and_nothing_else_is(leave_by: int) -> None:
    town = Town(crossing(street=ARROWS | {"highway": "residential"}), leave_by)
    town.ids((-60.0, 0.0))
    assert town.path is not None
    turning = np.abs(town.path.s_m - 100.0) < 25.0
    (connection,) = [
        c for c in town.world.connections if f"w{WEST}." in c.id and f"w{leave_by}." in c.id
    ]

    assert np.abs(curvature_pm(_even(connection.centerline))).max() > 1.0 / TIGHT_M
    assert 1.0 / 12.0 < np.abs(curvature_pm(town.path.xy_m)).max() < 1.0 / TIGHT_M
    assert town.away_m()[~turning].max() < 0.1
    assert 0.5 < town.away_m()[turning].max() < 3.0


@pytest.mark.parametrize(("lane", "inside_m"), [("f0", -1.2), ("f1", -1.2), ("f1", 1.2)])
def test_through_a_bend_of_several_lanes_the_path_stays_in_the_car_s(
    lane: str, inside_m: float
) -> None:
    """The turn is driven inside of its connections: nearer to the next lane's than to its own."""
    both = TWO_LANES | {"turn:lanes": "left|left"}
    town = Town(crossing(street=both, avenue=TWO_LANES), NORTH)
    town.guided((-60.0, 1.6 if lane == "f0" else -1.6))
    assert town.path is not None
    driven = town.path
    turning = np.abs(driven.s_m - 100.0) < 20.0
    places = driven.xy_m + inside_m * normals(driven.xy_m)

    for (x, y), s_m in zip(places[turning][::3].tolist(), driven.s_m[turning][::3], strict=True):
        (run,) = town.guided((x, y), float(s_m)).runs
        assert {name.split(".")[-1] for name in run.ids} == {lane}
        assert _away(np.array([[x, y]]), town.path.xy_m) == pytest.approx(abs(inside_m), abs=0.2)


def test_without_a_connection_the_road_is_followed_between_the_lanes() -> None:
    street = TWO_LANES | {"highway": "residential"}
    town = Town(crossing(street=street), EAST, without=">w11")
    guide = town.guided((-60.0, 1.6))
    assert town.path is not None
    s = town.path.s_m
    without = guide.without_lanes(s)

    assert len(guide.runs) == 2
    assert without.any()
    assert np.abs(s[without] - 100.0).max() < 20.0
    assert np.abs(curvature_pm(town.path.xy_m)).max() < 0.02


def test_beyond_the_world_the_path_joins_the_road_smoothly() -> None:
    town = Town(one_way(arrows=False), EAST, radius_m=50.0)
    guide = town.guided((-90.0, -1.6))
    assert town.path is not None

    (run,) = guide.runs
    assert run.s_m[[0, -1]] == pytest.approx([50.0, 150.0], abs=1.0)
    assert np.abs(np.diff(np.unwrap(_headings(town.path.xy_m)))).max() < math.radians(1.0)


def test_who_turns_back_in_the_road_leaves_the_lane_to_do_so_there() -> None:
    town = Town(crossing(), EAST)
    there, out = town.route.edges
    back_m = out.edge.length_m - 60.0
    turned = part_of(out, 0.0, 60.0), part_of(out.back, back_m, out.edge.length_m)
    town.route = Route((there, *turned, there.back))
    town.guided((-20.0, -1.6))

    assert town.path is not None
    assert town.path.xy_m[:, 0].max() == pytest.approx(60.0, abs=2.0)
    assert np.abs(curvature_pm(town.path.xy_m)).max() < 1.0 / 3.0


def test_a_route_that_no_lane_follows_keeps_its_path() -> None:
    """Against a one-way street, there are roads, but no lanes that way."""
    osm = one_way()
    graph, world = build_road_graph(osm), world_of(osm)
    edges = {edge.way_id: edge for edge in graph.edges}
    route = Route((DirectedEdge(edges[EAST], True), DirectedEdge(edges[WEST], True)))
    guide = LaneGuide(WorldLanes(world, graph), route, car_s_m=50.0, car_xy_m=np.array([50.0, 0.0]))
    led = driving_path(route, s_from_m=40.0, s_to_m=200.0, onto_lanes=guide.onto_lanes)
    plain = driving_path(route, s_from_m=40.0, s_to_m=200.0)

    assert guide.runs == ()
    assert guide.without_lanes(led.s_m).all()
    assert led.xy_m == pytest.approx(plain.xy_m, abs=0.05)


def test_the_same_world_gives_the_same_chain_whatever_the_order_of_its_lanes() -> None:
    town, turned = Town(one_way(), NORTH), Town(one_way(), NORTH)
    world: World = turned.world
    turned.world = msgspec.structs.replace(
        world, lanes=world.lanes[::-1], connections=world.connections[::-1]
    )

    assert town.ids((-60.0, 0.0)) == turned.ids((-60.0, 0.0))
    assert town.path is not None
    assert turned.path is not None
    assert (town.path.xy_m == turned.path.xy_m).all()


def test_a_change_of_lanes_is_made_behind_the_car_s_place_and_before_the_lane_ends() -> None:
    s = np.arange(0.0, 200.0, 0.5)
    path = np.stack([s, np.zeros_like(s)], axis=-1)
    left, right = (np.stack([s, np.full_like(s, y)], axis=-1) for y in (1.5, -1.5))
    runs = (LaneRun(("a",), right[:240], s[:240]), LaneRun(("b",), left[120:], s[120:]))
    xy = on_lanes(path, s, runs, car_s_m=70.0)

    assert xy[s <= 79.0, 1] == pytest.approx(-1.5)
    assert xy[s >= 120.0, 1] == pytest.approx(1.5)
    assert (np.diff(xy[:, 1]) >= 0.0).all()
    rising = s[1:][np.diff(xy[:, 1]) > 1e-9]
    assert np.ptp(rising) < BLEND_M + 1.0


def _headings(xy: Array) -> Array:
    step = np.diff(xy, axis=0)
    return np.asarray(np.arctan2(step[:, 1], step[:, 0]))
