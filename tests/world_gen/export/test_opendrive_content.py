"""What OpenDRIVE files say beside roads: lights, signs, objects, heights, frame, makers."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pyproj
import pytest

from foretwin.contracts.beside_road import Building
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import ATTRIBUTION, Area
from foretwin.world_gen.export.opendrive import proj_of, write_opendrive
from tests.world_gen.drawn_maps import (
    AVENUE,
    CROSS,
    IRELAND,
    STREET,
    crossing,
    drawn_map,
    world_of,
)
from tests.world_gen.export import drawn_world
from tests.world_gen.export.test_opendrive import check_closed, plain, written

COVERS = (
    "foretwin.world_gen.export.opendrive_objects",
    "foretwin.world_gen.export.opendrive_sidewalks",
    "foretwin.world_gen.export.opendrive_signals",
)


def test_who_waits_is_written_for_every_conflict(tmp_path: Path) -> None:
    world = plain()
    file = written(world, tmp_path)
    made = {r.source: r.id for r in file.roads.values()}
    said = {(p.get("high"), p.get("low")) for p in file.root.iterfind("junction/priority")}
    wanted = set()
    for c in world.conflicts:
        goes = c.second_id if c.yields_id == c.first_id else c.first_id
        wanted.add((made[goes], made[c.yields_id]))
    assert wanted
    assert said == wanted


@pytest.mark.parametrize("origin", [None, IRELAND])
def test_lights_stand_on_their_lanes_and_have_controllers(tmp_path: Path, origin) -> None:
    more = {} if origin is None else {"origin": origin}
    world = world_of(crossing(node_tags={0: {"highway": "traffic_signals"}}, **more))
    file = written(world, tmp_path)
    lanes = {lane.id: lane for lane in world.lanes}
    by_name = {s.get("name"): s for s in file.root.iter("signal")}
    assert len(world.signals) == len(by_name) == 4
    for signal in world.signals:
        item = by_name[signal.id]
        road = file.roads[item.getparent().getparent().get("id")]
        assert (item.get("type"), item.get("country")) == ("1000001", "OpenDRIVE")
        assert item.get("dynamic") == "yes"
        forward = not lanes[signal.lane_ids[0]].reverse
        assert item.get("orientation") == ("+" if forward else "-")
        valid = item.find("validity")
        assert int(valid.get("fromLane")) <= int(valid.get("toLane"))
        assert {int(valid.get("fromLane")), int(valid.get("toLane"))} <= set(road.lanes)
        s, t = float(item.get("s")), float(item.get("t"))
        assert math.dist(road.beside(s, t), signal.position[:2]) < 2e-3
        usual = road.at(s).heading_rad + (math.pi if forward else 0.0)
        faces = usual + float(item.get("hOffset"))
        assert abs(math.remainder(faces - signal.yaw_rad, math.tau)) < 1e-3
    controllers = {c.get("id"): c for c in file.root.findall("controller")}
    assert {c.get("name") for c in controllers.values()} == {s.group_id for s in world.signals}
    controlled = [i.get("signalId") for c in controllers.values() for i in c]
    assert sorted(controlled) == sorted(s.get("id") for s in by_name.values())
    (junction,) = file.root.findall("junction")
    assert {c.get("id") for c in junction.findall("controller")} == set(controllers)


def test_a_stop_sign_stands_by_the_kerb_and_looks_at_its_driver(tmp_path: Path) -> None:
    osm = drawn_map(
        {**CROSS, 5: (-15.0, 0.0)},
        [(11, [0, 1], STREET), (12, [0, 2], AVENUE), (13, [3, 5, 0], STREET), (14, [4, 0], AVENUE)],
        node_tags={5: {"highway": "stop", "direction": "forward"}},
    )
    world = world_of(osm)
    file = written(world, tmp_path)
    signs = [s for s in file.root.iter("signal") if s.get("type") == "206"]
    assert len(signs) == sum(line.control.value == "stop" for line in world.stop_lines) > 0
    places = []
    for sign in signs:
        assert (sign.get("country"), sign.get("dynamic")) == ("DE", "no")
        assert sign.find("semantics/priority").get("type") == "stop"
        assert abs(float(sign.get("hOffset"))) < 1e-3
        road = file.roads[sign.getparent().getparent().get("id")]
        places.append(road.beside(float(sign.get("s")), float(sign.get("t"))).tolist())
    paint = [o for o in file.root.iter("object") if o.get("type") == "roadMark"]
    assert {(o.get("zOffset"), o.get("height")) for o in paint} == {("0", "0")}
    west = min(places)
    # Where the map has it, and 0.6 m right of a lane that leads east and is 3 m wide.
    assert west == pytest.approx([-15.0, -3.6], abs=0.01)


def test_outlines_stand_where_the_world_has_them(tmp_path: Path) -> None:
    corner = np.array([[20.0, 20.0], [45.0, 22.0], [44.0, 40.0], [21.0, 38.0]])
    court = np.array([[28.0, 26.0], [28.0, 32.0], [35.0, 32.0], [35.0, 26.0]])
    house = Building(
        id="house",
        outline=corner,
        holes=(court,),
        height_m=Quantity(9.0, "tagged"),
        min_height_m=3.0,
    )
    island = Area(id="refuge", outline=np.array([[-30.0, -1.0], [-25.0, -1.0], [-25.0, 1.0]]))
    world = msgspec.structs.replace(plain(), buildings=(house,), islands=(island,))
    file = written(world, tmp_path)
    things = {o.get("name"): o for o in file.root.iter("object")}
    for name, kind, outlines in (
        ("house", "building", [corner, court]),
        ("refuge", "trafficIsland", [island.outline]),
    ):
        item = things[name]
        assert item.get("type") == kind
        road = file.roads[item.getparent().getparent().get("id")]
        for got, wanted in zip(road.placed(item), outlines, strict=True):
            assert np.allclose(got, wanted, atol=1e-3)
    assert float(things["house"].get("zOffset")) == 3.0
    assert {c.get("height") for c in things["house"].iter("cornerLocal")} == {"6"}
    assert [o.get("outer") for o in things["house"].iter("outline")] == ["true", "false"]


def test_a_bridge_rises_over_what_it_crosses(tmp_path: Path) -> None:
    over = {**STREET, "bridge": "yes", "layer": "1"}
    world = world_of(
        crossing(
            extra_nodes={5: (60.0, 80.0), 6: (60.0, -80.0), 7: (85.0, 0.0), 8: (35.0, 0.0)},
            extra_ways=[(21, [6, 5], {**over, "name": "Flyover"})],
        ),
        radius_m=120.0,
    )
    file = written(world, tmp_path)
    (bridge,) = file.root.iter("bridge")
    road = file.roads[bridge.getparent().getparent().get("id")]
    assert road.height_m(0.0) == road.height_m(road.length_m) == 5.0
    assert float(bridge.get("length")) == pytest.approx(road.length_m)
    others = [r for r in file.roads.values() if r is not road]
    assert all(r.height_m(0.0) == r.height_m(r.length_m) == 0.0 for r in others)


def test_ramps_lead_up_to_a_bridge(tmp_path: Path) -> None:
    deck = drawn_world.road("deck", [[0, 0], [40, 0]], ahead=[3.0], layer=1)
    ramp = drawn_world.road("ramp", [[40, 0], [90, 0]], ahead=[3.0])
    far = drawn_world.road("far", [[90, 0], [190, 0]], ahead=[3.0])
    names = {"deck": (None, "p"), "ramp": ("p", "q"), "far": ("q", None)}
    roads = []
    for road, lanes in (deck, ramp, far):
        start, end = names[road.id]
        placed = msgspec.structs.replace(road, from_place=start, to_place=end)
        follow = {"deck.f0": "ramp.f0", "ramp.f0": "far.f0"}
        roads.append((placed, drawn_world.leading_to(lanes, follow)))
    file = written(drawn_world.world(*roads), tmp_path)
    check_closed(file)
    made = {r.source: r for r in file.roads.values()}
    assert made["deck"].height_m(40.0) == 5.0
    # 6 % over 50 m are 3 m; the last 2 m come down within 100 m.
    assert made["ramp"].height_m(50.0) == pytest.approx(2.0)
    assert made["far"].height_m(100.0) == pytest.approx(0.0, abs=1e-9)


def test_the_frame_is_told_as_proj_and_agrees_with_ours(tmp_path: Path) -> None:
    world = plain()
    file = written(world, tmp_path)
    text = file.root.find("header/geoReference").text
    assert text == proj_of(world.frame)
    xy = np.array([[500.0, -300.0], [0.0, 0.0]])
    lat, lon = geo_from_local(world.frame, xy).T
    x, y = pyproj.Proj(text)(lon, lat)
    assert np.allclose(np.stack([x, y], axis=1), xy, atol=1e-6)
    raw = (tmp_path / "drawn-1.8.xodr").read_text(encoding="utf-8")
    assert f"<![CDATA[{text}]]>" in raw


def test_the_map_s_makers_are_named(tmp_path: Path) -> None:
    world = plain()
    file = written(world, tmp_path)
    raw = (tmp_path / "drawn-1.8.xodr").read_text(encoding="utf-8")
    assert f"<!-- Made by foretwin from map data: {ATTRIBUTION} -->" in raw
    told = {u.get("code"): u.get("value") for u in file.root.find("header").findall("userData")}
    assert told["attribution"] == ATTRIBUTION
    assert file.root.find("header/license").get("spdxid") == "ODbL-1.0"
    own = written(msgspec.structs.replace(world, attribution="drawn by us"), tmp_path)
    assert own.root.find("header/license") is None


def test_version_1_4_has_what_carla_reads_and_nothing_newer(tmp_path: Path) -> None:
    bus = {**STREET, "lanes": "3", "oneway": "yes", "bus:lanes": "||designated"}
    world = world_of(crossing(street=bus, node_tags={0: {"highway": "traffic_signals"}}))
    new, old = written(world, tmp_path), written(world, tmp_path, "1.4")
    check_closed(old)
    assert old.root.find("header").get("revMinor") == "4"
    assert not list(old.root.iter("semantics", "license", "outlines"))
    assert all("rule" not in r.element.attrib for r in old.roads.values())
    known = {"unknown", "rural", "motorway", "town", "lowSpeed", "pedestrian", "bicycle"}
    assert {t.get("type") for t in old.root.iterfind("road/type")} <= known
    kinds = [{e.get("type") for e in f.root.iter("lane")} for f in (new, old)]
    assert "bus" in kinds[0]
    assert "bus" not in kinds[1]
    assert len(list(old.root.iter("signal"))) == len(world.signals)


def test_lanes_that_may_be_changed_have_a_broken_line(tmp_path: Path) -> None:
    three = {**STREET, "lanes": "3", "oneway": "yes", "change:lanes": "not_right|yes|yes"}
    world = world_of(crossing(street=three))
    file = written(world, tmp_path)
    lanes = {lane.id: lane for lane in world.lanes}
    road = next(r for r in file.roads.values() if len(r.lanes) == 3 and r.junction == "-1")
    marks = {n: lane.find("roadMark") for n, lane in road.lanes.items()}
    source = next(r for r in world.roads if r.id == road.source)
    assert [lanes[i].change for i in source.lane_ids][1:] == ["both", "both"]
    assert (marks[-2].get("type"), marks[-2].get("laneChange")) == ("broken", "both")
    assert (marks[-3].get("type"), marks[-3].get("laneChange")) == ("solid", "none")
    if lanes[source.lane_ids[0]].change == "left":
        assert (marks[-1].get("type"), marks[-1].get("laneChange")) == ("solid broken", "increase")


def test_a_world_without_roads_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no road with lanes"):
        write_opendrive(drawn_world.world(), tmp_path / "empty.xodr")


def test_names_that_xml_cannot_hold_are_written_all_the_same(tmp_path: Path) -> None:
    world = plain()
    odd = "A\x00B\x0b<\ud800&\"'"
    roads = tuple(msgspec.structs.replace(road, name=odd) for road in world.roads)
    world = msgspec.structs.replace(world, roads=roads, attribution="made -- by us -")
    file = written(world, tmp_path)
    assert {r.element.get("name") for r in file.roads.values()} == {"A?B?<?&\"'"}
    told = {u.get("code"): u.get("value") for u in file.root.find("header").findall("userData")}
    assert told["attribution"] == "made -- by us -"


def test_lanes_that_would_jump_aside_are_not_linked(tmp_path: Path) -> None:
    wide, narrow = (
        drawn_world.road("wide", [[0, 0], [50, 0]], ahead=[3.0, 3.0]),
        drawn_world.road("narrow", [[50, 0], [90, 0]], ahead=[3.0]),
    )
    lanes = drawn_world.leading_to(wide[1], {"wide.f0": "narrow.f0", "wide.f1": "narrow.f0"})
    roads = [
        (msgspec.structs.replace(wide[0], to_place="p"), lanes),
        (msgspec.structs.replace(narrow[0], from_place="p"), narrow[1]),
    ]
    file = written(drawn_world.world(*roads), tmp_path)
    check_closed(file)
    assert [(a[2], b[2]) for a, b in file.joints()] == [(-1, -1), (-1, -1)]


@pytest.mark.parametrize("origin", [None, IRELAND])
def test_a_sidewalk_along_a_road_is_a_lane_of_it(tmp_path: Path, origin) -> None:
    more = {} if origin is None else {"origin": origin}
    world = world_of(crossing(street={**STREET, "sidewalk": "left"}, **more))
    square = Area(id="square", outline=np.array([[30.0, 30.0], [40.0, 30.0], [40.0, 40.0]]))
    world = msgspec.structs.replace(world, sidewalks=(*world.sidewalks, square))
    file = written(world, tmp_path)
    check_closed(file)
    found = 0
    for road in file.roads.values():
        walks = [n for n, lane in road.lanes.items() if lane.get("type") == "sidewalk"]
        source = next((r for r in world.roads if r.id == road.source), None)
        if source is None or source.name != "Street":
            assert not walks
            continue
        found += 1
        assert walks == [max(road.lanes)]
        inner, outer = road.edges_m(walks[0], 5.0)
        assert inner == pytest.approx(source.left_m, abs=1e-6)
        assert outer - inner == pytest.approx(2.0, abs=0.06)
    assert found == 2
    (left_over,) = (o for o in file.root.iter("object") if o.get("subtype") == "sidewalk")
    assert left_over.get("name") == "square"


def test_a_lane_on_the_wrong_side_is_said_to_run_against_it(tmp_path: Path) -> None:
    drawn, (against, ahead) = drawn_world.road(
        "street", [[0, 0], [80, 0]], ahead=[3.0], against=[3.25]
    )
    # A bus lane the other way at the right kerb of a one-way street.
    bus = msgspec.structs.replace(against, kind="bus", left_of_reference_m=-4.625)
    world = drawn_world.world((drawn, [ahead, bus]))
    new, old = written(world, tmp_path), written(world, tmp_path, "1.4")
    (road,), (in_old,) = new.roads.values(), old.roads.values()
    assert [(n, lane.get("type"), lane.get("direction")) for n, lane in road.lanes.items()] == [
        (-2, "bus", "reversed"),
        (-1, "driving", None),
    ]
    assert road.edges_m(-2, 0.0) == pytest.approx((-3.0, -6.25))
    # 1.4 cannot say so: nobody may take it for a lane of the other direction.
    assert in_old.lanes[-2].get("type") == "restricted"
