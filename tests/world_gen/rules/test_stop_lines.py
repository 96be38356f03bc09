"""Stop lines lie before the crossings that cars would else stand on."""

from __future__ import annotations

import pytest

from foretwin.contracts.world import StopLine, World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.lanes.stopping import BEFORE_CROSSING_M
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, Tags, drawn_map, world_of

ZEBRA = {"highway": "crossing", "crossing": "zebra"}
BARE = {"highway": "crossing", "crossing": "unmarked"}
LIGHT = {"highway": "traffic_signals"}
GIVE_WAY = {"highway": "give_way", "direction": "forward"}


def _from_west(
    nodes: dict[int, tuple[float, Tags]], *, parted_at: int | None = None, light: Tags | None = None
) -> tuple[World, StopLine]:
    """Return a crossing and the line of who comes from the west, past nodes at x of such tags.

    At one of the nodes the way may end, and another one goes on from it.
    """
    west = [3, *sorted(nodes, key=lambda node: nodes[node][0]), 0]
    at = len(west) - 1 if parted_at is None else west.index(parted_at)
    ways = [(13, west[: at + 1], STREET), (15, west[at:], STREET | {"maxspeed": "30"})]
    osm = drawn_map(
        CROSS | {node: (x, 0.0) for node, (x, _) in nodes.items()},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            *(way for way in ways if len(way[1]) > 1),
            (14, [4, 0], AVENUE),
        ],
        node_tags={node: tags for node, (_, tags) in nodes.items()} | ({0: light} if light else {}),
    )
    world = world_of(osm)
    name = "w13." if parted_at is None else "w15."
    (line,) = [ln for ln in world.stop_lines if ln.lane_id.startswith(name)]
    return world, line


def _x_m(nodes: dict[int, tuple[float, Tags]], light: Tags | None = None) -> float:
    _, line = _from_west(nodes, light=light)
    return float(line.ends[:, 0].mean())


USUAL_M = _x_m({})
"""Where lanes end."""


@pytest.mark.parametrize("away_m", [-6.0, -9.0, -11.0, -14.0])
def test_a_line_lies_a_metre_before_a_crossing_that_waiting_cars_would_block(away_m):
    assert _x_m({5: (away_m, ZEBRA)}) == pytest.approx(away_m - BEFORE_CROSSING_M, abs=0.02)


def test_behind_a_crossing_with_room_for_a_car_cars_wait_where_lanes_end():
    assert _x_m({5: (USUAL_M - 2.0 - 4.9, ZEBRA)}) == pytest.approx(USUAL_M, abs=0.02)
    near = USUAL_M - 2.0 - 4.6
    assert _x_m({5: (near, ZEBRA)}) == pytest.approx(near - BEFORE_CROSSING_M, abs=0.02)


def test_a_crossing_without_marks_counts_at_lights_alone():
    assert _x_m({5: (-11.0, BARE)}) == pytest.approx(USUAL_M, abs=0.02)
    assert _x_m({5: (-11.0, BARE)}, light=LIGHT) == pytest.approx(-14.0, abs=0.02)
    forward = LIGHT | {"traffic_signals:direction": "forward"}
    assert _x_m({5: (-11.0, BARE), 6: (-9.0, forward)}) == pytest.approx(-14.0, abs=0.02)


def test_a_sign_past_a_crossing_has_its_line_before_the_crossing():
    assert _x_m({5: (-12.0, ZEBRA), 6: (-9.5, GIVE_WAY)}) == pytest.approx(-15.0, abs=0.02)
    assert _x_m({5: (-12.0, ZEBRA), 6: (-16.0, GIVE_WAY)}) == pytest.approx(-16.0, abs=0.02)


def test_of_crossings_side_by_side_the_line_lies_before_the_outer_one():
    side_by_side = {5: (-10.0, ZEBRA), 6: (-15.0, ZEBRA)}
    assert _x_m(side_by_side) == pytest.approx(-18.0, abs=0.02)
    with_room = {5: (-10.0, ZEBRA), 6: (-20.0, ZEBRA)}
    assert _x_m(with_room) == pytest.approx(-13.0, abs=0.02)


def test_where_the_map_parts_the_road_at_a_crossing_the_line_lies_across_the_lane_before():
    world, line = _from_west({5: (-11.0, ZEBRA)}, parted_at=5)
    assert line.ends[:, 0] == pytest.approx([-14.0, -14.0], abs=0.02)
    lanes = {lane.id: lane for lane in world.lanes}
    assert lanes[line.lane_id].centerline[0, 0] == pytest.approx(-11.0, abs=0.02)
    (before,) = [lane for lane in world.lanes if line.lane_id in lane.successor_ids]
    assert line.ends[:, 1].mean() == pytest.approx(before.centerline[-1, 1], abs=0.02)


def test_a_crossing_where_the_lane_begins_behind_another_junction_moves_no_line():
    osm = drawn_map(
        CROSS | {5: (-22.0, 0.0), 6: (-22.0, 100.0), 7: (-12.5, 0.0)},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 7, 0], STREET),
            (14, [4, 0], AVENUE),
            (16, [5, 6], AVENUE),
        ],
        node_tags={7: ZEBRA},
    )
    graph = build_road_graph(osm)
    junction = next(j for j in find_intersections(osm, graph) if 0 in j.nodes)
    world = build_world(osm, graph, junction)
    (line,) = [ln for ln in world.stop_lines if ln.lane_id.startswith("w13.5.0.")]
    (lane,) = [lane for lane in world.lanes if lane.id == line.lane_id]
    assert line.ends[:, 0].mean() == pytest.approx(lane.centerline[-1, 0] - 0.3, abs=0.02)
