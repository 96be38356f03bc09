"""What is left of an edge where a route turns back in it."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.elevation import HeightProfile
from foretwin.orchestrator.routing.edge_parts import (
    TURN_BACK_M,
    TURNED_NODE,
    begins_m,
    part_of,
    place_on,
    whole,
)
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_heights import heights_along
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.orchestrator.grid_map import grid

STREET = grid(3, 2).edges[0]
THERE, BACK = DirectedEdge(STREET, False), DirectedEdge(STREET, True)


def test_there_and_back_are_cut_at_the_same_place() -> None:
    there, back = part_of(THERE, 0.0, 60.0), part_of(BACK, 40.0, 100.0)

    Route((there, back)).validate()
    assert (there.start_node, there.end_node, back.end_node) == (1, TURNED_NODE, 1)
    assert np.array_equal(there.xy_m[-1], back.xy_m[0])
    assert there.edge.length_m == back.edge.length_m == 60.0
    assert there.turns_back(back)
    assert (begins_m(there), begins_m(back)) == (0.0, 40.0)
    assert whole(there) == THERE
    assert whole(back) == BACK


def test_what_is_driven_from_node_to_node_is_no_part() -> None:
    assert part_of(BACK, 0.0, 100.0) is BACK
    assert whole(BACK) is BACK
    assert place_on(BACK, 130.0) == 130.0


@pytest.mark.parametrize(
    ("s_m", "on_part_m"),
    [(70.0, 30.0), (35.0, 0.0), (105.0, 60.0), (40.0 - TURN_BACK_M, None)],
    ids=["on it", "a little before", "a little beyond", "elsewhere"],
)
def test_a_place_on_the_edge_is_told_along_its_part(s_m: float, on_part_m: float | None) -> None:
    assert place_on(part_of(BACK, 40.0, 100.0), s_m) == on_part_m


def test_a_car_that_turned_back_comes_down_what_it_climbed() -> None:
    climb = HeightProfile(
        id="", along_m=np.array([0.0, 100.0]), height_m=np.array([0.0, 10.0]), grade=np.full(2, 0.1)
    )
    hill = RoadProfiles(dem=None, of_edge={0: climb}, grade_std=0.0)  # type: ignore[arg-type]
    route = Route((part_of(THERE, 0.0, 60.0), part_of(BACK, 40.0, 100.0)))

    heights = heights_along(route, np.array([0.0, 50.0, 60.0, 70.0, 120.0]), hill)
    assert heights == pytest.approx([0.0, 5.0, 6.0, 5.0, 0.0])
