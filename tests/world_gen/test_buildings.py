"""Buildings: heights from tags, courtyards, parts, and outlines that cannot be used."""

from __future__ import annotations

import pytest

from contracts.world import Quantity
from tests.world_gen.drawn_maps import drawn_map
from world_gen.buildings import building_height, footprints, height_in_m

SQUARE = {1: (0.0, 0.0), 2: (20.0, 0.0), 3: (20.0, 20.0), 4: (0.0, 20.0)}
YARD = {5: (5.0, 5.0), 6: (15.0, 5.0), 7: (15.0, 15.0), 8: (5.0, 15.0)}


@pytest.mark.parametrize(
    ("text", "height_m"),
    [
        ("12", 12.0), ("12.5 m", 12.5), ("8,4", 8.4), ("40'", 12.192), ("40' 6\"", 12.3444),
        ("tall", None), ("-3", None), ("1e9", None), ("99999", None), ("", None), (None, None),
    ],
)  # fmt: skip
def test_heights_are_read_or_refused(text, height_m):
    assert height_in_m(text) == (None if height_m is None else pytest.approx(height_m))


def test_height_is_tagged_then_from_levels_then_default():
    assert building_height({"height": "12", "building:levels": "9"})[0] == Quantity(12.0, "tagged")
    levels = {"building:levels": "4", "roof:levels": "1"}
    assert building_height(levels)[0] == Quantity(15.0, "inferred")
    assert building_height({})[0] == Quantity(6.0, "default")


def test_min_height_is_kept_below_the_height():
    assert building_height({"height": "20", "min_height": "12"})[1] == 12.0
    assert building_height({"height": "20", "building:min_level": "2"})[1] == 6.0
    assert building_height({"height": "5", "min_height": "12"})[1] == 0.0


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


def test_parts_replace_the_outline_they_cover():
    osm = drawn_map(
        SQUARE | {9: (10.0, 0.0), 10: (10.0, 20.0)},
        [
            (20, [1, 2, 3, 4, 1], {"building": "yes"}),
            (21, [1, 9, 10, 4, 1], {"building:part": "yes", "height": "30"}),
            (22, [9, 2, 3, 10, 9], {"building:part": "yes", "height": "9"}),
        ],
    )
    assert [(b.id, b.height_m.value) for b in footprints(osm, [])] == [("w21", 30.0), ("w22", 9.0)]


def test_a_part_of_an_outline_that_stays_is_left_out():
    osm = drawn_map(
        SQUARE | YARD,
        [
            (20, [1, 2, 3, 4, 1], {"building": "yes", "height": "10"}),
            (21, [5, 6, 7, 8, 5], {"building:part": "yes", "height": "30"}),
        ],
    )
    assert [b.id for b in footprints(osm, [])] == ["w20"]


def test_what_is_no_building_is_left_out_and_named():
    notes: list[str] = []
    osm = drawn_map(
        SQUARE,
        [
            (1, [1, 2, 3, 4], {"building": "yes"}),
            (2, [1, 2, 3, 4, 1], {"building": "no"}),
            (3, [1, 2, 3, 4, 1], {"building": "yes", "location": "underground"}),
        ],
    )
    assert footprints(osm, notes) == ()
    assert notes == ["way 1: building outline is not closed; left out"]


def test_a_self_crossing_outline_becomes_its_areas():
    osm = drawn_map(SQUARE, [(1, [1, 3, 2, 4, 1], {"building": "yes"})])
    found = footprints(osm, [])
    assert sum(b.polygon.area for b in found) == pytest.approx(200.0, rel=1e-3)
    assert all(b.polygon.is_valid for b in found)
