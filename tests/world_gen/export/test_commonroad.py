"""CommonRoad scenarios: references, neighbours, intersections, signs and light cycles."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from lxml import etree

from foretwin.contracts.beside_road import Building
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.world import ATTRIBUTION, StopLine, World
from foretwin.world_gen.export.commonroad import write_commonroad
from tests.world_gen.drawn_maps import roundabout, world_of
from tests.world_gen.export.drawn_world import ZEBRA, road, world
from tests.world_gen.export.signalled import signalled_crossing

COVERS = ("foretwin.world_gen.export.commonroad_intersections",)
DAY = datetime.date(2025, 6, 1)
STRAIGHT = [(0.0, 0.0), (50.0, 0.0)]


def written(drawn: World, folder: Path, **options: Any) -> Any:
    path = folder / "map.xml"
    write_commonroad(drawn, path, date=DAY, **options)
    return etree.parse(str(path)).getroot()


def refs(element: Any, tag: str) -> list[int]:
    return [int(e.get("ref")) for e in element.iterfind(tag)]


def line_of(bound: Any) -> list[tuple[float, float]]:
    return [(float(p.findtext("x")), float(p.findtext("y"))) for p in bound.iterfind("point")]


def lanelets(root: Any) -> dict[int, Any]:
    return {int(e.get("id")): e for e in root.iterfind("lanelet")}


@pytest.mark.parametrize("drawn", [signalled_crossing(), world_of(roundabout())], ids=["x", "o"])
def test_ids_are_unique_and_references_closed(drawn: World, tmp_path: Path) -> None:
    root = written(drawn, tmp_path)
    ids = [int(e.get("id")) for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    named = {int(e.get("ref")) for e in root.iter() if e.get("ref")}
    assert named <= set(ids)
    found = lanelets(root)
    assert len(found) == len(drawn.lanes) + len(drawn.connections) + len(drawn.crossings)
    for number, lanelet in found.items():
        left, right = line_of(lanelet.find("leftBound")), line_of(lanelet.find("rightBound"))
        assert len(left) == len(right) >= 2
        for after in refs(lanelet, "successor"):
            assert number in refs(found[after], "predecessor")
            assert left[-1] == line_of(found[after].find("leftBound"))[0]
            assert right[-1] == line_of(found[after].find("rightBound"))[0]


def test_the_file_says_what_it_is_and_whose_map(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    root = written(drawn, tmp_path)
    assert root.get("commonRoadVersion") == "2020a"
    assert root.get("source").startswith(ATTRIBUTION)
    assert root.get("date") == "2025-06-01"
    assert ATTRIBUTION in str(root[0].text)  # a comment
    location = root.find("location")
    assert float(location.findtext("gpsLatitude")) == pytest.approx(52.0)
    assert "+proj=tmerc" in location.findtext("geoTransformation/geoReference")
    assert root.find("planningProblem") is None


def test_neighbours_lie_beside_each_other_both_ways(tmp_path: Path) -> None:
    drawn = world(road("r", STRAIGHT, ahead=[3.0, 3.5], against=[3.0]))
    found = lanelets(written(drawn, tmp_path))
    against, inner, outer = (found[i] for i in (1, 2, 3))
    assert inner.find("adjacentLeft").attrib == {"ref": "1", "drivingDir": "opposite"}
    assert against.find("adjacentLeft").attrib == {"ref": "2", "drivingDir": "opposite"}
    assert inner.find("adjacentRight").attrib == {"ref": "3", "drivingDir": "same"}
    assert outer.find("adjacentLeft").attrib == {"ref": "2", "drivingDir": "same"}
    assert outer.find("adjacentRight") is None
    assert inner.findtext("rightBound/lineMarking") == "dashed"
    assert inner.findtext("leftBound/lineMarking") == "solid_solid"
    assert outer.findtext("rightBound/lineMarking") == "curb"


def test_an_intersection_lists_its_approaches_and_who_comes_from_the_left(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    root = written(drawn, tmp_path)
    (intersection,) = root.iterfind("intersection")
    incomings = {int(e.get("id")): e for e in intersection.iterfind("incoming")}
    assert len(incomings) == 4
    for incoming in incomings.values():
        for turn in ("Right", "Straight", "Left"):
            assert len(refs(incoming, f"successors{turn}")) == 1
    numbers = {i: lane.id for i, lane in enumerate(drawn.lanes, start=1)}
    comes_from = {
        number: numbers[refs(incoming, "incomingLanelet")[0]].split(".")[0]
        for number, incoming in incomings.items()
    }
    left_of = {comes_from[n]: comes_from[refs(e, "isLeftOf")[0]] for n, e in incomings.items()}
    # w11 comes in from the east, w12 from the north, w13 from the west, w14 from the south.
    assert left_of == {"w13": "w14", "w14": "w11", "w11": "w12", "w12": "w13"}


def test_a_roundabout_is_an_intersection_for_each_arm(tmp_path: Path) -> None:
    drawn = world_of(roundabout())
    connections = tuple(
        msgspec.structs.replace(
            c,
            junction_id="o",
            place_id=str(min((1, 2, 3), key=lambda i: _gap(c.centerline.mean(axis=0), i))),
        )
        for c in drawn.connections
    )
    root = written(msgspec.structs.replace(drawn, connections=connections), tmp_path)
    counts = [len(list(i.iterfind("incoming"))) for i in root.iterfind("intersection")]
    assert counts == [2, 2, 2]  # from the arm, and from the ring
    assert root.find("scenarioTags/roundabout") is not None


def _gap(point: Any, arm: int) -> float:
    places = {1: (15.0, 0.0), 2: (0.0, 15.0), 3: (-15.0, 0.0)}
    return float(np.hypot(*(point - places[arm])))


def sign_ids(root: Any) -> list[tuple[str, str]]:
    """Return id and whether it is virtual, of all signs but those of speed."""
    found = [
        (s.findtext("trafficSignElement/trafficSignID"), s.findtext("virtual"))
        for s in root.iterfind("trafficSign")
    ]
    return [sign for sign in found if sign[0] not in ("274", "r301", "R2-1")]


@pytest.mark.parametrize(
    ("country", "stop", "give_way"),
    [("ZAM", "206", "205"), ("ESP", "r2", "r1"), ("AUS", "R1-1", "R1-2"), ("FRA", None, None)],
)
def test_signs_are_those_of_the_country(
    country: str, stop: str | None, give_way: str | None, tmp_path: Path
) -> None:
    one, other = road("a", STRAIGHT, ahead=[3.0, 3.0]), road("b", [(0, 20), (50, 20)], ahead=[3.0])
    lines = [
        StopLine(
            id=f"{lane}:stop",
            lane_id=lane,
            ends=np.array([[49.0, y], [49.0, y - 3.0]]),
            control=Choice(control, source),  # type: ignore[arg-type]
        )
        for lane, y, control, source in (
            ("a.f0", 0.0, "stop", "tagged"),
            ("a.f1", -3.0, "stop", "tagged"),
            ("b.f0", 20.0, "give_way", "inferred"),
        )
    ]
    root = written(world(one, other, stop_lines=tuple(lines)), tmp_path, country=country)
    wanted = [(stop, "false"), (give_way, "true")]
    assert [s for s in sign_ids(root) if s[0] != "B14"] == [s for s in wanted if s[0]]
    if stop:  # one sign for both lanes, at the kerb
        sign = root.find("trafficSign")
        assert line_of(sign.find("position")) == [(49.0, -6.0)]
        found = lanelets(root)
        assert all(int(sign.get("id")) in refs(found[i], "trafficSignRef") for i in (1, 2))


def test_priority_is_signed_where_others_wait_by_a_sign(tmp_path: Path) -> None:
    drawn = signalled_crossing()
    priority = next(c for c in drawn.connections if c.from_lane_id.startswith("w13"))
    conflicts = tuple(
        msgspec.structs.replace(c, rule="give_way", source="tagged")
        if priority.id in (c.first_id, c.second_id) and c.yields_id != priority.id
        else msgspec.structs.replace(c, rule="near_side")
        for c in drawn.conflicts
    )
    assert any(c.rule == "give_way" for c in conflicts)
    root = written(msgspec.structs.replace(drawn, conflicts=conflicts), tmp_path)
    assert sign_ids(root) == [("306", "false")]


def test_a_guessed_speed_limit_stands_on_a_virtual_sign_in_metres_per_second(
    tmp_path: Path,
) -> None:
    one, lanes = road("r", STRAIGHT, ahead=[3.0])
    guessed = Quantity(30 / 3.6, "default")
    drawn = world((one, [msgspec.structs.replace(lanes[0], speed_limit_mps=guessed)]))
    root = written(drawn, tmp_path)
    (sign,) = root.iterfind("trafficSign")
    assert sign.findtext("trafficSignElement/trafficSignID") == "274"
    assert sign.findtext("trafficSignElement/additionalValue") == "8.3333"
    assert sign.findtext("virtual") == "true"
    assert refs(root.find("lanelet"), "trafficSignRef") == [int(sign.get("id"))]


def test_an_unknown_country_is_refused_with_those_that_are_known(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"country 'XYZ'.*DEU.*ZAM"):
        written(world(road("r", STRAIGHT, ahead=[3.0])), tmp_path, country="XYZ")


def test_buildings_are_obstacles_unless_one_drives_under_them(tmp_path: Path) -> None:
    square = np.array([[10.0, 10.0], [20.0, 10.0], [20.0, 20.0], [10.0, 20.0]])
    house = Building(id="h", outline=square, holes=(), height_m=Quantity(9.0, "tagged"))
    bridge = msgspec.structs.replace(house, id="b", min_height_m=4.5)
    bow_tie = msgspec.structs.replace(house, id="x", outline=square[[0, 1, 3, 2]])
    drawn = world(road("r", STRAIGHT, ahead=[3.0]), buildings=(house, bridge, bow_tie))
    (obstacle,) = written(drawn, tmp_path).iterfind("environmentObstacle")
    assert obstacle.findtext("type") == "building"
    assert line_of(obstacle.find("shape/polygon")) == [tuple(p) for p in square.tolist()]


def test_crossings_are_crosswalks_for_pedestrians_both_ways(tmp_path: Path) -> None:
    root = written(world(road("r", STRAIGHT, ahead=[3.0]), crossings=(ZEBRA,)), tmp_path)
    lanelet = list(root.iterfind("lanelet"))[-1]
    assert lanelet.findtext("laneletType") == "crosswalk"
    assert lanelet.findtext("userBidirectional") == "pedestrian"
    assert line_of(lanelet.find("leftBound")) == [(18.0, -3.0), (18.0, 3.0)]
