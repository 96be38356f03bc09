"""What tags say of a building's height, its underside, and whether it stands above ground."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.buildings.tags import (
    HEIGHT_KEYS,
    building_extent,
    height_in_m,
    is_part,
    stands_above_ground,
)


@pytest.mark.parametrize(
    ("text", "height_m"),
    [
        ("12", 12.0),
        ("12.5 m", 12.5),
        ("8,4", 8.4),
        ("40'", 12.192),
        ("40' 6\"", 12.3444),
        ("40 ft", 12.192),
        ("40ft 6in", 12.3444),
        ("6 feet", 1.8288),
        ("tall", None),
        ("-3", None),
        ("1e9", None),
        ("99999", None),
        ("", None),
        (None, None),
    ],
)
def test_heights_are_read_or_refused(text, height_m):
    assert height_in_m(text) == (None if height_m is None else pytest.approx(height_m))


@pytest.mark.parametrize(
    ("tags", "height"),
    [
        ({"height": "12", "building:levels": "9"}, Quantity(12.0, "tagged")),
        ({"building:height": "11 m"}, Quantity(11.0, "tagged")),
        ({"est_height": "9"}, Quantity(9.0, "inferred")),
        ({"building:levels": "4"}, Quantity(12.0, "inferred")),
        ({"building:levels": "4", "roof:levels": "1"}, Quantity(15.0, "inferred")),
        ({"building:levels": "4", "roof:height": "2.5"}, Quantity(14.5, "inferred")),
        ({"height": "12", "roof:shape": "gabled", "roof:height": "4"}, Quantity(12.0, "tagged")),
        ({"building:levels": "1e9"}, Quantity(6.0, "default")),
        ({}, Quantity(6.0, "default")),
    ],
)
def test_height_is_tagged_then_from_levels_then_default(tags, height):
    assert building_extent({"building": "yes"} | tags).height_m == height


def test_min_height_is_kept_below_the_height():
    assert building_extent({"height": "20", "min_height": "12"}).min_height_m == 12.0
    assert building_extent({"height": "20", "building:min_level": "2"}).min_height_m == 6.0
    contrary = building_extent({"height": "5", "min_height": "12"})
    assert contrary.min_height_m == 0.0
    assert "above its height 5" in contrary.note


def test_what_begins_high_up_and_has_no_height_reaches_a_level_above():
    extent = building_extent({"building:part": "yes", "min_height": "15"})
    assert extent.min_height_m == 15.0
    assert extent.height_m == Quantity(18.0, "default")


@pytest.mark.parametrize(
    ("tags", "low_m", "high_m"),
    [
        ({"building": "roof"}, 4.6, 5.0),
        ({"building": "roof", "height": "8"}, 7.6, 8.0),
        ({"building": "roof", "height": "8", "roof:height": "3"}, 5.0, 8.0),
        ({"building": "roof", "height": "8", "min_height": "4"}, 4.0, 8.0),
        ({"building": "carport"}, 2.6, 3.0),
        ({"building:part": "roof", "building:levels": "1"}, 2.6, 3.0),
        ({"building": "yes", "wall": "no"}, 4.6, 5.0),
        ({"building": "bridge"}, 4.5, 6.0),
        ({"building": "bridge", "building:levels": "1"}, 4.5, 7.5),
    ],
)
def test_nothing_stands_below_a_roof_on_posts_and_below_a_bridge(tags, low_m, high_m):
    extent = building_extent(tags)
    assert extent.min_height_m == pytest.approx(low_m)
    assert extent.height_m.value == pytest.approx(high_m)


def test_values_that_say_nothing_are_named():
    assert building_extent({"height": "tall"}).note == "height=tall is not understood"
    assert "building:levels=2-3" in building_extent({"building:levels": "2-3"}).note


@pytest.mark.parametrize(
    ("tags", "stands"),
    [
        ({"building": "yes"}, True),
        ({"building": "no"}, False),
        ({"highway": "service"}, False),
        ({"building": "demolished"}, False),
        ({"building": "yes", "layer": "1"}, True),
        ({"building": "yes", "layer": "-1"}, False),
        ({"building": "yes", "layer": "-0"}, True),
        ({"building": "yes", "location": "underground"}, False),
        ({"building": "yes", "tunnel": "yes"}, False),
        ({"building:part": "yes"}, True),
    ],
)
def test_what_is_not_built_or_below_the_road_is_no_building(tags, stands):
    assert stands_above_ground(tags) is stands


def test_a_part_is_what_is_no_building_itself():
    assert is_part({"building:part": "yes"})
    assert is_part({"building:part": "yes", "building": "no"})
    assert not is_part({"building:part": "yes", "building": "yes"})


_KEYS = [
    *sorted(HEIGHT_KEYS),
    "building",
    "building:part",
    "layer",
    "location",
    "tunnel",
    "wall",
    "bridge",
]
_VALUES = st.one_of(
    st.sampled_from(["yes", "no", "roof", "carport", "bridge", "-1", "--1", "-x", "0", "3;4"]),
    st.floats(-10.0, 1e6).map(str),
    st.text(max_size=6),
)


@given(st.dictionaries(st.sampled_from(_KEYS), _VALUES, max_size=6))
def test_any_tags_give_a_block_that_stands_above_its_underside(tags):
    assert stands_above_ground(tags) in (True, False)
    extent = building_extent(tags)
    assert 0.0 <= extent.min_height_m < extent.height_m.value < 2000.0
