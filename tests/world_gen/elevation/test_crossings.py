import pytest

from foretwin.world_gen.elevation.crossings import LAYER_HEIGHT_M, crossings_of
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import drawn_map

NODES = {1: (-100.0, 0.0), 2: (100.0, 0.0), 3: (10.0, -50.0), 4: (10.0, 50.0)}
STREET = {"highway": "residential"}


def test_a_bridge_passes_over_what_it_does_not_meet() -> None:
    osm = drawn_map(NODES, [(1, [1, 2], {**STREET, "bridge": "yes"}), (2, [3, 4], STREET)])
    (found,) = crossings_of(build_road_graph(osm).edges)

    assert (found.above, found.below) == (0, 1)
    assert (found.above_m, found.below_m) == pytest.approx((110.0, 50.0), abs=0.01)
    assert found.clear_m == LAYER_HEIGHT_M


def test_roads_of_one_layer_and_roads_that_meet_need_no_room() -> None:
    same = drawn_map(NODES, [(1, [1, 2], STREET), (2, [3, 4], STREET)])
    meet = drawn_map(NODES, [(1, [1, 2, 4], {**STREET, "layer": "1"}), (2, [3, 4], STREET)])

    assert crossings_of(build_road_graph(same).edges) == []
    assert [c.above for c in crossings_of(build_road_graph(meet).edges)] == []
