"""Lanelet2 maps: what refers to what, which lines lie where, and what Autoware needs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyproj
import pytest

from foretwin.contracts.world import (
    ATTRIBUTION,
    Area,
    World,
)
from foretwin.world_gen.export.lane_borders import Borders
from foretwin.world_gen.export.lanelet2 import write_lanelet2
from foretwin.world_gen.export.lanelet2_orientation import oriented, read_as_drawn
from tests.world_gen.drawn_maps import roundabout, world_of
from tests.world_gen.export.drawn_world import road, world
from tests.world_gen.export.lanelet2_file import assert_closed, read, written
from tests.world_gen.export.signalled import signalled_crossing

COVERS = (
    "foretwin.world_gen.export.lanelet2_orientation",
    "foretwin.world_gen.export.lanelet2_primitives",
    "foretwin.world_gen.export.lanelet2_surroundings",
    "foretwin.world_gen.export.lanelets",
)


@pytest.mark.parametrize("drawn", [signalled_crossing(), world_of(roundabout())], ids=["x", "o"])
def test_ids_are_unique_and_references_closed(drawn: World, tmp_path: Path) -> None:
    found = written(drawn, tmp_path, dialect="autoware")
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
        proj="tmerc",
        lat_0=float(values["latitude"]),
        lon_0=float(values["longitude"]),
        k_0=float(values["scale_factor"]),
        ellps="WGS84",
    )
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


def test_a_junction_encloses_its_ground_and_its_lanelets_name_it(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    square = np.array([[-8.0, -8.0], [8.0, -8.0], [8.0, 8.0], [-8.0, 8.0]])
    junction = msgspec.structs.replace(drawn.junctions[0], area=Area(id="x", outline=square))
    found = written(msgspec.structs.replace(drawn, junctions=(junction,)), tmp_path)
    ((way, (nodes, _)),) = [
        item for item in found.ways.items() if item[1][1]["type"] == "intersection_area"
    ]
    assert [float(found.nodes[n]["local_x"]) for n in nodes] == [-8.0, 8.0, 8.0, -8.0]
    for c in drawn.connections:
        assert found.lanelet(c.id)[1]["intersection_area"] == str(way)


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


def test_nobody_changes_to_a_closed_lane(tmp_path: Path) -> None:
    one, lanes = road("a", [(0.0, 0.0), (50.0, 0.0)], ahead=[3.0, 3.0])
    shoulder = msgspec.structs.replace(lanes[1], kind="closed")
    found = written(world((one, [lanes[0], shoulder])), tmp_path)
    line = {"type": "line_thick", "subtype": "solid", "lane_change": "no"}
    assert found.border("a.f0", "right") == found.border("a.f1", "left") == line


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
