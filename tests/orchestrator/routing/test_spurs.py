"""A drawn or recorded line that turns back for some metres, and the roads that it is taken for."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.frames import geo_from_local
from foretwin.orchestrator.routing.edge_parts import TURNED_NODE
from foretwin.orchestrator.routing.line_matching import SPACING_M, match_line
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import Route
from tests.orchestrator.grid_map import FRAME, grid

TOWN = grid(5, 4)
INDEX = RoadIndex(TOWN)
Corners = list[tuple[float, float]]


def along(corners: Corners) -> Route:
    line = np.asarray(geo_from_local(FRAME, np.asarray(corners)))
    (route,) = match_line(TOWN, line, index=INDEX).routes
    return route


def nodes(corners: Corners) -> list[int]:
    """Return the nodes that the roads of a line come to."""
    return [directed.end_node for directed in along(corners).edges]


def lengths_m(corners: Corners) -> list[float]:
    return [directed.edge.length_m for directed in along(corners).edges]


@pytest.mark.parametrize(
    "corners",
    [
        [(20, 100), (218, 100), (200, 104), (200, 180)],
        [(20, 100), (160, 100), (142, 100), (199, 100), (200, 180)],
        [(35, 100), (15, 100), (199, 100), (200, 180)],
        [(20, 100), (199, 100), (200, 185), (200, 165)],
    ],
    ids=["past a corner", "back and forth", "at the beginning", "at the end"],
)
def test_a_line_that_goes_back_for_some_metres_leads_down_no_street_and_back(
    corners: Corners,
) -> None:
    assert nodes(corners) == [102, 103, 203]


def test_a_street_that_is_driven_down_and_back_stays() -> None:
    there_and_back = [(20.0, 98.0), (270.0, 98.0), (270.0, 102.0), (200.0, 102.0), (198.0, 20.0)]

    assert nodes(there_and_back) == [102, 103, TURNED_NODE, 103, 3]
    assert lengths_m(there_and_back) == pytest.approx(
        [100.0, 100.0, 70.0, 70.0, 100.0], abs=SPACING_M
    )


def test_a_road_that_is_driven_back_and_on_again_is_cut_where_that_begins_and_ends() -> None:
    thrice = [(20.0, 98.0), (170.0, 98.0), (170.0, 102.0), (130.0, 102.0), (130.0, 98.0), (290, 98)]

    assert nodes(thrice) == [102, TURNED_NODE, TURNED_NODE, 103, 104]
    assert lengths_m(thrice) == pytest.approx([100.0, 70.0, 40.0, 70.0, 100.0], abs=SPACING_M)


def test_a_turn_just_before_a_node_is_one_at_it() -> None:
    assert nodes([(20, 98), (180, 98), (180, 102), (20, 103)]) == [102, 103, 102, 101]


def test_who_turns_round_a_few_metres_beyond_a_node_turns_back_at_it() -> None:
    assert nodes([(20, 98), (212, 98), (212, 102), (20, 103)]) == [102, 103, 102, 101]
