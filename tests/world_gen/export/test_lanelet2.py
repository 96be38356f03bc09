"""Lanelet2 maps: what refers to what, what Autoware needs, and what the Lanelet2 library says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pyproj
import pytest
from lxml import etree

from contracts.world import (
    ATTRIBUTION,
    Choice,
    Crossing,
    Quantity,
    Signal,
    World,
    WorldJunction,
)
from tests.world_gen.drawn_maps import crossing, roundabout, world_of
from tests.world_gen.export.drawn_world import road, world
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.judges import ask_judge, judges_python
from tests.world_gen.export.signalled import signalled_crossing
from world_gen.export.lane_borders import Borders, lane_borders
from world_gen.export.lanelet2 import write_lanelet2
from world_gen.export.lanelet2_orientation import oriented, read_as_drawn


class Read(NamedTuple):
    """A written map: its primitives by id, tags as dicts."""

    nodes: dict[int, dict[str, str]]
    ways: dict[int, tuple[list[int], dict[str, str]]]
    relations: dict[int, tuple[list[tuple[str, int, str]], dict[str, str]]]
    root: Any

    def lanelet(self, name: str) -> tuple[list[tuple[str, int, str]], dict[str, str]]:
        return next(r for r in self.relations.values() if r[1].get("foretwin:id") == name)

    def id_of(self, name: str) -> int:
        return next(i for i, r in self.relations.items() if r[1].get("foretwin:id") == name)

    def rules(self, subtype: str) -> list[tuple[int, list[tuple[str, int, str]], dict[str, str]]]:
        return [
            (i, members, tags)
            for i, (members, tags) in self.relations.items()
            if tags["type"] == "regulatory_element" and tags["subtype"] == subtype
        ]

    def border(self, name: str, side: str) -> dict[str, str]:
        members, _ = self.lanelet(name)
        return self.ways[next(ref for _, ref, role in members if role == side)][1]


def read(path: Path) -> Read:
    root = etree.parse(str(path)).getroot()
    tags = lambda e: {t.get("k"): t.get("v") for t in e.iterfind("tag")}  # noqa: E731
    return Read(
        {int(e.get("id")): dict(e.attrib) | tags(e) for e in root.iterfind("node")},
        {
            int(e.get("id")): ([int(n.get("ref")) for n in e.iterfind("nd")], tags(e))
            for e in root.iterfind("way")
        },
        {
            int(e.get("id")): (
                [(m.get("type"), int(m.get("ref")), m.get("role")) for m in e.iterfind("member")],
                tags(e),
            )
            for e in root.iterfind("relation")
        },
        root,
    )


def written(drawn: World, folder: Path, **options: Any) -> Read:
    path = folder / "map.osm"
    write_lanelet2(drawn, path, **options)
    return read(path)


def assert_closed(found: Read) -> None:
    ids = [*found.nodes, *found.ways, *found.relations]
    assert len(ids) == len(set(ids))
    for nodes, _ in found.ways.values():
        assert nodes
        assert set(nodes) <= set(found.nodes)
    for members, _ in found.relations.values():
        for kind, ref, _ in members:
            assert ref in (found.ways if kind == "way" else found.relations)


@pytest.mark.parametrize("drawn", [signalled_crossing(), world_of(roundabout())], ids=["x", "o"])
def test_ids_are_unique_and_references_closed(drawn: World, tmp_path: Path) -> None:
    found = written(drawn, tmp_path, crosswalk_rules=True)
    assert_closed(found)
    lanelets = [tags for _, tags in found.relations.values() if tags["type"] == "lanelet"]
    roads = [tags for tags in lanelets if tags["subtype"] != "crosswalk"]
    assert len(roads) == len(drawn.lanes) + len(drawn.connections)
    assert all(tags["one_way"] == "yes" and int(tags["speed_limit"]) > 0 for tags in roads)


def test_the_attribution_stands_in_both_files(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    projector = write_lanelet2(drawn, tmp_path / "a.osm")
    assert projector.name == "a.map_projector_info.yaml"
    assert ATTRIBUTION in projector.read_text(encoding="utf-8")
    assert read(tmp_path / "a.osm").root.get("attribution") == ATTRIBUTION
    beside = write_lanelet2(drawn, tmp_path / "lanelet2_map.osm")
    assert beside.name == "map_projector_info.yaml"


def test_the_projector_file_gives_back_the_local_coordinates(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    projector = write_lanelet2(drawn, tmp_path / "map.osm").read_text(encoding="utf-8")
    values = dict(line.strip().split(": ") for line in projector.splitlines() if ": " in line)
    assert values["projector_type"] == "TransverseMercator"
    assert values["vertical_datum"] == "WGS84"
    projection = pyproj.Proj(
        proj="tmerc", lat_0=float(values["latitude"]), lon_0=float(values["longitude"]),
        k_0=float(values["scale_factor"]), ellps="WGS84",
    )  # fmt: skip
    for node in read(tmp_path / "map.osm").nodes.values():
        x, y = projection(float(node["lon"]), float(node["lat"]))
        assert x == pytest.approx(float(node["local_x"]), abs=0.001)
        assert y == pytest.approx(float(node["local_y"]), abs=0.001)
        assert math.isfinite(float(node["ele"]))


def test_a_name_that_xml_cannot_hold_loses_what_is_wrong_with_it(tmp_path: Path) -> None:
    one, lanes = road("a", [(0.0, 0.0), (50.0, 0.0)], ahead=[3.0])
    lanes = [msgspec.structs.replace(lanes[0], name="Bell\x07 <Street> & \x00Co")]
    assert written(world((one, lanes)), tmp_path).lanelet("a.f0")[1]["road_name"] == (
        "Bell <Street> & Co"
    )


def test_lanes_share_ways_side_by_side_and_nodes_one_after_another(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    found = written(drawn, tmp_path)

    def way(name: str, role: str) -> int:
        return next(ref for _, ref, r in found.lanelet(name)[0] if r == role)

    for one in drawn.roads:
        left, right = one.lane_ids  # one lane each way
        assert way(left, "left") == way(right, "left")
    for c in drawn.connections:
        for role in ("left", "right"):
            here, via, there = (
                found.ways[way(name, role)][0] for name in (c.from_lane_id, c.id, c.to_lane_id)
            )
            # Connections of both directions may have one way in common: it runs either way.
            assert len({here[0], here[-1]} & {via[0], via[-1]}) == 1
            assert len({via[0], via[-1]} & {there[0], there[-1]}) == 1


def test_turns_are_named_inside_junctions_alone(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    turned = msgspec.structs.replace(drawn.connections[0], turn="u_turn")
    drawn = msgspec.structs.replace(drawn, connections=(turned, *drawn.connections[1:]))
    found = written(drawn, tmp_path)
    assert found.lanelet(turned.id)[1]["turn_direction"] == "left"
    for c in drawn.connections[1:]:
        assert found.lanelet(c.id)[1]["turn_direction"] == c.turn
    for lane in drawn.lanes:
        assert "turn_direction" not in found.lanelet(lane.id)[1]


def test_lights_stand_at_height_and_name_their_stop_line(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    found = written(drawn, tmp_path)
    rules = found.rules("traffic_light")
    assert len(rules) == 4
    named = [ref for members, _ in found.relations.values() for _, ref, role in members
             if role == "regulatory_element"]  # fmt: skip
    for rule, members, _ in rules:
        roles = {role: ref for _, ref, role in members}
        light, tags = found.ways[roles["refers"]]
        assert float(tags["height"]) == 0.9
        assert [float(found.nodes[n]["ele"]) for n in light] == [2.55, 2.55]
        bulbs = [found.nodes[n] for n in found.ways[roles["light_bulbs"]][0]]
        assert [b["color"] for b in bulbs] == ["red", "yellow", "green"]
        assert found.ways[roles["ref_line"]][1]["type"] == "stop_line"
        assert named.count(rule) == 4  # the lane before the line and its three movements


def test_a_light_lies_from_left_to_right_as_its_driver_sees_it(tmp_path: Path) -> None:
    head = Signal(
        id="s", osm_node=None, group_id="g", lane_ids=("a.f0",),
        position=np.array([50.0, -5.0, 3.0]), yaw_rad=math.pi, source="inferred",
    )  # fmt: skip
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


@pytest.mark.parametrize(
    ("left", "right", "subtype"),
    [
        ("both", "both", "dashed"),
        ("right", "none", "dashed_solid"),
        ("none", "left", "solid_dashed"),
        ("left", "right", "solid"),
    ],
)
def test_lines_between_lanes_say_who_may_cross(
    left: Any, right: Any, subtype: str, tmp_path: Path
) -> None:
    one, lanes = road("a", [(0.0, 0.0), (50.0, 0.0)], ahead=[3.0, 3.0])
    lanes = [
        msgspec.structs.replace(lane, change=change)
        for lane, change in zip(lanes, (left, right), strict=True)
    ]
    found = written(world((one, lanes)), tmp_path)
    assert found.border("a.f0", "right")["subtype"] == subtype
    assert found.border("a.f1", "left")["subtype"] == subtype
    assert found.border("a.f1", "right") == {"type": "curbstone", "subtype": "high"}


def test_a_crosswalk_is_a_lanelet_as_wide_as_it_is(tmp_path: Path) -> None:
    zebra = Crossing(
        id="x", line=np.array([[20.0, -3.0], [20.0, 3.0]]), width_m=Quantity(4.0, "default"),
        kind=Choice("zebra", "tagged"),
    )  # fmt: skip
    one = road("a", [(0.0, 0.0), (50.0, 0.0)], ahead=[3.0], against=[3.0])
    drawn = world(one, crossings=(zebra,))
    found = written(drawn, tmp_path)
    members, tags = found.lanelet("x")
    assert tags["subtype"] == "crosswalk"
    assert tags["participant:pedestrian"] == "yes"
    assert tags["one_way"] == "no"
    xs = [{float(found.nodes[n]["local_x"]) for n in found.ways[ref][0]} for _, ref, _ in members]
    assert xs == [{18.0}, {22.0}]  # walking north, the left side lies in the west
    assert not found.rules("crosswalk")  # the Lanelet2 library knows none
    with_rules = written(drawn, tmp_path, crosswalk_rules=True)
    ((rule, _, _),) = with_rules.rules("crosswalk")
    for lane in ("a.f0", "a.b0"):
        assert ("relation", rule, "regulatory_element") in with_rules.lanelet(lane)[0]


def test_roads_over_each_other_part_by_height_and_meet_at_their_ends(tmp_path: Path) -> None:
    first, lanes = road("ramp", [(-50.0, 0.0), (-10.0, 0.0)], ahead=[3.0])
    over = road("over", [(-10.0, 0.0), (10.0, 0.0)], ahead=[3.0], layer=1)
    under = road("under", [(0.0, -50.0), (0.0, 50.0)], ahead=[3.0])
    ramp = [msgspec.structs.replace(lanes[0], successor_ids=("over.f0",))]
    found = written(world((first, ramp), over, under), tmp_path)

    def heights(name: str) -> set[float]:
        return {
            float(found.nodes[n]["ele"])
            for kind, ref, _ in found.lanelet(name)[0]
            if kind == "way"
            for n in found.ways[ref][0]
        }

    assert heights("over.f0") == {5.0}
    assert heights("under.f0") == {0.0}
    assert heights("ramp.f0") == {0.0, 5.0}


HAIRPIN = Borders(
    np.array([[21.768, -4.729], [21.6, -4.7], [21.55, -4.2], [21.609, -4.129]]),
    np.array([[21.965, -1.235], [18.9, -1.4], [17.0, -4.0], [18.5, -7.6], [20.952, -7.567]]),
)
FOLD = Borders(
    np.array([[-7.136, 14.251], [-6.9, 12.0], [-6.4, 10.2], [-5.975, 8.99]]),
    np.array([[-10.358, 13.827], [-9.6, 13.5], [-9.0, 13.1], [-8.387, 12.79]]),
)


TURNED_ON_THE_SPOT = Borders(
    np.array([[123.482, 20.505], [124.282, 17.272]]),
    np.array([[124.601, 17.189], [123.725, 20.727]]),
)


@pytest.mark.parametrize(
    "borders", [HAIRPIN, FOLD, TURNED_ON_THE_SPOT], ids=["hairpin", "fold", "on the spot"]
)
def test_borders_are_drawn_so_that_lanelet2_keeps_their_direction(borders: Borders) -> None:
    assert not read_as_drawn(borders)
    better = oriented(borders)
    assert read_as_drawn(better)
    for before, after in zip(borders, better, strict=True):
        assert np.array_equal(before[[0, -1]], after[[0, -1]])


def routes_asked(drawn: World, path: Path) -> dict[str, Any]:
    borders = lane_borders(drawn)
    lanes = {lane.id for lane in drawn.lanes}
    return {
        "path": str(path),
        "lat": drawn.frame.origin.lat_deg,
        "lon": drawn.frame.origin.lon_deg,
        "connections": [[c.id, c.from_lane_id, c.to_lane_id] for c in drawn.connections],
        "successions": [[a.id, b] for a in drawn.lanes for b in a.successor_ids if b in lanes],
        "positions": [[lane.id, *borders[lane.id].left[0].tolist()] for lane in drawn.lanes],
    }


def assert_accepted(tasks: list[dict[str, Any]], worlds: list[World]) -> None:
    verdicts = ask_judge("load_lanelet2.py", tasks)
    for task, drawn in zip(tasks, worlds, strict=True):
        verdict = verdicts[task["path"]]
        assert verdict["errors"] == []
        assert verdict["missing_routes"] == []
        assert verdict["stray_routes"] == []
        assert verdict["graph_faults"] == []
        assert verdict["off_m"] < 0.01
        roads = sum(n for kind, n in verdict["lanelets"].items() if kind != "crosswalk")
        assert roads == len(drawn.lanes) + len(drawn.connections)
        assert verdict["lanelets"].get("crosswalk", 0) == len(drawn.crossings)
        for lane in drawn.lanes:
            if lane.kind == "driving":
                kmh = round(lane.speed_limit_mps.value * 3.6)
                assert verdict["speeds"][lane.id] == pytest.approx(kmh, abs=0.01)


@pytest.mark.judge
def test_lanelet2_loads_drawn_worlds(tmp_path: Path) -> None:
    judges_python()
    worlds = [signalled_crossing(), world_of(roundabout())]
    tasks = []
    for i, drawn in enumerate(worlds):
        path = tmp_path / f"{i}.osm"
        write_lanelet2(drawn, path)
        tasks.append(routes_asked(drawn, path))
    assert_accepted(tasks, worlds)


@pytest.mark.judge
@pytest.mark.real_data
def test_lanelet2_loads_the_sampled_worlds_with_every_route(data_dir: Path, tmp_path: Path) -> None:
    judges_python()
    tasks, worlds = [], []
    for sampled in sample_worlds(data_dir):
        path = tmp_path / f"{sampled.name}.osm"
        write_lanelet2(sampled.world, path)
        tasks.append(routes_asked(sampled.world, path))
        worlds.append(sampled.world)
    assert len(worlds) == 60
    assert_accepted(tasks, worlds)
