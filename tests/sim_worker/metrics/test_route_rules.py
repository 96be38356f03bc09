from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph


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
