"""The table of countries is whole, and says what is known of their roads."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.countries.outlines import OUTLINES, place_at
from foretwin.world_gen.countries.rules import COUNTRIES, rules_of
from foretwin.world_gen.roads.road_classes import ROAD_CLASSES
from tests.world_gen.drawn_maps import crossing, world_of

AUSTIN, SYDNEY, LEEDS = GeoPoint(30.27, -97.74), GeoPoint(-33.87, 151.2), GeoPoint(53.8, -1.55)


def test_every_country_of_the_table_has_an_outline_and_a_source() -> None:
    outlines = msgspec.json.decode(OUTLINES.read_bytes())["features"]
    codes = {feature["properties"]["code"] for feature in outlines}
    assert COUNTRIES.keys() <= codes
    assert all(rules.source for rules in COUNTRIES.values())
    assert len({rules.source for rules in COUNTRIES.values()}) == len(COUNTRIES)


@pytest.mark.parametrize("code", ["", "XX", *COUNTRIES])
def test_values_are_those_of_roads(code: str) -> None:
    rules = rules_of(code)
    assert 5 <= rules.living_street_kmph <= rules.local_kmph <= rules.town_kmph
    assert rules.town_kmph <= rules.rural_kmph <= rules.dual_kmph <= rules.motorway_kmph <= 140
    assert rules.lane_width_m.keys() <= ROAD_CLASSES.keys()
    assert all(2.7 <= width <= 3.8 for width in rules.lane_width_m.values())
    assert 0.0 <= rules.red_amber_s <= 2.0


def test_red_shows_with_amber_where_it_does() -> None:
    shown = {code for code, rules in COUNTRIES.items() if rules.red_amber_s}
    assert {"DE", "AT", "CH", "GB", "PL", "SE"} <= shown
    assert not shown & {"US", "CA", "FR", "MC", "IT", "ES", "NL", "BE", "JP", "AU", "IE"}


def test_one_turns_on_red_in_north_america_and_not_in_europe() -> None:
    assert rules_of("US").turn_on_red
    assert rules_of("CA").turn_on_red
    assert not any(rules_of(code).turn_on_red for code in ("DE", "FR", "GB", "AU"))


def test_a_world_s_lanes_are_as_wide_and_as_fast_as_its_country_s() -> None:
    tags = {"highway": "secondary", "name": "Lamar Boulevard"}
    there, here = (world_of(crossing(origin=origin, street=tags)) for origin in (AUSTIN, LEEDS))
    for world, width_m, mps in ((there, 3.35, 30 * 0.44704), (here, 3.0, 30 * 0.44704)):
        lanes = [lane for lane in world.lanes if lane.osm_way in (11, 13)]
        assert {lane.width_m for lane in lanes} == {Quantity(width_m, "default")}
        assert [lane.speed_limit_mps.value for lane in lanes] == pytest.approx([mps] * len(lanes))
        assert {lane.speed_limit_mps.source for lane in lanes} == {"default"}
        assert {c.width_m.source for c in world.connections} == {"default"}


def test_in_australia_the_right_goes_first_though_traffic_keeps_left() -> None:
    worlds = [world_of(crossing(origin=place)) for place in (SYDNEY, LEEDS)]
    assert {world.intersection.driving_side for world in worlds} == {"left"}
    sydney, leeds = (
        {(c.first_id, c.second_id): c for c in world.conflicts if c.rule.endswith("_side")}
        for world in worlds
    )
    assert {c.rule for c in sydney.values()} == {"far_side"}
    assert {c.rule for c in leeds.values()} == {"near_side"}
    assert len(leeds) == len(sydney) > 0
    assert all(sydney[pair].yields_id == c.goes_id for pair, c in leeds.items())


def test_a_sign_on_the_node_itself_stops_all_in_north_america_alone() -> None:
    control = {
        place: world_of(crossing(origin=place, node_tags={0: {"highway": "stop"}})).intersection
        for place in (AUSTIN, LEEDS)
    }
    assert control[AUSTIN].control == "all_way_stop"
    assert control[LEEDS].control == "stop"
    lesser = crossing(origin=AUSTIN, node_tags={0: {"highway": "stop", "stop": "minor"}})
    assert world_of(lesser).intersection.control == "stop"


def test_roads_on_both_sides_of_a_border_are_each_as_their_country_s() -> None:
    """The south of Avenue begins in the USA, 100 m from a crossing in Canada."""
    lon = -121.9
    south, north = 48.9, 49.1
    for _ in range(30):
        middle = (south + north) / 2
        south, north = (south, middle) if place_at(middle, lon).code == "CA" else (middle, north)
    world = world_of(crossing(origin=GeoPoint(north + 50.0 / 111_000.0, lon)))
    widths = {lane.osm_way: lane.width_m.value for lane in world.lanes}
    assert widths == {11: 3.0, 12: 3.0, 13: 3.0, 14: 3.05}
    speeds = {lane.osm_way: round(lane.speed_limit_mps.value * 3.6) for lane in world.lanes}
    assert speeds == {11: 50, 12: 50, 13: 50, 14: 40}
