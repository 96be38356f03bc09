"""Corners are as wide as norms build them, by how far is turned and between which roads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import CROSS, GERMANY, STREET, crossing, drawn_map, world_of
from tests.world_gen.drawn_stars import stars, world_of_star
from tests.world_gen.path_shape import tightest_radius_m

PITTSBURGH = GeoPoint(40.44, -79.99)
MAIN = {"highway": "secondary", "name": "Main", "lanes": "2"}
LANE_M = 3.0, 3.25
"""Of residential and of secondary roads, where a map says no width."""


def _right_turns(world: World) -> dict[tuple[str, str], float]:
    """Return the least radius of right turns by the ways from which and to which they lead."""
    return {
        (c.from_lane_id.split(".")[0], c.to_lane_id.split(".")[0]): tightest_radius_m(c.centerline)
        for c in world.connections
        if c.turn == "right"
    }


def test_residential_streets_have_corners_of_4_6_m():
    radii = _right_turns(world_of(crossing()))
    assert len(radii) == 4
    assert list(radii.values()) == pytest.approx([4.6 + LANE_M[0] / 2] * 4, rel=0.12)


@pytest.mark.parametrize(
    ("origin", "corner_m", "lane_m"), [(GERMANY, 10.0, 3.25), (PITTSBURGH, 6.0, 3.35)]
)
def test_corners_of_a_main_road_and_a_lesser_one_are_as_wide_as_the_country_builds_them(
    origin, corner_m, lane_m
):
    radii = _right_turns(world_of(crossing(street=MAIN, origin=origin)))
    assert list(radii.values()) == pytest.approx([corner_m + lane_m / 2] * 4, rel=0.06)


def test_between_main_roads_who_leaves_the_greater_turns_widest():
    primary = MAIN | {"highway": "primary"}
    radii = _right_turns(world_of(crossing(street=primary, avenue=MAIN)))
    # Both ends of a corner lie where the wider of its turns wants them.
    assert min(radii.values()) > 8.0 + LANE_M[1] / 2 - 0.9
    assert max(radii.values()) == pytest.approx(12.0 + 3.5 / 2, rel=0.12)


@pytest.mark.parametrize(("angle_deg", "corner_m"), [(60.0, 12.0), (90.0, 9.0), (120.0, 6.0)])
def test_the_more_is_turned_the_tighter_a_corner_is(angle_deg, corner_m):
    at = math.radians(angle_deg)
    side = {2: (100.0 * math.cos(at), 100.0 * math.sin(at))}
    nodes = {i: CROSS[i] for i in (0, 1, 3)} | side
    ways = [(11, [0, 1], MAIN), (12, [0, 2], MAIN), (13, [3, 0], MAIN)]
    radii = _right_turns(world_of(drawn_map(nodes, ways, origin=GERMANY)))
    # From the side road into the western one, by the angle between them.
    assert radii["w12", "w13"] == pytest.approx(corner_m * 10.0 / 9.0 + LANE_M[1] / 2, rel=0.15)


def test_a_line_that_the_map_has_goes_before_a_wide_corner():
    light = {"highway": "traffic_signals", "traffic_signals:direction": "forward"}
    nodes = CROSS | {5: (-9.0, 0.0)}
    ways = [(11, [0, 1], MAIN), (12, [0, 2], MAIN), (13, [3, 5, 0], MAIN), (14, [4, 0], MAIN)]
    world = world_of(drawn_map(nodes, ways, node_tags={5: light}, origin=GERMANY))
    ends = {lane.osm_way: lane.centerline for lane in world.lanes if lane.id.endswith("f0")}
    assert ends[13][-1, 0] == pytest.approx(-8.7, abs=0.05)
    assert ends[14][-1, 1] < -12.0  # no light of its own on the map


def test_a_line_is_for_who_drives_in():
    def begin_m(out: dict[str, str], light: dict[str, str]) -> float:
        ways = [(11, [0, 5, 1], out), (12, [0, 2], MAIN), (13, [3, 0], MAIN), (14, [4, 0], MAIN)]
        nodes = CROSS | {5: (9.0, 0.0)}
        world = world_of(drawn_map(nodes, ways, node_tags={5: light}, origin=GERMANY))
        (lane,) = (lane for lane in world.lanes if lane.id.startswith("w11") and ".f" in lane.id)
        return float(lane.centerline[0, 0])

    lights = {"highway": "traffic_signals"}
    assert begin_m(MAIN, lights) == pytest.approx(8.7, abs=0.05)
    outward_alone = MAIN | {"oneway": "yes", "lanes": "1"}
    assert begin_m(outward_alone, lights) == begin_m(outward_alone, {}) > 12.0


def test_short_roads_keep_a_lane_between_their_corners():
    nodes = CROSS | {5: (34.0, 0.0), 6: (34.0, 100.0), 7: (34.0, -100.0)}
    ways = [
        (11, [0, 5], MAIN),
        (12, [0, 2], MAIN),
        (13, [3, 0], MAIN),
        (15, [6, 5, 7], MAIN),
        (16, [5, 1], MAIN),
    ]
    osm = drawn_map(nodes, ways, origin=GERMANY)
    graph = build_road_graph(osm)
    for junction in find_intersections(osm, graph):
        world = build_world(osm, graph, junction)
        between = [lane for lane in world.lanes if lane.osm_way == 11]
        assert len(between) == 2
        for lane in between:
            assert np.hypot(*(lane.centerline[-1] - lane.centerline[0])) > 0.39 * 34.0


@settings(max_examples=25, deadline=None)
@given(arms=stars(), left_hand=st.booleans())
def test_no_turn_at_one_node_leaves_the_angle_between_its_lanes_by_more_than_30_degrees(
    arms, left_hand
):
    world = world_of_star(arms, left_hand=left_hand)
    lanes = {lane.id: lane for lane in world.lanes}
    for c in world.connections:
        before, behind = lanes[c.from_lane_id].centerline, lanes[c.to_lane_id].centerline
        steps = np.diff(np.concatenate([before[-2:-1], c.centerline, behind[1:2]]), axis=0)
        yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        yaw -= yaw[0]
        if c.turn == "u_turn" or abs(yaw[-1]) > math.radians(160.0):
            continue
        assert yaw.max() < max(yaw[-1], 0.0) + math.radians(30.0)
        assert yaw.min() > min(yaw[-1], 0.0) - math.radians(30.0)
        assert abs(yaw[-1]) < math.pi


WEST_M = (-5.8, 2.4), (-7.9, 6.8), (-9.8, 12.1), (-8.5, 18.4), (-6.2, 27.9), (-4.0, 80.0)
EAST_M = (5.0, 0.7), (9.9, 4.5), (12.4, 10.4), (14.6, 28.8), (15.0, 80.0)
TAIL_M = (15.4, -17.4), (34.3, -33.2), (60.2, -45.9)


def _cup() -> World:
    """Return two roads from the north that bend towards one another, and one to the south."""
    nodes = {0: (0.0, 0.0)} | dict(enumerate((*WEST_M, *EAST_M, *TAIL_M), start=1))
    ways = [(11, [0, *range(1, 7)], MAIN), (12, [0, *range(7, 12)], MAIN)]
    ways += [(13, [0, 12, 13, 14], {"highway": "unclassified"})]
    return world_of(drawn_map(nodes, ways, origin=GERMANY))


def test_lanes_end_before_bends_behind_which_a_turn_would_swing_out():
    world = _cup()
    across = [c.centerline for c in world.connections if "w13" not in c.id]
    assert len(across) == 2
    # Both bend within 12 m of the place: the turns go no farther beyond it than a road is wide.
    assert all(path[:, 1].min() > -6.5 for path in across)
    assert min(tightest_radius_m(path) for path in across) > 5.0


def test_a_side_road_that_comes_back_along_the_main_one_ends_at_its_mouth():
    side_m = (9.2, -5.2), (12.7, -10.5), (15.0, -22.5), (14.7, -48.1), (14.0, -100.0)
    nodes = {0: (0.0, 0.0), 1: (-50.0, -86.6), 2: (50.0, 86.6)} | dict(enumerate(side_m, start=3))
    ways = [(11, [1, 0], MAIN), (12, [0, 2], MAIN), (13, [0, 3, 4, 5, 6, 7], STREET)]
    world = world_of(drawn_map(nodes, ways, origin=GERMANY))
    (end_m,) = (lane.centerline[-1] for lane in world.lanes if lane.id.startswith("w13.0.7.b"))
    # From there one turns by 115°; behind the bends at (9, -5) and (13, -10) by 140°.
    assert -10.0 < end_m[1] < -2.0
