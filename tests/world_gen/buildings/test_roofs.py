"""What tags say of a roof, and which way it lies over its building."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.beside_road import Roof
from foretwin.world_gen.buildings.roofs import roof_over, roof_tags
from tests.world_gen.buildings.test_footprints import SQUARE, footprints
from tests.world_gen.drawn_maps import crossing, drawn_map, world_of

HOUSE = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 8.0], [0.0, 8.0]])


def roof(tags: dict[str, str], *, height_m: float = 9.0, low_m: float = 0.0) -> Roof | None:
    found = roof_over(HOUSE, roof_tags(tags), height_m=height_m, min_height_m=low_m)
    return None if isinstance(found, msgspec.UnsetType) else found


def ridge_deg(tags: dict[str, str]) -> float:
    found = roof({"roof:shape": "gabled", **tags})
    assert found is not None
    return math.degrees(found.ridge_rad) % 180.0


def test_the_ridge_lies_along_the_longer_side_unless_the_map_says_otherwise() -> None:
    assert ridge_deg({}) == pytest.approx(0.0, abs=0.01)
    assert ridge_deg({"roof:orientation": "across"}) == pytest.approx(90.0, abs=0.01)
    assert ridge_deg({"roof:direction": "90"}) == pytest.approx(90.0, abs=0.01)
    assert ridge_deg({"roof:direction": "NNE"}) == pytest.approx(157.5, abs=0.01)
    assert ridge_deg({"roof:direction": "uphill"}) == pytest.approx(0.0, abs=0.01)


def test_a_lean_to_falls_where_its_direction_points() -> None:
    found = roof({"roof:shape": "skillion", "roof:direction": "S"})
    assert found is not None
    # To the left of a ridge that points west lies south.
    assert found.ridge_rad == pytest.approx(math.pi, abs=1e-3)


@pytest.mark.parametrize(
    ("tags", "height_m", "source"),
    [
        ({"roof:height": "3.5"}, 3.5, "tagged"),
        ({"roof:levels": "1"}, 3.0, "inferred"),
        ({"roof:angle": "45"}, 4.0, "inferred"),
        ({}, 2.4, "default"),
        ({"roof:height": "8"}, 6.5, "default"),  # walls must stay for cars to meet
    ],
)
def test_a_roof_is_as_high_as_its_tags_say(
    tags: dict[str, str], height_m: float, source: str
) -> None:
    found = roof({"roof:shape": "hipped", **tags})
    assert found is not None
    assert found.height_m.value == pytest.approx(height_m, abs=1e-3)
    assert found.height_m.source == source


@pytest.mark.parametrize("form", ["flat", "many", "saltbox", "", "constructor"])
def test_what_is_flat_or_drawn_by_no_rule_has_no_roof(form: str) -> None:
    assert roof({"roof:shape": form, "roof:height": "3"}) is None


def test_a_low_building_has_none() -> None:
    assert roof({"roof:shape": "gabled"}, height_m=2.6) is None
    assert roof({"roof:shape": "gabled"}, height_m=9.0, low_m=8.9) is None


@given(st.dictionaries(st.sampled_from(["roof:height", "roof:angle", "roof:direction"]), st.text()))
def test_no_text_breaks_a_roof(tags: dict[str, str]) -> None:
    found = roof({"roof:shape": "gabled", **tags})
    assert found is None or (math.isfinite(found.ridge_rad) and 0.3 <= found.height_m.value <= 6.5)


def test_a_world_holds_the_roofs_of_its_buildings() -> None:
    nodes = {20: (20.0, 20.0), 21: (32.0, 20.0), 22: (32.0, 28.0), 23: (20.0, 28.0)}
    tags = {"building": "house", "height": "9", "roof:shape": "gabled", "roof:height": "3"}
    made = world_of(crossing(extra_nodes=nodes, extra_ways=[(20, [*nodes, 20], tags)]))
    (house,) = made.buildings
    assert not isinstance(house.roof, msgspec.UnsetType)
    assert house.roof.form == "gabled"
    assert math.degrees(house.roof.ridge_rad) % 180.0 == pytest.approx(0.0, abs=0.1)
    assert b"roof" not in msgspec.json.encode(world_of(crossing()).buildings)


def test_what_is_left_of_an_outline_beside_its_parts_is_flat() -> None:
    osm = drawn_map(
        SQUARE | {9: (10.0, 0.0), 10: (10.0, 20.0)},
        [
            (20, [1, 2, 3, 4, 1], {"building": "yes", "height": "9", "roof:shape": "gabled"}),
            (21, [1, 9, 10, 4, 1], {"building:part": "yes", "height": "12"}),
        ],
    )
    left, part = sorted(footprints(osm, []), key=lambda found: found.height_m.value)
    assert (left.roof, part.roof) == (None, None)
