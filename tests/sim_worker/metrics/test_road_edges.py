"""How far drawn areas may be off: by what the map says of their roads."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.contracts.provenance import Provenance, Quantity
from foretwin.contracts.world import ATTRIBUTION, Area, World
from foretwin.sim_worker.metrics.ground import DrivableGround, paved_areas
from foretwin.sim_worker.metrics.road_edges import (
    COUNTED_EDGE_M,
    DRIVEN_PLACE_STD_M,
    TAGGED_EDGE_M,
    UNCOUNTED_EDGE_M,
    edge_doubt,
)
from foretwin.world_gen.driven.matching import MAP_ERROR_M
from tests.orchestrator.trip import town_world


def mapped(
    *,
    width: Provenance = "default",
    count: Provenance = "default",
    driven: Literal["driven"] | msgspec.UnsetType = msgspec.UNSET,
) -> World:
    """The drawn town as if it were a map of a place, with all its values from one source."""
    town = town_world("n4")
    lanes = tuple(
        msgspec.structs.replace(
            lane, width_m=Quantity(lane.width_m.value, width), position_source=driven
        )
        for lane in town.lanes
    )
    roads = tuple(msgspec.structs.replace(road, lane_count_source=count) for road in town.roads)
    return msgspec.structs.replace(town, lanes=lanes, roads=roads, attribution=ATTRIBUTION)


@pytest.mark.parametrize(
    ("world", "edge_m", "place_std_m"),
    [
        (mapped(), UNCOUNTED_EDGE_M, MAP_ERROR_M),
        (mapped(count="tagged"), COUNTED_EDGE_M, MAP_ERROR_M),
        (mapped(width="tagged"), TAGGED_EDGE_M, MAP_ERROR_M),
        (mapped(width="inferred", driven="driven"), TAGGED_EDGE_M, DRIVEN_PLACE_STD_M),
        (mapped(width="driven", count="tagged"), COUNTED_EDGE_M, MAP_ERROR_M),
    ],
)
def test_the_better_a_map_knows_its_roads_the_less_is_left_open(
    world: World, edge_m: float, place_std_m: float
) -> None:
    found = edge_doubt(world)
    assert len(found.edge_m) == len(paved_areas(world)) > 3
    assert found.edge_m == pytest.approx(edge_m)
    assert found.place_std_m == pytest.approx(place_std_m)


def test_a_drawn_town_is_the_very_place() -> None:
    assert not np.concatenate(edge_doubt(town_world("n4"))).any()


def test_one_road_that_nobody_measured_leaves_its_junction_open_and_no_other_road() -> None:
    world = mapped(width="tagged")
    vague, *_ = world.roads
    lanes = tuple(
        msgspec.structs.replace(lane, width_m=Quantity(lane.width_m.value, "default"))
        if lane.id in vague.lane_ids
        else lane
        for lane in world.lanes
    )
    edges_m = edge_doubt(msgspec.structs.replace(world, lanes=lanes)).edge_m
    named = dict(zip((area.id for area in paved_areas(world)), edges_m, strict=True))
    assert [m for name, m in named.items() if name.endswith(vague.id)] == [UNCOUNTED_EDGE_M]
    assert (edges_m == TAGGED_EDGE_M).sum() >= len(world.roads) - 1


def farther_m(most: DrivableGround, drawn: DrivableGround) -> float:
    """How far the outline of one ground lies beyond another, the median of its points."""
    outline = shapely.points(shapely.get_coordinates(shapely.convex_hull(most.surface)))
    return float(np.median(shapely.distance(outline, drawn.surface)))


def test_ground_grows_by_what_is_left_open() -> None:
    world = mapped()
    most = DrivableGround(world, wider_m=edge_doubt(world).edge_m)
    assert farther_m(most, DrivableGround(world)) == pytest.approx(UNCOUNTED_EDGE_M, abs=0.1)


def test_a_road_goes_by_its_own_width_where_another_goes_on() -> None:
    """Two roads end to end: the second one's width is a default."""
    town = mapped(width="tagged")
    road, lane = town.roads[0], town.lanes[0]
    outline = np.array([[0.0, -3.0], [50.0, -3.0], [50.0, 3.0], [0.0, 3.0]])
    ends = np.array([[0.0, 0.0], [50.0, 0.0]])
    halves = [("one", "tagged", 0.0), ("two", "default", 50.0)]
    lanes, roads, areas = [], [], []
    for name, source, from_m in halves:
        width = Quantity(3.0, source)  # type: ignore[arg-type]
        along = np.array([from_m, 0.0])
        lanes.append(msgspec.structs.replace(lane, id=name, width_m=width))
        roads.append(msgspec.structs.replace(road, lane_ids=(name,), reference_line=ends + along))
        areas.append(Area(id=name, outline=outline + along))
    world = msgspec.structs.replace(
        town, lanes=tuple(lanes), roads=tuple(roads), road_surface=tuple(areas), junctions=()
    )
    assert edge_doubt(world).edge_m.tolist() == [TAGGED_EDGE_M, UNCOUNTED_EDGE_M]
