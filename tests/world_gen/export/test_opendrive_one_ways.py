"""Left-hand traffic in OpenDRIVE 1.4, which knows right-hand traffic alone."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.elevation import Elevation, HeightProfile
from foretwin.contracts.world import World
from foretwin.world_gen.export.opendrive_one_ways import SECOND, parted_by_direction
from tests.world_gen.drawn_maps import IRELAND, STREET, crossing, roundabout, world_of
from tests.world_gen.export.read_opendrive import OpenDriveFile
from tests.world_gen.export.test_opendrive import check_closed, check_links, written


def street_that_goes_on() -> World:
    """East of the crossing the street bends a little and gets wider; it has sidewalks."""
    street = {**STREET, "sidewalk": "both"}
    more = [(15, [1, 5], street), (16, [5, 6], {**street, "width": "8"})]
    nodes = {5: (200.0, 10.0), 6: (260.0, 20.0)}
    osm = crossing(street=street, extra_nodes=nodes, extra_ways=more, origin=IRELAND)
    return world_of(osm, radius_m=300.0)


def one_way_street() -> World:
    return world_of(crossing(street={**STREET, "oneway": "yes", "lanes": "2"}, origin=IRELAND))


WORLDS = {
    "crossing": lambda: world_of(crossing(origin=IRELAND)),
    "ring": lambda: world_of(roundabout(origin=IRELAND, clockwise=True)),
    "goes_on": street_that_goes_on,
    "one_way": one_way_street,
}


@pytest.fixture(params=list(WORLDS))
def drawn(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[World, OpenDriveFile]:
    world = WORLDS[request.param]()
    return world, written(world, tmp_path, "1.4")


def test_lanes_are_driven_as_right_hand_traffic_has_them(
    drawn: tuple[World, OpenDriveFile],
) -> None:
    """To the right of lane 0 along the line, to the left against it, where the World has them."""
    world, file = drawn
    assert world.intersection.driving_side == "left"
    lines = {lane.id: lane.centerline for lane in world.lanes}
    seen = 0
    for road in file.roads.values():
        assert "rule" not in road.element.attrib
        if road.junction != "-1" or road.source.rstrip(SECOND) not in {r.id for r in world.roads}:
            continue
        signs = {np.sign(number) for number, e in road.lanes.items() if e.get("type") == "driving"}
        assert len(signs) == 1, "one direction for each road"
        for number, element in road.lanes.items():
            if element.get("type") != "driving":
                continue
            ends = (road.length_m, 0.0) if number > 0 else (0.0, road.length_m)
            as_driven = np.array([np.mean(road.borders(number, s), axis=0) for s in ends])
            apart = [np.hypot(*(as_driven - line[[0, -1]]).T).max() for line in lines.values()]
            assert min(apart) < 0.1, (road.source, number)
            seen += 1
    assert seen == sum(lane.kind == "driving" for lane in world.lanes)


def test_roads_of_one_direction_join_as_roads_do(drawn: tuple[World, OpenDriveFile]) -> None:
    world, file = drawn
    check_closed(file)
    check_links(file)
    assert len(list(file.joints())) >= 2 * len(world.connections)


def test_where_a_street_goes_on_each_direction_does(tmp_path: Path) -> None:
    world = street_that_goes_on()
    new, old = written(world, tmp_path), written(world, tmp_path, "1.4")
    assert len(old.root.findall("junction")) == len(new.root.findall("junction"))
    kinds = Counter(e.get("type") for road in old.roads.values() for e in road.lanes.values())
    assert kinds["sidewalk"] == len(world.sidewalks) > 0


def test_both_directions_climb_as_the_road_does(tmp_path: Path) -> None:
    flat = WORLDS["crossing"]()
    profiles = [
        HeightProfile(
            id=part.id,
            along_m=np.array([0.0, 93.5]),
            height_m=np.array([0.0, 4.0]),
            grade=np.full(2, 4.0 / 93.5),
        )
        for part in (*flat.roads, *flat.connections)
    ]
    elevation = Elevation(
        source="drawn",
        base_m=0.0,
        grade_std=0.0,
        roads=tuple(profiles[: len(flat.roads)]),
        connections=tuple(profiles[len(flat.roads) :]),
        ground_from_m=(-200.0, -200.0),
        ground_step_m=400.0,
        ground_m=np.zeros((2, 2)),
    )
    file = written(msgspec.structs.replace(flat, elevation=elevation), tmp_path, "1.4")
    roads = [road for road in file.roads.values() if road.junction == "-1"]
    assert len(roads) == 2 * len(flat.roads)
    assert [round(road.height_m(road.length_m), 2) for road in roads] == [4.0] * len(roads)


def test_a_road_of_one_direction_stays_as_it_is() -> None:
    world = one_way_street()
    parted = parted_by_direction(world)
    names = {road.id for road in parted.roads}
    assert {road.id for road in world.roads} <= names
    assert not any(road.id + SECOND in names for road in world.roads if road.name == "Street")
    avenues = [road for road in world.roads if road.name == "Avenue"]
    assert len(parted.roads) == len(world.roads) + len(avenues)
    assert sorted(i for road in parted.roads for i in road.lane_ids) == sorted(
        i for road in world.roads for i in road.lane_ids
    )
