"""Who waits by sign, by tag and by class, at drawn junctions."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.world import World
from foretwin.world_gen.osm.osm_map import NodeLocations, OsmMap
from tests.world_gen.connections.test_conflicts import conflict_of
from tests.world_gen.drawn_maps import (
    AVENUE,
    CROSS,
    STREET,
    crossing,
    drawn_map,
    roundabout,
    world_of,
)
from tests.world_gen.junction_truth import worlds_of
from tests.world_gen.truth_sheet import true_maps

COVERS = (
    "foretwin.world_gen.rules.approaches",
    "foretwin.world_gen.rules.right_of_way",
)

MAIN = {"highway": "tertiary", "name": "Street"}


def waits(world: World, first: str, second: str) -> tuple[str, str, str]:
    """Return the movement that waits, the rule and its source."""
    name = {lane.id: lane.name for lane in world.lanes}
    movement = {c.id: f"{name[c.from_lane_id]}>{name[c.to_lane_id]}" for c in world.connections}
    found = conflict_of(world, first, second)
    assert found is not None, (first, second, sorted(movement.values()))
    return movement[found.yields_id], found.rule, found.source


def sides(**by_letter: dict[str, str]) -> list[tuple[int, list[int], dict[str, str]]]:
    """Return ways from the middle, named by the compass, with tags."""
    ends = {"E": 1, "N": 2, "W": 3, "S": 4}
    return [
        (10 + ends[letter], [ends[letter], 0], {"name": letter, "highway": "residential", **tags})
        for letter, tags in by_letter.items()
    ]


def test_right_before_left_where_nothing_is_said():
    world = world_of(drawn_map(CROSS, sides(E={}, N={}, W={}, S={})))
    assert waits(world, "W>E", "S>N") == ("W>E", "near_side", "default")
    assert waits(world, "W>N", "E>W") == ("W>N", "turn_across", "inferred")


def test_a_tagged_priority_road_goes_first():
    priority = {"priority_road": "designated"}
    world = world_of(drawn_map(CROSS, sides(E=priority, W=priority, N={}, S={})))
    assert waits(world, "W>E", "S>N") == ("S>N", "priority_road", "tagged")
    assert waits(world, "W>N", "S>N")[0] == "S>N"


def test_its_end_does_not():
    begins, ends = {"priority_road": "designated"}, {"priority_road": "end"}
    world = world_of(drawn_map(CROSS, sides(E=begins, W=begins, N=ends, S=ends)))
    assert waits(world, "N>S", "W>E") == ("N>S", "priority_road", "tagged")


@pytest.mark.parametrize("word", ["give_way", "stop"])
def test_a_sign_stands_on_both_sides_of_the_road_that_is_crossed(word):
    nodes = CROSS | {5: (0.0, -9.0)}
    ways = sides(E={}, N={}, W={})
    ways.append((14, [4, 5, 0], {"highway": "residential", "name": "S"}))
    osm = drawn_map(nodes, ways, node_tags={5: {"highway": word, "direction": "forward"}})
    world = world_of(osm)
    assert waits(world, "S>N", "W>E") == ("S>N", word, "tagged")
    assert waits(world, "N>S", "W>E") == ("N>S", word, "inferred")
    assert waits(world, "S>N", "N>E") == ("N>E", "turn_across", "inferred")
    control = {line.lane_id: line.control for line in world.stop_lines}
    name = {lane.id: lane.name for lane in world.lanes}
    told = {name[lane]: (c.value, c.source) for lane, c in control.items()}
    assert told["S"] == (word, "tagged")
    assert told["N"] == (word, "inferred")
    assert told["W"][0] == "none"
    line = next(line for line in world.stop_lines if name[line.lane_id] == "S")
    assert line.ends.mean(axis=0)[1] == pytest.approx(-9.0, abs=0.2)


def test_a_sign_that_faces_the_other_way_is_for_others():
    nodes = CROSS | {5: (0.0, -9.0)}
    ways = sides(E={}, N={}, W={})
    ways.append((14, [4, 5, 0], {"highway": "residential", "name": "S"}))
    osm = drawn_map(nodes, ways, node_tags={5: {"highway": "give_way", "direction": "backward"}})
    assert waits(world_of(osm), "W>E", "S>N") == ("W>E", "near_side", "default")


def test_a_german_sign_counts_by_its_number():
    nodes = CROSS | {5: (0.0, -9.0)}
    ways = sides(E={}, N={}, W={})
    ways.append((14, [4, 5, 0], {"highway": "residential", "name": "S"}))
    osm = drawn_map(nodes, ways, node_tags={5: {"traffic_sign": "DE:205", "direction": "forward"}})
    assert waits(world_of(osm), "W>E", "S>N") == ("S>N", "give_way", "tagged")


def test_the_lesser_road_waits_unless_all_lie_in_a_thirty_zone():
    tertiary = {"highway": "tertiary"}
    world = world_of(drawn_map(CROSS, sides(E=tertiary, W=tertiary, N={}, S={})))
    assert waits(world, "W>E", "S>N") == ("S>N", "lesser_road", "inferred")
    zone = {"maxspeed": "30", "source:maxspeed": "DE:zone:30"}
    calm = world_of(drawn_map(CROSS, sides(E=tertiary | zone, W=tertiary | zone, N=zone, S=zone)))
    assert waits(calm, "W>E", "S>N") == ("W>E", "near_side", "default")


def test_who_leaves_a_living_street_waits_for_all():
    world = world_of(drawn_map(CROSS, sides(E={}, W={}, N={}, S={"highway": "living_street"})))
    assert waits(world, "W>E", "S>N") == ("S>N", "lesser_road", "inferred")
    assert waits(world, "S>N", "N>E") == ("S>N", "lesser_road", "inferred")


def test_roads_of_one_name_go_on_round_the_bend_of_a_t():
    nodes = {0: (0.0, 0.0), 1: (90.0, 0.0), 3: (-90.0, 0.0), 4: (0.0, -90.0)}
    ways = [
        (11, [1, 0], MAIN | {"name": "Side"}),
        (13, [3, 0], MAIN),
        (14, [4, 0], MAIN),
    ]
    world = world_of(drawn_map(nodes, ways))
    assert waits(world, "Side>Street", "Street>Side") == ("Side>Street", "lesser_road", "inferred")


def test_the_numbered_road_goes_on_through_a_crossing_of_equals():
    numbered = {"highway": "secondary", "ref": "L 3159"}
    plain = {"highway": "secondary"}
    world = world_of(drawn_map(CROSS, sides(E=numbered, W=numbered, N=plain, S=plain)))
    assert waits(world, "S>N", "W>E") == ("S>N", "lesser_road", "inferred")


@pytest.mark.parametrize("highway", ["secondary", "tertiary"])
def test_the_stem_of_a_t_of_classified_roads_waits(highway):
    tags = {"highway": highway}
    world = world_of(drawn_map(CROSS, sides(E=tags, W=tags, S=tags)))
    assert waits(world, "S>E", "W>E")[0] == ("S>E" if highway == "secondary" else "W>E")
    assert waits(world, "S>W", "E>W")[0] == "S>W"  # by its rank, or because E comes from the right


def test_a_one_way_road_goes_on_past_the_stem_of_a_t():
    main = {"highway": "secondary", "oneway": "yes"}
    out = {"highway": "secondary", "oneway": "-1"}
    world = world_of(drawn_map(CROSS, sides(W=main, E=out, S={"highway": "secondary"})))
    assert waits(world, "S>E", "W>E") == ("S>E", "lesser_road", "inferred")


def test_a_crossing_with_a_road_that_leads_out_alone_has_no_stem():
    classified = {"highway": "secondary"}
    one_way = {"S": classified | {"oneway": "yes"}, "N": classified | {"oneway": "-1"}}
    world = world_of(drawn_map(CROSS, sides(E=classified, W=classified, **one_way)))
    assert waits(world, "W>E", "S>N") == ("W>E", "near_side", "default")


@pytest.mark.parametrize(
    ("highway", "rule"), [("motorway", "merge_order"), ("tertiary", "near_side")]
)
def test_where_motorways_merge_the_straighter_one_goes_first(highway, rule):
    one_way = {"highway": highway, "oneway": "yes"}
    nodes = {0: (0.0, 0.0), 1: (90.0, 0.0), 3: (-90.0, 0.0), 4: (-80.0, -40.0)}
    ways = [
        (11, [0, 1], one_way | {"name": "E"}),
        (13, [3, 0], one_way | {"name": "W"}),
        (14, [4, 0], one_way | {"name": "S"}),
    ]
    told = waits(world_of(drawn_map(nodes, ways)), "W>E", "S>E")
    assert told[:2] == (("S>E" if highway == "motorway" else "W>E"), rule)


def test_a_stop_sign_on_the_very_node_is_for_the_lesser_road():
    world = world_of(crossing(street=MAIN, node_tags={0: {"highway": "stop", "stop": "minor"}}))
    assert waits(world, "Avenue>Avenue", "Street>Street") == ("Avenue>Avenue", "stop", "inferred")


def test_a_sign_on_a_node_of_a_dual_carriageway_is_not_for_those_who_drive_through():
    nodes = {
        0: (0.0, 0.0),
        6: (0.0, 14.0),
        1: (90.0, 0.0),
        3: (-90.0, 0.0),
        4: (0.0, -90.0),
        2: (0.0, 104.0),
        7: (90.0, 14.0),
        8: (-90.0, 14.0),
    }
    one_way = {**MAIN, "oneway": "yes"}
    ways = [
        (11, [3, 0, 1], one_way),
        (12, [7, 6, 8], one_way),
        (13, [4, 0], AVENUE),
        (14, [0, 6], AVENUE),
        (15, [6, 2], AVENUE),
    ]
    world = world_of(drawn_map(nodes, ways, node_tags={0: {"highway": "stop"}}))
    minor = {lane.id for lane in world.lanes if lane.name == "Avenue"}
    by_id = {c.id: c for c in world.connections}
    crossed = [c for c in world.conflicts if c.rule == "stop"]
    assert crossed
    assert all(by_id[c.yields_id].from_lane_id in minor for c in crossed)


def test_at_an_all_way_stop_the_right_goes_first():
    world = world_of(crossing(node_tags={0: {"highway": "stop", "stop": "all"}}))
    assert {line.control.value for line in world.stop_lines} == {"stop"}
    assert {c.rule for c in world.conflicts} == {"near_side", "turn_across"}


def test_signs_count_only_where_the_lights_are_out():
    """Under lights who turns left waits for oncoming traffic of a lesser road too."""
    osm = crossing(
        street={"highway": "tertiary", "name": "Street"},
        node_tags={0: {"highway": "traffic_signals"}},
    )
    world = world_of(osm)
    turning = {c.id for c in world.connections if c.turn == "left"}
    across = [c for c in world.conflicts if c.rule == "turn_across"]
    assert len(across) >= 4
    assert all(c.yields_id in turning for c in across)
    assert waits(world, "Avenue>Avenue", "Street>Street")[1:] == ("lesser_road", "inferred")


def test_lanes_that_merge_let_the_straight_one_go_first():
    ways = [
        (11, [3, 0], {**STREET, "oneway": "yes", "lanes": "2", "turn:lanes": "through|through"}),
        (12, [0, 1], {**STREET, "oneway": "yes", "lanes": "1"}),
        (13, [0, 2], {**AVENUE, "oneway": "yes"}),
    ]
    world = world_of(drawn_map(CROSS, ways))
    (merging,) = [c for c in world.conflicts if c.kind == "merging"]
    assert merging.rule == "merge_order"


def test_a_circular_place_with_signs_at_its_entries_is_driven_like_a_roundabout():
    osm = roundabout()
    ring = osm.ways[10]
    node = local_to_geo(osm, 25.0, 0.0)
    before = osm.locations
    at = np.searchsorted(before.ids, 9)
    osm = msgspec.structs.replace(
        osm,
        locations=NodeLocations(
            np.insert(before.ids, at, 9), np.insert(before.lat_lon_deg, at, node, axis=0)
        ),
        ways={
            **osm.ways,
            10: ring._replace(tags={**ring.tags, "junction": "circular", "oneway": "yes"}),
            11: osm.ways[11]._replace(nodes=(100, 9, 1)),
        },
        node_tags={9: {"highway": "give_way", "direction": "backward"}},
    )
    world = world_of(osm)
    role = {lane.id: lane.role for lane in world.lanes}
    by_id = {c.id: c for c in world.connections}
    answers = {(role[by_id[c.yields_id].from_lane_id], c.rule, c.source) for c in world.conflicts}
    assert answers == {("approach", "roundabout", "tagged"), ("approach", "roundabout", "inferred")}


def test_a_slip_road_with_its_own_sign_is_not_under_the_lights():
    (world,) = worlds_of(next(t for t in true_maps() if t.name == "10_slip_lane_gives_way"))
    slip = [c for c in world.connections if c.control == "give_way"]
    assert len(slip) == 1
    assert slip[0].turn == "right"
    assert slip[0].signal_group_id is None
    others = [
        c for c in world.connections if c.from_lane_id == slip[0].from_lane_id and c not in slip
    ]
    assert others
    assert all(c.control == "signal" and c.signal_group_id for c in others)
    waiting = [c for c in world.conflicts if c.yields_id == slip[0].id]
    assert {(c.rule, c.source) for c in waiting} == {("give_way", "tagged")}


def local_to_geo(osm: OsmMap, x_m: float, y_m: float) -> tuple[float, float]:
    lat, lon = geo_from_local(osm.frame, np.array([x_m, y_m])).tolist()
    return lat, lon
