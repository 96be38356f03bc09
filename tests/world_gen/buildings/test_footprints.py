"""Buildings of a map: courtyards, parts, outlines that cannot be used, and what a World gets."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from foretwin.contracts.beside_road import Building
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.buildings.footprints import (
    FOOTPRINT_TOLERANCE_M,
    BuildingIndex,
    buildings_in_frame,
)
from foretwin.world_gen.buildings.parts import Footprint
from foretwin.world_gen.osm.osm_map import OsmMap
from tests.world_gen.drawn_maps import drawn_map

COVERS = (
    "foretwin.world_gen.buildings.outlines",
    "foretwin.world_gen.buildings.parts",
)
SQUARE = {1: (0.0, 0.0), 2: (20.0, 0.0), 3: (20.0, 20.0), 4: (0.0, 20.0)}
YARD = {5: (5.0, 5.0), 6: (15.0, 5.0), 7: (15.0, 15.0), 8: (5.0, 15.0)}
HALVES = SQUARE | {9: (10.0, 0.0), 10: (10.0, 20.0)}
OUTLINE = (20, [1, 2, 3, 4, 1], {"building": "yes", "height": "10"})
NOWHERE = np.zeros(0, dtype=object)
FRAME = LocalFrame(GeoPoint(52.0, 10.0))
EVERYWHERE = shapely.box(-1e5, -1e5, 1e5, 1e5)


def footprints(osm: OsmMap, notes: list[str]) -> tuple[Footprint, ...]:
    index = BuildingIndex(osm)
    found = index.within(EVERYWHERE)
    notes.extend(index.notes)
    notes.extend(dict.fromkeys(f.note for f in found if f.note))
    return found


def test_a_multipolygon_has_its_courtyard():
    osm = drawn_map(
        SQUARE | YARD,
        [(10, [1, 2, 3], {}), (11, [3, 4, 1], {}), (12, [5, 6, 7, 8, 5], {})],
        relations=[
            (
                9,
                [("w", 10, "outer"), ("w", 11, "outer"), ("w", 12, "inner")],
                {"type": "multipolygon", "building": "yes"},
            )
        ],
    )
    (building,) = footprints(osm, [])
    assert building.id == "r9"
    assert building.polygon.area == pytest.approx(300.0, rel=1e-3)


def test_a_multipolygon_that_does_not_close_is_named():
    notes: list[str] = []
    osm = drawn_map(
        SQUARE,
        [(10, [1, 2, 3], {})],
        relations=[
            (
                9,
                [("w", 10, "outer"), ("w", 11, "outer")],
                {"type": "multipolygon", "building": "yes"},
            )
        ],
    )
    assert footprints(osm, notes) == ()
    assert notes == [
        "relation 9: way 11 is missing in the map",
        "relation 9: building outline does not close; left out",
    ]


def test_parts_replace_the_outline_they_cover():
    osm = drawn_map(
        HALVES,
        [
            (20, [1, 2, 3, 4, 1], {"building": "yes"}),
            (21, [1, 9, 10, 4, 1], {"building:part": "yes", "height": "30"}),
            (22, [9, 2, 3, 10, 9], {"building:part": "yes", "height": "9"}),
        ],
    )
    assert [(b.id, b.height_m.value) for b in footprints(osm, [])] == [("w21", 30.0), ("w22", 9.0)]


def test_what_parts_do_not_cover_stays_at_the_outlines_height():
    osm = drawn_map(
        HALVES, [OUTLINE, (21, [1, 9, 10, 4, 1], {"building:part": "yes", "height": "30"})]
    )
    rest, part = footprints(osm, [])
    assert (rest.id, rest.height_m.value, part.id, part.height_m.value) == ("w20", 10, "w21", 30)
    assert rest.polygon.area == pytest.approx(200.0, rel=1e-3)
    assert len(rest.polygon.exterior.coords) == 5


def test_a_tower_on_the_roof_leaves_the_house_below_it():
    tower = {"building:part": "yes", "min_height": "10", "height": "25"}
    osm = drawn_map(SQUARE | YARD, [OUTLINE, (21, [5, 6, 7, 8, 5], tower)])
    house, top = footprints(osm, [])
    assert house.polygon.area == pytest.approx(400.0, rel=1e-3)
    assert (top.min_height_m, top.height_m.value) == (10.0, 25.0)


def test_below_an_overhang_is_open():
    arcade = {"building:part": "yes", "building:min_level": "1", "height": "10"}
    osm = drawn_map(HALVES, [OUTLINE, (21, [1, 9, 10, 4, 1], arcade)])
    rest, overhang = footprints(osm, [])
    assert rest.polygon.area == pytest.approx(200.0, rel=1e-3)
    assert overhang.min_height_m == 3.0


def test_a_part_without_a_height_has_its_outlines():
    osm = drawn_map(HALVES, [OUTLINE, (21, [1, 9, 10, 4, 1], {"building:part": "yes"})])
    assert [f.height_m for f in footprints(osm, [])] == [
        Quantity(10.0, "tagged"),
        Quantity(10.0, "inferred"),
    ]


def test_a_part_without_an_outline_is_a_building():
    osm = drawn_map(SQUARE, [(21, [1, 2, 3, 4, 1], {"building:part": "yes", "height": "4"})])
    assert [f.id for f in footprints(osm, [])] == ["w21"]


def test_what_is_no_building_is_left_out_and_named():
    notes: list[str] = []
    osm = drawn_map(
        SQUARE,
        [
            (1, [1, 2, 3, 4], {"building": "yes"}),
            (2, [1, 2, 3, 4, 1], {"building": "no"}),
            (3, [1, 2, 3, 4, 1], {"building": "yes", "location": "underground"}),
            (4, [1, 2, 3, 4, 1], {"building": "yes", "layer": "-1"}),
            (5, [1, 2, 1], {"building": "yes"}),
            (6, [1, 2, 1, 2, 1], {"building": "yes"}),
        ],
    )
    assert footprints(osm, notes) == ()
    assert notes == [
        "way 1: building outline is not closed; left out",
        "way 4: building below the road; left out",
        "way 5: building outline has fewer than three corners; left out",
        "way 6: building encloses no area; left out",
    ]


def test_a_self_crossing_outline_becomes_its_areas_and_is_named():
    notes: list[str] = []
    osm = drawn_map(SQUARE, [(1, [1, 3, 2, 4, 1], {"building": "yes"})])
    found = footprints(osm, notes)
    assert sum(b.polygon.area for b in found) == pytest.approx(200.0, rel=1e-3)
    assert all(b.polygon.is_valid for b in found)
    assert notes == ["way 1: building outline crosses itself; mended"]
    buildings, _, told = buildings_in_frame(found, FRAME, FRAME, NOWHERE)
    assert [b.id for b in buildings] == ["w1", "w1.1"]
    assert told == tuple(notes)


def test_asking_by_place_gives_what_asking_for_all_gives():
    part = {"building:part": "yes"}
    osm = drawn_map(
        HALVES | {k + 20: (x + 500.0, y) for k, (x, y) in HALVES.items()},
        [
            OUTLINE,
            (21, [1, 9, 10, 4, 1], part),
            (30, [21, 22, 23, 24, 21], {"building": "yes"}),
            (31, [21, 29, 30, 24, 21], part | {"height": "8"}),
        ],
    )
    index = BuildingIndex(osm)
    near = index.within(shapely.Point(5.0, 10.0).buffer(2.0))
    assert [f.id for f in near] == ["w21"]  # the rest of the outline does not reach there
    far = index.within(shapely.Point(510.0, 10.0).buffer(30.0))
    assert [f.id for f in far] == ["w30", "w31"]
    every = footprints(osm, [])
    assert [f for f in every if f.id in ("w21", "w30", "w31")] == [*near, *far]
    assert index.within(shapely.Point(5000.0, 0.0).buffer(10.0)) == ()


def test_a_building_is_cut_back_where_a_lane_passes():
    house = Footprint("w1", shapely.box(0.0, 0.0, 10.0, 10.0), Quantity(6.0, "default"), 0.0, False)
    arch = house._replace(id="w2", min_height_m=4.0)
    aside = shapely.box(50.0, -5.0, 53.0, 15.0)
    assert buildings_in_frame([house], FRAME, FRAME, np.array([aside]))[1:] == ((), ())
    lane = shapely.box(4.0, -5.0, 7.0, 15.0)
    buildings, cut, notes = buildings_in_frame([house, arch], FRAME, FRAME, np.array([lane]))
    assert [b.id for b in buildings] == ["w1", "w1-1", "w2"]
    assert sum(_polygon(b).area for b in buildings[:2]) == pytest.approx(70.0)
    assert _polygon(buildings[2]).area == pytest.approx(100.0)
    assert notes == ("buildings cut back where a lane passes: w1",)
    (away,) = cut
    assert away.id == "w1"
    assert Polygon(away.outline).equals(shapely.box(4.0, 0.0, 7.0, 10.0))


def test_what_is_cut_back_is_not_told_where_a_passage_leads_through():
    house = Footprint("w1", shapely.box(0.0, 0.0, 10.0, 10.0), Quantity(6.0, "default"), 0.0, False)
    lane = shapely.box(4.0, -5.0, 7.0, 15.0)
    for passage, told_m2 in ((lane.buffer(0.5), []), (shapely.box(4.0, 0.0, 7.0, 6.0), [12.0])):
        made = buildings_in_frame([house], FRAME, FRAME, np.array([lane]), passage)
        assert [Polygon(area.outline).area for area in made.cut_away] == pytest.approx(told_m2)
        assert sum(_polygon(b).area for b in made.buildings) == pytest.approx(70.0)


def _polygon(building: Building) -> Polygon:
    return Polygon(building.outline, building.holes)


@given(
    st.lists(st.floats(2.0, 30.0), min_size=4, max_size=40),
    st.floats(-3000.0, 3000.0),
    st.booleans(),
)
def test_a_footprint_keeps_its_silhouette(radii, east_m, yard):
    east = np.array([east_m, 0.0])
    turn = np.arange(len(radii)) * (2 * math.pi / len(radii))
    ring = np.array(radii)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    shape = Polygon(ring + east, [ring * 0.3 + east] if yard else [])
    near = [Footprint("w1", shape, Quantity(6.0, "default"), 0.0, False)]
    buildings, *_ = buildings_in_frame(near, FRAME, FRAME, NOWHERE)
    kept = shapely.union_all([_polygon(b) for b in buildings])
    assert all(_polygon(b).is_valid and _polygon(b).exterior.is_ccw for b in buildings)
    assert shapely.hausdorff_distance(kept.boundary, shape.boundary) <= FOOTPRINT_TOLERANCE_M
