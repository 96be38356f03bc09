"""Regulatory elements of Lanelet2 maps: lights, who waits for whom, stops and crosswalks."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import Crossing, WorldJunction
from foretwin.geometry.polyline import unit
from foretwin.world_gen.export.choices import Lanelet2Dialect
from foretwin.world_gen.export.lanelet2 import write_lanelet2
from tests.world_gen.drawn_maps import crossing, world_of
from tests.world_gen.export.drawn_world import ZEBRA, road, world
from tests.world_gen.export.lanelet2_file import Read, read, written
from tests.world_gen.export.signalled import signalled_crossing

WIDE, SIGNALLED = Quantity(4.0, "default"), Choice("traffic_signals", "tagged")


def test_lights_stand_at_height_and_name_their_stop_line(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    found = written(drawn, tmp_path)
    rules = found.rules("traffic_light")
    assert len(rules) == 4
    named = [
        ref
        for members, _ in found.relations.values()
        for _, ref, role in members
        if role == "regulatory_element"
    ]
    for rule, members, _ in rules:
        roles = {role: ref for _, ref, role in members}
        light, tags = found.ways[roles["refers"]]
        assert float(tags["height"]) == 0.9
        assert [float(found.nodes[n]["ele"]) for n in light] == [2.55, 2.55]
        bulbs = [found.nodes[n] for n in found.ways[roles["light_bulbs"]][0]]
        assert [b["color"] for b in bulbs] == ["red", "yellow", "green"]
        assert found.ways[roles["ref_line"]][1]["type"] == "stop_line"
        assert named.count(rule) == 4  # the lane before the line and its three movements


def who_names(found: Read, rule: int) -> set[str]:
    return {
        tags["foretwin:id"]
        for members, tags in found.relations.values()
        if ("relation", rule, "regulatory_element") in members
    }


def test_who_passes_beside_a_light_does_not_name_it(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    slip = next(c for c in drawn.connections if c.turn == "right")
    beside = msgspec.structs.replace(slip, signal_group_id=None, control="give_way")
    drawn = msgspec.structs.replace(
        drawn, connections=tuple(beside if c is slip else c for c in drawn.connections)
    )
    found = written(drawn, tmp_path)
    named = {name for rule, _, _ in found.rules("traffic_light") for name in who_names(found, rule)}
    lit = {c.id for c in drawn.connections} - {slip.id}
    lanes = {c.from_lane_id for c in drawn.connections} - {slip.from_lane_id}
    assert named == lit | lanes


def test_a_light_before_a_junction_s_own_has_its_line_and_lane(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    head, line = drawn.signals[0], drawn.stop_lines[0]
    assert head.lane_ids == (line.lane_id,)
    lane = next(lane for lane in drawn.lanes if lane.id == line.lane_id)
    back = 20.0 * unit(lane.centerline[0] - lane.centerline[-1])
    before = msgspec.structs.replace(
        head, id="before", group_id="before", position=head.position + np.array([*back, 0.0])
    )
    its_line = msgspec.structs.replace(line, id="line before", ends=line.ends + back)
    drawn = msgspec.structs.replace(
        drawn, signals=(*drawn.signals, before), stop_lines=(*drawn.stop_lines, its_line)
    )
    found = written(drawn, tmp_path)
    rules = {tags["foretwin:group"]: rule for rule, _, tags in found.rules("traffic_light")}
    assert who_names(found, rules["before"]) == {lane.id}
    for name, wanted in ((before.group_id, its_line), (head.group_id, line)):
        lines = [
            [[float(found.nodes[n][key]) for key in ("local_x", "local_y")] for n in nodes]
            for _, members, tags in found.rules("traffic_light")
            for nodes in (found.ways[ref][0] for _, ref, role in members if role == "ref_line")
            if tags["foretwin:group"] == name
        ]
        assert any(np.allclose(ends, wanted.ends, atol=0.001) for ends in lines), name


def test_a_light_lies_from_left_to_right_as_its_driver_sees_it(tmp_path: Path) -> None:
    head = Signal(
        id="s",
        osm_node=None,
        group_id="g",
        lane_ids=("a.f0",),
        position=np.array([50.0, -5.0, 3.0]),
        yaw_rad=math.pi,
        source="inferred",
    )
    drawn = world(road("a", [(0.0, 0.0), (49.0, 0.0)], ahead=[3.0]), signals=(head,))
    found = written(drawn, tmp_path)
    edge = next(nodes for nodes, tags in found.ways.values() if tags["type"] == "traffic_light")
    left, right = (float(found.nodes[n]["local_y"]) for n in edge)
    assert left > right  # who drives east has the north at the left hand


def test_who_waits_is_told_once_and_is_a_fallback_where_lights_part_the_two(
    tmp_path: Path,
) -> None:
    drawn = signalled_crossing()
    found = written(drawn, tmp_path)
    told: dict[tuple[int, int], bool] = {}
    for rule, members, tags in found.rules("right_of_way"):
        (loser,) = [ref for _, ref, role in members if role == "yield"]
        winners = [ref for _, ref, role in members if role == "right_of_way"]
        for ref in (loser, *winners):
            assert ("relation", rule, "regulatory_element") in found.relations[ref][0]
        for winner in winners:
            assert (loser, winner) not in told
            told[loser, winner] = tags.get("fallback") == "yes"
    group = {found.id_of(c.id): c.signal_group_id for c in drawn.connections}
    assert told == {
        (found.id_of(c.yields_id), found.id_of(c.second_id)): (
            group[found.id_of(c.first_id)] != group[found.id_of(c.second_id)]
        )
        for c in drawn.conflicts
    }


def test_an_all_way_stop_lists_a_line_for_each_lane(tmp_path: Path) -> None:
    drawn = world_of(crossing(node_tags={0: {"highway": "stop", "stop": "all"}}))
    junction = drawn.intersection
    assert junction.control == "all_way_stop"
    drawn = msgspec.structs.replace(
        drawn,
        connections=tuple(
            msgspec.structs.replace(c, junction_id=junction.id) for c in drawn.connections
        ),
        junctions=(WorldJunction(summary=junction, arms=(), area=None),),
    )
    found = written(drawn, tmp_path)
    ((rule, members, _),) = found.rules("all_way_stop")
    waiting = [ref for _, ref, role in members if role == "yield"]
    lines = [ref for _, ref, role in members if role == "ref_line"]
    assert len(waiting) == len(lines) == 4
    for lanelet in waiting:
        assert ("relation", rule, "regulatory_element") in found.relations[lanelet][0]
    assert not found.rules("right_of_way")


def test_a_crosswalk_is_a_lanelet_as_wide_as_it_is(tmp_path: Path) -> None:
    one = road("a", [(0.0, 0.0), (50.0, 0.0)], ahead=[3.0], against=[3.0])
    drawn = world(one, crossings=(ZEBRA,))
    found = written(drawn, tmp_path)
    members, tags = found.lanelet("x")
    assert tags["subtype"] == "crosswalk"
    assert tags["participant:pedestrian"] == "yes"
    assert tags["one_way"] == "no"
    xs = [{float(found.nodes[n]["local_x"]) for n in found.ways[ref][0]} for _, ref, _ in members]
    assert xs == [{18.0}, {22.0}]  # walking north, the left side lies in the west
    assert not found.rules("crosswalk")  # the Lanelet2 library knows none
    with_rules = written(drawn, tmp_path, dialect="autoware")
    ((rule, members, _),) = with_rules.rules("crosswalk")
    roles = Counter(role for _, _, role in members)
    assert roles == {"refers": 1, "crosswalk_polygon": 1}, "and no stop line 20 m before it"
    for lane in ("a.f0", "a.b0"):
        assert ("relation", rule, "regulatory_element") in with_rules.lanelet(lane)[0]


def test_every_crosswalk_has_a_rule_with_the_stop_lines_close_to_it(tmp_path: Path) -> None:
    """One crosswalk lies just behind the lights' lines, one ends before the lane's middle."""
    drawn = signalled_crossing()
    stop = next(line for line in drawn.stop_lines if line.control.value == "signal")
    lane = next(lane for lane in drawn.lanes if lane.id == stop.lane_id)
    ahead = unit(lane.centerline[-1] - lane.centerline[-2]) * 3.0
    short = np.array([stop.ends[1], stop.ends[1] + (stop.ends[0] - stop.ends[1]) / 4]) - 10 * ahead
    drawn = msgspec.structs.replace(
        drawn,
        crossings=(
            Crossing(id="at line", line=stop.ends + ahead, width_m=WIDE, kind=SIGNALLED),
            Crossing(id="short", line=short, width_m=WIDE, kind=SIGNALLED),
        ),
    )
    found = written(drawn, tmp_path, dialect="autoware")
    rules = {members[0][1]: (rule, members) for rule, members, _ in found.rules("crosswalk")}
    assert rules.keys() == {found.id_of("at line"), found.id_of("short")}
    lines = [ref for _, ref, role in rules[found.id_of("at line")][1] if role == "ref_line"]
    assert [found.ways[ref][1]["type"] for ref in lines] == ["stop_line"]
    rule, members = rules[found.id_of("short")]
    assert "ref_line" not in {role for _, _, role in members}
    assert ("relation", rule, "regulatory_element") in found.lanelet(lane.id)[0]


def test_a_map_by_autoware_s_name_is_in_its_dialect(tmp_path: Path) -> None:
    one = road("a", [(0.0, 0.0), (50.0, 0.0)], ahead=[3.0], against=[3.0])
    drawn = world(one, crossings=(ZEBRA,))
    cases: list[tuple[str, Lanelet2Dialect | None, int]] = [
        ("lanelet2_map.osm", None, 1),
        ("lanelet2_map.osm", "lanelet2", 0),
        ("map.osm", None, 0),
        ("map.osm", "autoware", 1),
    ]
    for name, dialect, rules in cases:
        write_lanelet2(drawn, tmp_path / name, dialect=dialect)
        assert len(read(tmp_path / name).rules("crosswalk")) == rules, (name, dialect)


def test_a_line_at_which_one_gives_way_is_no_stop_line_of_a_crosswalk(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    lines = tuple(
        msgspec.structs.replace(line, control=Choice("give_way", "tagged"))
        for line in drawn.stop_lines
    )
    crossings = tuple(
        Crossing(id=f"at {i}", line=line.ends, width_m=WIDE, kind=SIGNALLED)
        for i, line in enumerate(lines)
    )
    drawn = msgspec.structs.replace(drawn, stop_lines=lines, signals=(), crossings=crossings)
    rules = written(drawn, tmp_path, dialect="autoware").rules("crosswalk")
    assert len(rules) == len(lines) == 4
    assert not any(role == "ref_line" for _, members, _ in rules for _, _, role in members)
