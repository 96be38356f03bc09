"""A crossroads made by world generation, and crowds of few road users on paths through it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.road_users.crowd import Crowd, EgoBoxes
from foretwin.sim_worker.road_users.paces import Paces
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.sketch import Sketch

FAR_EGO = EgoBoxes(np.array([[900.0, 900.0, 0.0]]), np.zeros(1), 0, np.array([-500.0]), 4.5, 1.8)
"""An ego that is nowhere near."""


def crossroads(folder: Path, *, centre: dict[str, str] | None = None, **minor: str) -> World:
    """East to west a road named Major, south to north one named Minor, which has more tags."""
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0, **(centre or {}))
    for node, x, y in ((2, 150.0, 0.0), (3, 0.0, 150.0), (4, -150.0, 0.0), (5, 0.0, -150.0)):
        sketch.node(node, x, y)
    sketch.road(10, [4, 1, 2], name="Major")
    sketch.road(11, [5, 1, 3], name="Minor", **minor)
    osm = sketch.read(folder)
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    return build_world(osm, graph, junction)


def path_of(world: World, connection: Connection) -> FrenetPath:
    """Return the path of a connection with the lanes before and after it."""
    lanes = {lane.id: lane.centerline for lane in world.lanes}
    parts = (lanes[connection.from_lane_id], connection.centerline, lanes[connection.to_lane_id])
    return FrenetPath(np.concatenate(parts), before_m=100.0)


def straight_on(world: World, heading: tuple[float, float]) -> FrenetPath:
    """Return the path straight over the junction towards `heading`."""
    for connection in world.connections:
        way = connection.centerline[-1] - connection.centerline[0]
        if connection.turn == "straight" and way @ np.asarray(heading) > 0.9 * np.hypot(*way):
            return path_of(world, connection)
    raise LookupError(f"no way straight on towards {heading}")


def centre_arc(path: FrenetPath) -> float:
    """Return the arc length where a path passes the junction's centre."""
    return float(path.locate(np.zeros((1, 2))).arc_m[0])


def traffic(
    world: World,
    paths: list[FrenetPath],
    *,
    before_m: list[float],
    speed_mps: list[float],
    lawful: list[bool],
    brakes_at_s: float = np.inf,
    present: list[bool] | None = None,
    reaction_s: float = 0.0,
) -> Traffic:
    """One future in which each path has one car, so many metres before the junction's centre."""
    rules = JunctionRules(world)
    row: Array = np.ones((1, len(paths)))
    start = np.array([[centre_arc(p) - b for p, b in zip(paths, before_m, strict=True)]])
    speed = np.array([speed_mps])
    crowd = Crowd(
        present=row > 0 if present is None else np.array([present]),
        lawful=np.array([lawful]),
        length_m=4.5 * row,
        width_m=1.8 * row,
        path_of=np.arange(len(paths))[None],
        pace_of=np.where(np.array(lawful) | (speed == 0.0), -1, np.arange(len(paths))),
        lateral_m=0.0 * row,
        start_arc_m=start,
        start_speed_mps=speed,
        desired_mps=np.maximum(speed, 8.0),
        accel_mps2=2.0 * row,
        decel_mps2=3.0 * row,
        time_gap_s=1.2 * row,
        briskness=row,
        reaction_s=reaction_s * row,
        lag_s=row,
        brakes_at_s=brakes_at_s * row,
        brakes_by_mps2=4.0 * row,
        walks=row < 0,
        kinds=np.zeros(row.shape, np.intp),
        known=row > 0,
        hidden_by=np.full(row.shape, -1),
    )
    paces = Paces(paths, np.arange(len(paths)), speed[0], np.ones(len(paths)))
    between = rules.between([rules.taken(p) for p in paths])
    return Traffic(crowd, PathTable(paths), between, paces)


def run(
    moving: Traffic, *, seconds: float, ego: EgoBoxes = FAR_EGO, red_arcs_m: Array | None = None
) -> Array:
    """Return (T, R, 2) arc length and speed of the one future at each tick of 50 ms."""
    red = np.full((len(moving.table), 0), np.inf) if red_arcs_m is None else red_arcs_m
    seen = []
    for tick in range(round(seconds * 20)):
        if tick % 4 == 0:
            moving.decide(ego, red)
        moving.step(time_s=tick * 0.05, dt_s=0.05)
        seen.append(np.stack([moving.arc_m[0], moving.speed_mps[0]], axis=-1))
    return np.array(seen)
