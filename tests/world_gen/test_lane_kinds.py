"""Lanes that are not for all cars: what tags say of buses, bicycles, parking, and the middle."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.lanes.cross_section import cross_section
from tests.world_gen.drawn_maps import GERMANY, IRELAND, crossing, drawn_map, world_of
from tests.world_gen.road_edges import road

COVERS = ("foretwin.world_gen.lanes.tram_tracks",)


def _kinds(tags, *, forward=1, backward=1, side="right") -> list[str]:
    """Return kind and direction of lanes from left to right along the way."""
    section = cross_section(road(tags, forward=forward, backward=backward, side=side))
    return [f"{lane.kind}{'-' if lane.reverse else '+'}" for lane in section.lanes]


@pytest.mark.parametrize(
    ("tags", "forward", "backward", "kinds"),
    [
        ({"bus:lanes": "designated|"}, 2, 0, ["bus+", "driving+"]),
        ({"bus:lanes:backward": "yes|designated"}, 1, 2, ["bus-", "driving-", "driving+"]),
        ({"vehicle:lanes": "yes|no", "psv:lanes": "|yes"}, 2, 0, ["driving+", "bus+"]),
        ({"access:lanes": "|no", "bus:lanes": "|yes"}, 2, 0, ["driving+", "bus+"]),
        ({"access:lanes": "||psv"}, 3, 0, ["driving+", "driving+", "bus+"]),
        ({"access:lanes": "yes|yes|no"}, 3, 0, ["driving+", "driving+", "closed+"]),
        ({"vehicle:lanes:backward": "yes|private"}, 1, 2, ["closed-", "driving-", "driving+"]),
        ({"access:lanes": "no|no"}, 2, 0, ["driving+", "driving+"]),
        ({"lanes:bus": "1"}, 3, 0, ["driving+", "driving+", "bus+"]),
        ({"lanes:psv:forward": "1"}, 2, 1, ["driving-", "driving+", "bus+"]),
        ({"busway": "lane"}, 2, 2, ["bus-", "driving-", "driving+", "bus+"]),
        ({"busway:right": "lane"}, 2, 2, ["driving-", "driving-", "driving+", "bus+"]),
        ({"busway:right": "lane"}, 1, 1, ["driving-", "driving+"]),
        ({"busway": "opposite_lane", "oneway": "yes"}, 1, 0, ["bus-", "driving+"]),
        ({"cycleway": "lane"}, 1, 1, ["bicycle-", "driving-", "driving+", "bicycle+"]),
        ({"cycleway:right": "track"}, 1, 1, ["driving-", "driving+"]),
        ({"cycleway": "lane"}, 1, 0, ["driving+", "bicycle+"]),
        ({"cycleway": "opposite_lane"}, 1, 0, ["bicycle-", "driving+"]),
        ({"cycleway:left": "lane", "oneway:bicycle": "no"}, 1, 0, ["bicycle-", "driving+"]),
        ({"cycleway:left": "lane"}, 1, 0, ["bicycle+", "driving+"]),
        ({"bicycle:lanes": "|designated|"}, 2, 0, ["driving+", "bicycle+", "driving+"]),
        (
            {"bicycle:lanes": "|designated|", "cycleway:right": "lane"},
            2,
            0,
            ["driving+", "bicycle+", "driving+"],
        ),
        ({"parking:both": "lane"}, 1, 1, ["parking-", "driving-", "driving+", "parking+"]),
        ({"parking:right": "street_side"}, 1, 0, ["driving+", "parking+"]),
        ({"parking:left": "on_kerb", "parking:right": "no"}, 1, 1, ["driving-", "driving+"]),
        ({"parking:lane:both": "parallel"}, 1, 1, ["parking-", "driving-", "driving+", "parking+"]),
        (
            {"parking:lane:right": "diagonal", "parking:lane:right:diagonal": "on_kerb"},
            1,
            1,
            ["driving-", "driving+"],
        ),
        (
            {"cycleway:right": "lane", "parking:right": "lane"},
            1,
            1,
            ["driving-", "driving+", "bicycle+", "parking+"],
        ),
        ({"lanes:both_ways": "1"}, 1, 1, ["driving-", "driving+", "driving+"]),
    ],
)
def test_kinds_of_lanes_where_traffic_keeps_right(tags, forward, backward, kinds):
    assert _kinds(tags, forward=forward, backward=backward) == kinds


def test_kinds_of_lanes_where_traffic_keeps_left():
    tags = {"cycleway": "lane", "lanes:bus:forward": "1"}
    assert _kinds(tags, forward=2, side="left") == [
        "bicycle+",
        "bus+",
        "driving+",
        "driving-",
        "bicycle-",
    ]


def test_a_road_of_bus_lanes_alone_keeps_lanes_for_all():
    section = cross_section(road({"bus:lanes": "designated"}, forward=1, backward=0))
    assert [lane.kind for lane in section.lanes] == ["driving"]
    assert section.notes == ("way 7: no lane is left for cars; taken as for all",)


@pytest.mark.parametrize(
    ("tags", "width"),
    [
        ({"cycleway:right": "lane", "cycleway:right:width": "1.5"}, Quantity(1.5, "tagged")),
        ({"cycleway:right": "lane"}, Quantity(1.85, "default")),
        (
            {"parking:right": "lane", "parking:right:orientation": "perpendicular"},
            Quantity(5.0, "default"),
        ),
        ({"parking:right": "lane"}, Quantity(2.0, "default")),
    ],
)
def test_widths_of_lanes_at_the_kerb(tags, width):
    section = cross_section(road(tags))
    assert section.lanes[-1].width_m == width
    # Those for cars stay where they were.
    assert [lane.left_m for lane in section.lanes[:2]] == [1.5, -1.5]


def test_changing_lanes():
    tags = {"change:lanes": "not_left|yes|only_left|no"}
    lanes = cross_section(road(tags, forward=4, backward=0)).lanes
    assert [lane.change for lane in lanes] == ["right", "both", "left", "none"]
    assert {lane.change_source for lane in lanes} == {"tagged"}
    (plain,) = cross_section(road(forward=1, backward=0)).lanes
    assert (plain.change, plain.change_source) == ("both", "default")


@pytest.mark.parametrize("place", [GERMANY, IRELAND])
def test_a_centre_lane_is_where_turns_across_the_road_begin(place):
    street = {"highway": "secondary", "name": "Street", "lanes": "3", "lanes:both_ways": "1"}
    world = world_of(crossing(street=street, origin=place))
    across = "left" if place is GERMANY else "right"
    for way in (11, 13):
        (centre,) = (ln for ln in world.lanes if ln.osm_way == way and ln.id.endswith("centre"))
        assert abs(centre.left_of_reference_m) < 1e-9
        assert (centre.turns, centre.turns_source) == ((across,), "inferred")
        # It is driven toward the junction, whichever way the way is drawn.
        assert np.hypot(*centre.centerline[-1]) < np.hypot(*centre.centerline[0])
        turns = {
            c.turn: c.from_lane_id
            for c in world.connections
            if c.from_lane_id.startswith(f"w{way}.")
        }
        assert turns[across] == centre.id
        assert turns["straight"] != centre.id
    assert any("its centre lane" in note for note in world.notes)
    assert {arm.lanes_in for arm in world.junctions[0].arms} == {1}


def _limits_kmph(street: dict[str, str]) -> dict[str, float]:
    """Return the limits of the lanes of one way of a crossing whose street has these tags."""
    world = world_of(crossing(street={"highway": "secondary", "name": "Street", **street}))
    lanes = (lane for lane in world.lanes if lane.osm_way == 11)
    return {lane.id.rsplit(".", 1)[-1]: lane.speed_limit_mps.value * 3.6 for lane in lanes}


def test_each_direction_has_its_own_limit():
    limits = _limits_kmph({"maxspeed:forward": "70", "maxspeed:backward": "30"})
    assert limits == pytest.approx({"f0": 70.0, "b0": 30.0})


def test_a_lane_s_own_limit_goes_before_that_of_its_road():
    lanes = {"oneway": "yes", "lanes": "3", "maxspeed": "100", "maxspeed:lanes": "80|none|"}
    assert _limits_kmph(lanes) == pytest.approx({"f0": 80.0, "f1": 130.0, "f2": 100.0})


def test_lanes_of_one_direction_have_limits_beside_those_of_the_other():
    both = {"lanes:forward": "2", "lanes:backward": "1", "lanes": "3", "maxspeed": "60"}
    limits = _limits_kmph({**both, "maxspeed:lanes:forward": "60|30", "maxspeed:backward": "50"})
    assert limits == pytest.approx({"f0": 60.0, "f1": 30.0, "b0": 50.0})


def test_buses_keep_to_their_lane_through_a_junction():
    street = {
        "highway": "secondary",
        "name": "Street",
        "oneway": "yes",
        "lanes": "2",
        "bus:lanes": "|designated",
    }
    world = world_of(crossing(street=street))
    kind = {lane.id: lane.kind for lane in world.lanes}
    onto = {
        (kind[c.from_lane_id], kind[c.to_lane_id])
        for c in world.connections
        if c.turn == "straight" and c.from_lane_id.startswith("w13.")
    }
    assert onto == {("driving", "driving"), ("bus", "bus")}
    right = [c for c in world.connections if c.turn == "right" and "w13." in c.from_lane_id]
    assert {kind[c.from_lane_id] for c in right} == {"driving"}


def test_a_transition_leads_lanes_from_one_place_to_the_next():
    one_way = {"highway": "secondary", "oneway": "yes", "lanes": "2", "name": "Street"}
    osm = drawn_map(
        {
            0: (0.0, 0.0),
            1: (40.0, 0.0),
            2: (80.0, 0.0),
            3: (120.0, 0.0),
            4: (0.0, -90.0),
            5: (0.0, 90.0),
        },
        [
            (11, [0, 1], one_way | {"placement": "right_of:1"}),
            (12, [1, 2], one_way | {"placement": "transition"}),
            (13, [2, 3], one_way | {"placement": "right_of:2"}),
            (14, [4, 0], {"highway": "residential"}),
            (15, [0, 5], {"highway": "residential"}),
        ],
    )
    world = world_of(osm)
    by_way = {lane.osm_way: lane for lane in world.lanes if lane.id.endswith("f0")}
    assert by_way[12].id in by_way[11].successor_ids
    assert by_way[13].id in by_way[12].successor_ids
    np.testing.assert_allclose(by_way[12].centerline[0], by_way[11].centerline[-1], atol=0.02)
    np.testing.assert_allclose(by_way[13].centerline[0], by_way[12].centerline[-1], atol=0.02)
    assert by_way[13].centerline[-1][1] - by_way[11].centerline[0][1] == pytest.approx(3.25)
