from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.sim_worker.metrics.junction import junction as drawn_junction
from tests.sim_worker.places import straight_path

EASTWARD = FrenetPath(straight_path().xy_m)


@pytest.mark.real_data
def test_paths_of_real_junctions_take_their_connection_and_stay_on_the_ground(
    data_dir: Path,
) -> None:
    osm = read_map(data_dir / "osm-berlin-moritzplatz" / "berlin-moritzplatz.osm")
    graph = build_road_graph(osm)
    seen = 0
    for junction in find_intersections(osm, graph)[::7]:
        world = build_world(osm, graph, junction)
        ground = DrivableGround(world)
        lanes = {lane.id: lane.centerline for lane in world.lanes}
        for connection in world.connections:
            if connection.junction_id != world.intersection.id:
                continue
            ways = (lanes[connection.from_lane_id], connection.centerline)
            path = FrenetPath(np.concatenate([*ways, lanes[connection.to_lane_id]]))
            rules = RouteRules(world, path)
            points = path.point_at(np.linspace(0.0, path.length_m, 60))

            assert connection.id in rules.connections
            assert {c.own_id for c in rules.conflicts} <= set(rules.connections)
            waits = {c.other_id for c in rules.conflicts if c.own_id == connection.id}
            assert waits == set(connection.yields_to)
            assert ground.contains(points[:, 0], points[:, 1]).all()
            seen += 1
    assert seen > 10


@pytest.mark.parametrize(("lights", "group_id"), [(True, "ew"), (False, None)])
def test_the_stop_lines_of_the_lanes_it_comes_along_count_alone(
    lights: bool, group_id: str | None
) -> None:
    world = drawn_junction(lights=lights)
    (line,) = world.stop_lines
    aside = msgspec.structs.replace(line, id="aside", lane_id="from_north")
    world = msgspec.structs.replace(world, stop_lines=(line, aside))
    rules = RouteRules(world, EASTWARD)

    assert [(ahead.line_id, ahead.group_id) for ahead in rules.lines] == [("stop", group_id)]


def test_a_way_with_priority_is_followed_120_m_back() -> None:
    world = drawn_junction(lights=False)
    way = next(c.way for c in RouteRules(world, EASTWARD).conflicts if c.other_id == "north")

    # The nodes of the lane before are 4 m apart; the connection that it leads into is 16 m long.
    assert way.length_m == pytest.approx(120.0 + 16.0)
