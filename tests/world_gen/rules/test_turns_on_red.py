"""Which turns may go on red after a stop: by country, lights' tags, and signs as relations."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import GERMANY, crossing, world_of

COLORADO, NEW_SOUTH_WALES = GeoPoint(40.0, -105.2), GeoPoint(-33.8, 151.0)
LIGHT = {"highway": "traffic_signals"}


def turns_on_red(world: World) -> set[tuple[int, int]]:
    """Return the ways from and to which a driver may turn on red."""
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    found = [c for c in world.connections if c.red_after_stop is True]
    assert {c.turn for c in found} <= {world.intersection.driving_side}
    return {(way_of[c.from_lane_id], way_of[c.to_lane_id]) for c in found}


def lit(origin: GeoPoint, tags: Mapping[str, str] | None = None) -> World:
    return world_of(crossing(origin=origin, node_tags={0: {**LIGHT, **(tags or {})}}))


def test_right_turns_go_on_red_in_the_usa_and_not_in_germany() -> None:
    assert turns_on_red(lit(COLORADO)) == {(11, 12), (12, 13), (13, 14), (14, 11)}
    assert turns_on_red(lit(GERMANY)) == set()
    assert turns_on_red(world_of(crossing(origin=COLORADO))) == set()


@pytest.mark.parametrize("key", ["red_turn:right", "red_turn"])
def test_the_light_itself_can_say_otherwise(key: str) -> None:
    assert turns_on_red(lit(COLORADO, {key: "no"})) == set()
    assert len(turns_on_red(lit(GERMANY, {key: "yes"}))) == 4


def test_who_keeps_left_turns_left_on_red() -> None:
    assert len(turns_on_red(lit(NEW_SOUTH_WALES, {"red_turn:left": "yes"}))) == 4
    assert turns_on_red(lit(NEW_SOUTH_WALES, {"red_turn:right": "yes"})) == set()


def test_a_sign_forbids_the_turn_on_red_alone_and_not_the_turn() -> None:
    members = [("w", 13, "from"), ("n", 0, "via"), ("w", 14, "to")]
    tags = {"type": "restriction", "restriction": "no_right_turn_on_red"}
    world = world_of(
        crossing(origin=COLORADO, node_tags={0: LIGHT}, relations=[(1, members, tags)])
    )
    assert turns_on_red(world) == {(11, 12), (12, 13), (14, 11)}
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    assert (13, 14) in {(way_of[c.from_lane_id], way_of[c.to_lane_id]) for c in world.connections}
