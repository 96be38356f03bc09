"""Where cars stop at a light away from junctions, with crossings near it."""

from __future__ import annotations

import pytest

from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, Tags, drawn_map, world_of

LIGHT = {"highway": "traffic_signals"}
CROSSING = {"highway": "crossing", "crossing": "traffic_signals"}


def _lines_m(nodes: dict[int, tuple[float, Tags]]) -> list[float]:
    """Return where lines of lights lie on a street from the west, of nodes at x with such tags."""
    west = sorted(nodes, key=lambda node: nodes[node][0])
    osm = drawn_map(
        CROSS | {node: (x, 0.0) for node, (x, _) in nodes.items()},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, *west, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={node: tags for node, (_, tags) in nodes.items()},
    )
    lines = [line for line in world_of(osm).stop_lines if ":light" in line.id]
    return sorted(float(line.ends[:, 0].mean()) for line in lines)


def test_without_a_crossing_lines_are_where_the_light_is():
    assert _lines_m({5: (-60.0, LIGHT)}) == pytest.approx([-60.0, -60.0], abs=0.02)


@pytest.mark.parametrize("away_m", [3.0, 6.0, 14.0])
def test_a_light_for_both_ways_has_its_line_before_a_near_crossing(away_m):
    found = _lines_m({5: (-60.0, LIGHT), 6: (-60.0 - away_m, CROSSING)})
    assert found == pytest.approx([-63.0 - away_m, -60.0], abs=0.02)


def test_a_light_in_the_middle_of_two_crossings_has_lines_before_both():
    found = _lines_m({5: (-60.0, LIGHT), 6: (-70.0, CROSSING), 7: (-52.0, CROSSING)})
    assert found == pytest.approx([-73.0, -49.0], abs=0.02)


def test_a_light_that_faces_one_way_stands_at_its_line_unless_cars_would_block_a_crossing():
    forward = LIGHT | {"traffic_signals:direction": "forward"}
    assert _lines_m({5: (-60.0, forward), 6: (-70.0, CROSSING)}) == pytest.approx([-60.0], abs=0.02)
    assert _lines_m({5: (-60.0, forward), 6: (-65.0, CROSSING)}) == pytest.approx([-68.0], abs=0.02)


def test_a_light_on_one_of_two_crossings_has_its_line_before_the_first_that_cars_would_block():
    found = _lines_m({5: (-60.0, CROSSING | LIGHT), 6: (-66.0, CROSSING)})
    assert found == pytest.approx([-69.0, -57.0], abs=0.02)


def test_a_light_on_its_own_crossing_stands_for_no_other():
    found = _lines_m({5: (-60.0, CROSSING | LIGHT), 6: (-72.0, CROSSING)})
    assert found == pytest.approx([-63.0, -57.0], abs=0.02)


def test_behind_a_crossing_where_the_lane_begins_the_line_stays_at_the_light():
    osm = drawn_map(
        CROSS | {5: (11.0, 0.0), 6: (14.0, 0.0)},
        [
            (11, [0, 5, 6, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={5: CROSSING, 6: LIGHT | {"traffic_signals:direction": "forward"}},
    )
    (line,) = [line for line in world_of(osm).stop_lines if ":light" in line.id]
    assert line.ends[:, 0] == pytest.approx([14.0, 14.0], abs=0.02)


def test_a_light_with_a_crossing_and_a_sign_behind_it_stands_alone():
    nodes = CROSS | {5: (0.0, -31.0), 6: (0.0, -19.0), 7: (0.0, -9.0)}
    one_way = {"highway": "residential", "oneway": "yes"}
    osm = drawn_map(
        nodes,
        [(13, [3, 0, 1], one_way | {"name": "Street"}), (14, [4, 5, 6, 7, 0], one_way)],
        node_tags={5: LIGHT, 6: CROSSING, 7: {"highway": "give_way"}},
    )
    world = world_of(osm)
    found = {(line.lane_id[:3], line.control.value) for line in world.stop_lines}
    assert found == {("w13", "none"), ("w14", "signal"), ("w14", "give_way")}
    assert [signal.osm_nodes for signal in world.signals] == [(5,)]
    assert {(c.from_lane_id[:3], c.control) for c in world.connections} == {
        ("w13", "none"),
        ("w14", "give_way"),
    }
