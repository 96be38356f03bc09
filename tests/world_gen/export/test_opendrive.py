"""OpenDRIVE files say what the World says, and their roads and lanes close without gaps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import (
    IRELAND,
    STREET,
    crossing,
    drawn_map,
    roundabout,
    world_of,
)
from tests.world_gen.export.read_opendrive import OpenDriveFile, bend_rad, gap_m

COVERS = (
    "foretwin.world_gen.export.opendrive_elements",
    "foretwin.world_gen.export.opendrive_roads",
    "foretwin.world_gen.export.opendrive_tapers",
)
PRIMARY = {"highway": "primary", "name": "Avenue", "lanes": "4"}


def written(world: World, folder: Path, version: str = "1.8") -> OpenDriveFile:
    path = folder / f"drawn-{version}.xodr"
    write_opendrive(world, path, version=version)  # type: ignore[arg-type]
    return OpenDriveFile.read(path)


def plain() -> World:
    return world_of(crossing(avenue=PRIMARY))


def one_ways() -> World:
    against = {"highway": "secondary", "name": "Avenue", "oneway": "-1", "lanes": "2"}
    return world_of(crossing(street={**STREET, "oneway": "yes", "lanes": "3"}, avenue=against))


def ring() -> World:
    return world_of(roundabout())


def left_hand() -> World:
    return world_of(crossing(avenue=PRIMARY, origin=IRELAND))


def left_hand_ring() -> World:
    return world_of(roundabout(origin=IRELAND, clockwise=True))


def bent_and_widened() -> World:
    """East of the crossing a road bends by 60°, then gets wider, then has more lanes."""
    street = {**STREET, "sidewalk": "both"}
    wide = {**street, "width": "8"}
    return world_of(
        crossing(
            street=street,
            extra_nodes={5: (130.0, 50.0), 6: (155.0, 85.0), 7: (180.0, 115.0), 8: (190.0, 140.0)},
            extra_ways=[
                (15, [1, 5, 6], street),
                (16, [6, 7], wide),
                (17, [7, 8], {**wide, "lanes": "4"}),
            ],
        ),
        radius_m=300.0,
    )


DRAWN: Mapping[str, Callable[[], World]] = {
    f.__name__: f for f in (plain, one_ways, ring, left_hand, left_hand_ring, bent_and_widened)
}


@pytest.fixture(params=list(DRAWN))
def drawn(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[World, OpenDriveFile]:
    world = DRAWN[request.param]()
    return world, written(world, tmp_path)


def check_closed(file: OpenDriveFile) -> None:
    for joint in file.joints():
        assert gap_m(joint) < 1e-3, joint
        assert bend_rad(joint) < 0.01, joint
        (a, end_a, _), (b, end_b, _) = joint
        assert abs(a.height_m(a.s_of(end_a)) - b.height_m(b.s_of(end_b))) < 1e-6
    for road in file.roads.values():
        items = road.element.findall("planView/geometry")
        assert float(items[0].get("s")) == 0.0
        for item in items[1:]:
            s = float(item.get("s"))
            before, after = road.at(s - 1e-7), road.at(s + 1e-9)
            assert math.dist(before.point, after.point) < 1e-5
            assert abs(math.remainder(before.heading_rad - after.heading_rad, math.tau)) < 1e-5


def check_links(file: OpenDriveFile) -> None:
    """Fail where a link is not returned."""
    joints = {
        ((a.id, end_a, lane_a), (b.id, end_b, lane_b))
        for (a, end_a, lane_a), (b, end_b, lane_b) in file.joints()
    }
    for one, other in joints:
        if file.roads[one[0]].junction == file.roads[other[0]].junction == "-1":
            assert (other, one) in joints
    for connection in file.root.iterfind("junction/connection"):
        road = file.roads[connection.get("connectingRoad")]
        assert road.junction == connection.getparent().get("id")
        assert connection.get("incomingRoad") == road.link("start").get("elementId")
        for link in connection.findall("laneLink"):
            lane = road.lanes[int(link.get("to"))]
            assert lane.find("link/predecessor").get("id") == link.get("from")
            outgoing = file.roads[road.link("end").get("elementId")]
            assert int(lane.find("link/successor").get("id")) in outgoing.lanes


def test_roads_and_lanes_join_without_gaps(drawn: tuple[World, OpenDriveFile]) -> None:
    assert len(list(drawn[1].joints())) >= 2 * len(drawn[0].connections)
    check_closed(drawn[1])


def test_every_link_is_returned(drawn: tuple[World, OpenDriveFile]) -> None:
    check_links(drawn[1])


def test_every_connection_is_driven_in_the_world_s_direction(
    drawn: tuple[World, OpenDriveFile],
) -> None:
    world, file = drawn
    along = "-1" if world.intersection.driving_side == "right" else "1"
    lanes = {lane.id: lane for lane in world.lanes}
    made = {r.source: r for r in file.roads.values()}
    connecting = [c for c in world.connections if c.id in made]
    assert connecting
    for c in connecting:
        road = made[c.id]
        assert list(road.lanes) == [int(along)]
        start, end = lanes[c.from_lane_id].centerline[-1], lanes[c.to_lane_id].centerline[0]
        for s, point in ((0.0, start), (road.length_m, end)):
            middle = np.mean(road.borders(int(along), s), axis=0)
            assert math.dist(middle, point) < 0.02


def test_lanes_lie_where_the_world_has_them(drawn: tuple[World, OpenDriveFile]) -> None:
    world, file = drawn
    made = {r.source: r for r in file.roads.values()}
    checked = 0
    for lane in world.lanes:
        road = made[lane.road_id]
        along = [n for n in road.lanes if ((n < 0) == (road.element.get("rule") == "RHT"))]
        numbers = [n for n in road.lanes if (n in along) != lane.reverse]
        s = np.linspace(0.0, road.length_m, 60)
        middles = [[np.mean(road.borders(n, at), axis=0) for at in s] for n in numbers]
        gaps = [
            np.hypot(*(np.array(line)[:, None] - lane.centerline[None]).T).min(axis=1).max()
            for line in middles
        ]
        # Half the distance between two of the 60 points, and what rounding a corner takes.
        assert min(gaps) < road.length_m / 118 + 0.1
        checked += 1
    assert checked == len(world.lanes)


def test_four_roads_that_cross_are_one_junction(tmp_path: Path) -> None:
    world = plain()
    file = written(world, tmp_path)
    (junction,) = file.root.findall("junction")
    roads = [r for r in file.roads.values() if r.junction == "-1"]
    assert len(roads) == 4
    assert len(junction.findall("connection")) == len(world.connections)
    limits = {str(round(lane.speed_limit_mps.value * 3.6)) for lane in world.lanes}
    assert {r.element.find("type/speed").get("max") for r in roads} == limits
    assert sorted(len(r.lanes) for r in roads) == [2, 2, 4, 4]
    assert junction.get("name") == world.intersection.name


def test_every_node_of_a_ring_is_a_junction_of_one_group(tmp_path: Path) -> None:
    file = written(ring(), tmp_path)
    (group,) = file.root.findall("junctionGroup")
    assert group.get("type") == "roundabout"
    members = {item.get("junction") for item in group}
    assert members == {item.get("id") for item in file.root.findall("junction")}
    assert len(members) == 3


def test_a_road_that_bends_or_widens_goes_on_as_a_road(tmp_path: Path) -> None:
    file = written(bent_and_widened(), tmp_path)
    assert len(file.root.findall("junction")) == 2  # the crossing; 2 lanes become 4
    plain_roads = [r for r in file.roads.values() if r.junction == "-1"]
    short = [r for r in plain_roads if r.source.isdigit()]
    linked = [a[0].lanes[a[2]].get("type") for a, _ in file.joints()]
    assert linked.count("sidewalk") == 4  # on both sides of one joint, said by both roads
    (wider,) = short
    assert [to.get("elementType") for to in wider.element.find("link")] == ["road", "road"]
    for number in wider.lanes:
        widths = [abs(np.subtract(*wider.edges_m(number, s))) for s in (0.0, wider.length_m)]
        assert np.allclose(widths, [3.0, 4.0], atol=1e-9)


ARMS = st.lists(
    st.tuples(
        st.floats(-12.0, 12.0),  # how far its direction is off an even star, in degrees
        st.integers(1, 5),  # lanes
        st.sampled_from(["no", "yes", "-1"]),
        st.floats(-60.0, 60.0),  # how far it bends, in degrees
    ),
    min_size=3,
    max_size=5,
)


@settings(max_examples=25)
@given(arms=ARMS, left_hand=st.booleans())
def test_any_star_of_roads_closes(
    tmp_path_factory: pytest.TempPathFactory, arms, left_hand
) -> None:
    nodes: dict[int, tuple[float, float]] = {0: (0.0, 0.0)}
    ways = []
    for i, (off, lanes, one_way, bend) in enumerate(arms):
        angle = math.tau * i / len(arms) + math.radians(off)
        x, y = 60.0 * math.cos(angle), 60.0 * math.sin(angle)
        angle += math.radians(bend)
        nodes[10 + i], nodes[20 + i] = (x, y), (x + 40 * math.cos(angle), y + 40 * math.sin(angle))
        tags = {"highway": "secondary", "name": f"{i}", "lanes": str(lanes), "oneway": one_way}
        ways.append((100 + i, [0, 10 + i, 20 + i], tags))
    osm = drawn_map(nodes, ways, **({"origin": IRELAND} if left_hand else {}))
    file = written(world_of(osm), tmp_path_factory.mktemp("star"))
    check_closed(file)
    check_links(file)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("map_file", "node"),
    [
        ("osm-berlin-moritzplatz/berlin-moritzplatz.osm", 29215047),  # a roundabout
        ("osm-kingsway/kingsway_junction.osm", 21653578),  # slip roads, left-hand, signals
    ],
)
def test_real_junctions_close(data_dir: Path, tmp_path: Path, map_file: str, node: int) -> None:
    osm = read_map(data_dir / map_file)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    junction = next(j for j in junctions if node in j.nodes)
    index = index_map(osm, graph, junctions)
    world = build_world(osm, graph, junction, index=index)
    file = written(world, tmp_path)
    check_closed(file)
    check_links(file)
    assert len(list(file.root.iter("object"))) >= len(world.buildings)
    assert len(list(file.root.iter("controller"))) >= len({s.group_id for s in world.signals})


def test_crosswalks_have_the_outline_that_carla_reads(tmp_path: Path) -> None:
    """One of the object itself, which ends with its first corner, in both versions."""
    tags = {"highway": "crossing", "crossing": "zebra"}
    way = [(15, [1, 5], STREET)]
    osm = crossing(extra_nodes={5: (140.0, 0.0)}, extra_ways=way, node_tags={1: tags})
    world = world_of(osm)
    assert len(world.crossings) == 1
    for version in ("1.8", "1.4"):
        file = written(world, tmp_path, version)
        (made,) = file.root.iterfind("road/objects/object[@type='crosswalk']")
        assert made.find("outlines") is None
        corners = [(c.get("u"), c.get("v")) for c in made.iterfind("outline/cornerLocal")]
        assert len(corners) == 5
        assert corners[0] == corners[-1]
