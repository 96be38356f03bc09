"""Trees, posts and walls of a World: where the map has them, and never where cars drive."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.beside_road import Obstacle
from foretwin.contracts.world import World
from foretwin.world_gen.polygon_areas import polygons_from
from foretwin.world_gen.roadside.obstacles import CLEAR_OF_LANES_M
from tests.world_gen.drawn_maps import Tags, drawn_map, world_of

ROADS = [
    (1, (1, 2, 3), {"highway": "residential", "width": "6"}),
    (2, (2, 4), {"highway": "residential", "width": "6"}),
]
NODES = {1: (-100.0, 0.0), 2: (0.0, 0.0), 3: (100.0, 0.0), 4: (0.0, -100.0)}


def world(
    points: dict[int, tuple[float, float]] | None = None,
    tags: dict[int, Tags] | None = None,
    ways: list[tuple[int, tuple[int, ...], Tags]] | None = None,
) -> World:
    """A T-junction with things beside it."""
    return world_of(drawn_map({**NODES, **(points or {})}, [*ROADS, *(ways or [])], node_tags=tags))


def shape_of(one: Obstacle) -> shapely.Polygon:
    return shapely.Polygon(one.outline, one.holes)


def driven(place: World) -> shapely.Geometry:
    return shapely.union_all(polygons_from([(a.outline, a.holes) for a in place.road_surface]))


def test_a_tree_beside_the_road_stands_where_the_map_has_it() -> None:
    place = world({10: (30.0, 12.0)}, {10: {"natural": "tree", "height": "15"}})
    (tree,) = place.obstacles
    assert (tree.id, tree.kind, tree.height_m.source) == ("n10", "tree", "tagged")
    assert shape_of(tree).centroid.coords[0] == pytest.approx((30.0, 12.0), abs=0.01)
    assert shape_of(tree).area == pytest.approx(0.16, abs=0.001)
    assert not tree.opaque


def test_a_lamp_on_a_lane_is_left_out_and_named() -> None:
    place = world({10: (30.0, 1.0), 11: (30.0, 3.2), 12: (30.0, 3.6)},
                  {key: {"highway": "street_lamp"} for key in (10, 11, 12)})  # fmt: skip
    assert [one.id for one in place.obstacles] == ["n12"]
    assert "beside the road, left out where a lane passes: n10, n11" in place.notes


def test_a_wall_across_a_road_is_cut_there() -> None:
    place = world({10: (30.0, 20.0), 11: (30.0, -20.0)}, ways=[(3, (10, 11), {"barrier": "wall"})])
    assert [one.id for one in place.obstacles] == ["w3", "w3-1"]
    assert "beside the road, cut where a lane passes: w3" in place.notes
    lengths = sorted(float(np.ptp(one.outline[:, 1])) for one in place.obstacles)
    assert lengths == pytest.approx([20.0 - 3.0 - CLEAR_OF_LANES_M] * 2, abs=0.02)
    assert all(one.opaque for one in place.obstacles)


def test_a_fence_goes_around_its_area_and_a_hedge_may_fill_it() -> None:
    square = {10: (20.0, 20.0), 11: (40.0, 20.0), 12: (40.0, 40.0), 13: (20.0, 40.0)}
    for barrier, area_m2 in (("fence", 8.0), ("hedge", 400.0)):
        ring = (3, (10, 11, 12, 13, 10), {"barrier": barrier, "area": "yes"})
        (one,) = world(square, ways=[ring]).obstacles
        assert shape_of(one).area == pytest.approx(area_m2, rel=0.02), barrier


def test_a_shelter_at_a_stop_stands_along_the_road() -> None:
    place = world({10: (-3.0 - 3.0, -40.0)}, {10: {"highway": "bus_stop", "shelter": "yes"}})
    (shelter,) = place.obstacles
    assert np.ptp(shelter.outline, axis=0) == pytest.approx([1.5, 4.0], abs=0.01)
    assert shelter.opaque


def test_a_low_wall_hides_nobody() -> None:
    points = {10: (20.0, 20.0), 11: (40.0, 20.0)}
    low = [(3, (10, 11), {"barrier": "wall", "height": "0.8"})]
    (wall,) = world(points, ways=low).obstacles
    assert not wall.opaque


def test_what_lies_beyond_the_world_is_none_of_its() -> None:
    points = {10: (20.0, 120.0), 11: (20.0, 300.0), 12: (250.0, 250.0)}
    ways = [(3, (10, 11), {"barrier": "wall"})]
    place = world(points, {12: {"natural": "tree"}}, ways)
    (wall,) = place.obstacles
    assert np.hypot(*wall.outline.T).max() <= place.radius_m + 0.01


metres = st.floats(-60.0, 60.0)


@given(metres, metres, metres, metres, st.sampled_from(["wall", "hedge", "fence", "guard_rail"]))
def test_nothing_stands_where_a_car_drives(
    x: float, y: float, u: float, v: float, kind: str
) -> None:
    points = {10: (x, y), 11: (u, v), 12: (v, x)}
    place = world(points, {12: {"natural": "tree"}}, [(3, (10, 11), {"barrier": kind})])
    lanes = driven(place)
    for one in place.obstacles:
        assert shape_of(one).is_valid
        assert shape_of(one).exterior.is_ccw
        assert shape_of(one).intersection(lanes).area < 0.01
