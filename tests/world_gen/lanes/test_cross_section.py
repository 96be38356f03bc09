"""Cross-sections: what tags say about lanes, and what is assumed where they are silent."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.lanes.cross_section import cross_section
from foretwin.world_gen.lanes.lane_plans import metres
from tests.world_gen.road_edges import road as _road

COVERS = (
    "foretwin.world_gen.lanes.lane_plans",
    "foretwin.world_gen.lanes.lane_tags",
    "foretwin.world_gen.lanes.side_lanes",
)


def test_two_way_road_keeps_right_around_its_way():
    section = cross_section(_road())
    assert [(lane.reverse, lane.left_m) for lane in section.lanes] == [(True, 1.5), (False, -1.5)]
    assert (section.left_m, section.right_m) == (3.0, -3.0)


def test_two_way_road_keeps_left_around_its_way():
    section = cross_section(_road(side="left"))
    assert [(lane.reverse, lane.left_m) for lane in section.lanes] == [(False, 1.5), (True, -1.5)]


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(
    ("tags", "each_m", "source"),
    [
        ({}, 1.5, "default"),
        ({"width": "3.5"}, 1.75, "inferred"),
        ({"est_width": "2.2"}, 1.25, "inferred"),  # a car has to fit
        ({"width": "7"}, 3.5, "inferred"),  # cars pass each other, whatever `lanes` says
        ({"width": "4.8"}, 2.4, "inferred"),
    ],
)
def test_one_lane_for_both_directions_is_shared(side, tags, each_m, source):
    section = cross_section(_road({"lanes": "1", **tags}, side=side))
    assert [lane.width_m for lane in section.lanes] == [Quantity(each_m, source)] * 2
    assert section.width_m == pytest.approx(2 * each_m)
    assert [lane.left_m for lane in section.lanes] == [each_m / 2, -each_m / 2]
    assert bool(section.notes) == (each_m < 2.0)


def test_a_lane_each_way_is_not_shared():
    assert cross_section(_road()).width_m == 6.0
    assert cross_section(_road({"lanes": "1"}, backward=0)).width_m == 3.0
    assert cross_section(_road({"lanes": "1", "width:lanes:forward": "3.2"})).width_m > 6.0


@pytest.mark.parametrize(
    ("width", "widths_m"),
    [("2", [1.25, 1.25]), ("3", [1.5, 1.5]), ("3.9", [1.95, 1.95]), ("4", [2.0, 2.0])],
)
def test_a_street_too_narrow_for_two_lanes_has_one(width, widths_m):
    section = cross_section(_road({"width": width}, counts="default"))
    assert [lane.width_m for lane in section.lanes] == [Quantity(m, "inferred") for m in widths_m]
    shared = "way 7: one lane for both directions; each has half of its width"
    assert section.notes == ((shared,) if width != "4" else ())


@pytest.mark.parametrize(
    ("width", "tags", "cars_m", "bicycles_m"),
    [
        ("10", {"cycleway:both": "lane"}, 3.15, 1.85),
        ("7.85", {"cycleway:right": "lane"}, 3.0, 1.85),
        # Less than is usual: all are narrower in proportion.
        ("7", {"cycleway:both": "lane"}, 2.165, 1.335),
        ("7", {"cycleway:both": "lane", "cycleway:both:width": "1.5"}, 2.0, 1.5),
        # Beside the road, or of a width that no lanes have: the width is that of the rest.
        ("7", {"cycleway:both": "track"}, 3.5, None),
        ("5", {"cycleway:both": "lane"}, 3.0, 1.85),
    ],
)
def test_a_width_from_kerb_to_kerb_holds_the_bicycle_lanes(width, tags, cars_m, bicycles_m):
    section = cross_section(_road({"width": width, **tags}))
    found = {lane.kind: lane.width_m.value for lane in section.lanes}
    assert found["driving"] == pytest.approx(cars_m, abs=0.001)
    assert found.get("bicycle") == (bicycles_m and pytest.approx(bicycles_m, abs=0.001))
    if width != "5":
        assert section.width_m == pytest.approx(float(width), abs=0.01)
    assert bool(section.notes) == (width == "5")


def test_parking_beside_the_road_is_no_part_of_its_width():
    section = cross_section(_road({"width": "6", "parking:both": "street_side"}))
    assert [lane.width_m.value for lane in section.lanes] == [2.0, 3.0, 3.0, 2.0]


@pytest.mark.parametrize(("width", "each_m"), [("8", 4.0), ("9", 4.5), ("14", 4.5), ("16", 4.5)])
def test_a_lane_gets_of_a_great_width_half_as_much_again_as_is_usual(width, each_m):
    section = cross_section(_road({"width": width}))
    assert [lane.width_m for lane in section.lanes] == [Quantity(each_m, "inferred")] * 2
    left = f"way 7: its lanes need less than its width of {width} m"
    assert section.notes == ((left,) if float(width) > 9.0 else ())


def test_the_only_lane_of_a_race_track_is_as_wide_as_any_may_be():
    section = cross_section(_road({"width": "10"}, backward=0, road_class="raceway"))
    assert section.width_m == 7.5


def test_a_width_that_its_counted_lanes_cannot_have_is_named_and_not_used():
    for tags, forward, backward in (({"lanes": "2"}, 1, 1), ({}, 2, 0)):
        section = cross_section(
            _road({"width": "3.25", **tags}, forward=forward, backward=backward)
        )
        assert section.width_m == 6.0
        assert section.notes == ("way 7: its width of 3.25 m does not fit its lanes; not used",)


def test_lanes_are_numbered_from_the_left_as_their_driver_sees_them():
    section = cross_section(_road(forward=2, backward=2))
    assert [lane.left_m for lane in section.along(reverse=False).driven] == [-1.5, -4.5]
    assert [lane.left_m for lane in section.along(reverse=True).driven] == [1.5, 4.5]
    section = cross_section(_road(forward=2, backward=2, side="left"))
    assert [lane.left_m for lane in section.along(reverse=False).driven] == [4.5, 1.5]
    assert [lane.left_m for lane in section.along(reverse=True).driven] == [-4.5, -1.5]


def test_widths_are_tagged_or_inferred_or_default():
    lanes = cross_section(_road({"width:lanes": "3.1|2.7"}, forward=2, backward=0)).lanes
    assert [lane.width_m for lane in lanes] == [Quantity(3.1, "tagged"), Quantity(2.7, "tagged")]
    assert cross_section(_road()).lanes[0].width_m == Quantity(3.0, "default")
    odd = cross_section(_road(road_class="corridor"))
    assert odd.lanes[0].width_m == Quantity(3.0, "default")
    narrow = cross_section(_road({"width": "5 m"}))
    assert [lane.width_m for lane in narrow.lanes] == [Quantity(2.5, "inferred")] * 2


def test_turn_lanes_of_one_direction():
    tags = {"turn:lanes:forward": "left|through;right|none", "turn:backward": "slight_right"}
    section = cross_section(_road(tags, forward=3, backward=1))
    ahead = section.along(reverse=False).driven
    assert [lane.turns for lane in ahead] == [("left",), ("straight", "right"), ()]
    assert [lane.turns_source for lane in ahead] == ["tagged", "tagged", "inferred"]
    assert section.along(reverse=True).driven[0].turns == ("right",)


def test_bicycle_lanes_take_no_part_in_the_count():
    tags = {"bicycle:lanes": "|designated|", "turn:lanes": "left|through|right"}
    lanes = cross_section(_road(tags, forward=2, backward=0)).along(reverse=False).driven
    assert [lane.turns for lane in lanes] == [("left",), ("right",)]


def test_turn_lanes_that_do_not_fit_are_named_and_ignored():
    section = cross_section(_road({"turn:lanes": "left|right"}, forward=3, backward=0))
    assert section.notes == ("way 7: turn:lanes has 2 entries for 3 lanes",)
    assert all(lane.turns_source == "inferred" for lane in section.lanes)


def test_bus_lane():
    lanes = (
        cross_section(_road({"bus:lanes": "yes|designated"}, forward=2, backward=0))
        .along(reverse=False)
        .driven
    )
    assert [lane.kind for lane in lanes] == ["driving", "bus"]


@pytest.mark.parametrize(
    ("placement", "left_edge_m"), [("middle_of:1", 1.5), ("right_of:1", 3.0), ("left_of:1", 0.0)]
)
def test_placement_moves_the_carriageway(placement, left_edge_m):
    section = cross_section(_road({"placement": placement}, forward=2, backward=0))
    assert section.left_m == pytest.approx(left_edge_m)


def test_placement_against_the_way():
    section = cross_section(_road({"placement:backward": "right_of:1"}, backward=2))
    # From the left: backward 2, backward 1, forward. The way lies right of backward 1 as its
    # driver sees it, which is left of it along the way.
    assert section.left_m == pytest.approx(3.0)


@given(
    forward=st.integers(0, 5),
    backward=st.integers(0, 5),
    side=st.sampled_from(["left", "right"]),
    width=st.one_of(st.none(), st.floats(0.0, 100.0).map(str)),
)
def test_lanes_lie_side_by_side_and_fill_the_carriageway(forward, backward, side, width):
    if forward + backward == 0:
        return
    tags = {"width": width} if width else {}
    section = cross_section(_road(tags, forward=forward, backward=backward, side=side))
    assert len(section.lanes) == forward + backward
    edge = section.left_m
    for lane in section.lanes:
        assert lane.width_m.value >= 2.0
        assert lane.left_m == pytest.approx(edge - lane.width_m.value / 2)
        edge -= lane.width_m.value
    assert section.right_m == pytest.approx(edge)


@pytest.mark.parametrize(
    ("text", "value"),
    [("3.5", 3.5), ("3,5 m", 3.5), ("10 ft", 3.048), ("wide", None), ("-3", None)],
)
def test_metres(text, value):
    assert metres(text) == (value if value is None else pytest.approx(value))


@pytest.mark.parametrize(
    ("word", "kinds"), [("lane", ["bicycle", "driving"]), ("track", ["driving"])]
)
def test_a_cycle_track_against_a_one_way_street_is_no_lane_of_it(word, kinds):
    tags = {"oneway": "yes", "cycleway:left": word, "cycleway:left:oneway": "-1"}
    lanes = cross_section(_road(tags, backward=0)).lanes
    assert sorted(lane.kind for lane in lanes) == kinds
