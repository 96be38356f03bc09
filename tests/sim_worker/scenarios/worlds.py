"""Small Worlds to place scenarios in, each built once."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import PathPose
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures import playable
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.drawing import Values
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_region
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import (
    AVENUE,
    GERMANY,
    IRELAND,
    STREET,
    crossing,
    drawn_map,
    roundabout,
    world_of,
)

SIGNALS = {"highway": "traffic_signals"}
ROAD = {"highway": "secondary", "name": "High Road", "lanes": "2"}


_SCENES: dict[int, tuple[World, SceneMaker]] = {}


def places(
    scenario: Scenario,
    world: World,
    *,
    cases: Sequence[Values] | None = None,
    most: int | None = None,
) -> playable.Placement:
    """Place a scenario for the usual vehicle; what is made of a World and a vehicle is made once,
    as where the whole catalogue is placed."""
    scenes = _scenes(world)
    return playable.places(scenario, world, scenes=scenes, stage=_stage(), cases=cases, most=most)


def ego_alone(played: StagedCase, scenario: Scenario, world: World, time_s: Array) -> PathPose:
    """Where the ego of a case drives if it keeps its speed, for the usual vehicle."""
    return playable.ego_alone(played, scenario, _scenes(world), _stage(), time_s)


def _scenes(world: World) -> SceneMaker:
    return _SCENES.setdefault(id(world), (world, SceneMaker(world)))[1]


@functools.cache
def _stage() -> BatchSimulation:
    return rehearsal_stage(load_vehicle())


@functools.cache
def cross(*, left_hand: bool = False, signals: bool = False) -> World:
    """Four arms of 100 m to the east, north, west and south."""
    tags, main = {0: SIGNALS} if signals else None, {"maxspeed": "50"}
    osm = crossing(
        street=STREET | main, avenue=AVENUE | main, origin=_origin(left_hand), node_tags=tags
    )
    return world_of(osm)


@functools.cache
def tee(bearings_deg: tuple[float, ...] = (0.0, 180.0, 270.0), *, left_hand: bool = False) -> World:
    """Arms of 120 m at these bearings, counter-clockwise from east."""
    nodes = {0: (0.0, 0.0)}
    for i, bearing in enumerate(bearings_deg, start=1):
        angle = math.radians(bearing)
        nodes[i] = (120.0 * math.cos(angle), 120.0 * math.sin(angle))
    ways = [
        (10 + i, [i, 0], {"highway": "residential", "name": f"Arm {i}"}) for i in list(nodes)[1:]
    ]
    return world_of(drawn_map(nodes, ways, origin=_origin(left_hand)))


@functools.cache
def after_a_bend(left: float) -> World:
    """A main road from the east that bends by 60° with a radius of 20 m, 18 m before a side road:
    to the left (1.0) or to the right (-1.0) of who comes along."""
    nodes = {0: (0.0, 0.0), 1: (-120.0, 0.0), 2: (0.0, 120.0), 3: (0.0, -120.0)}
    for k in range(13):
        angle = math.radians(5.0 * k)
        back_m, aside_m = 20.0 * math.sin(angle), 20.0 * (1.0 - math.cos(angle))
        nodes[10 + k] = 18.0 + back_m, left * aside_m
    x, y = nodes[22]
    nodes[23] = x + 40.0, y + left * 40.0 * math.sqrt(3.0)
    ways = [(1, [*range(23, 9, -1), 0], ROAD), (2, [0, 1], ROAD), (3, [2, 0, 3], STREET)]
    return world_of(drawn_map(nodes, ways))


@functools.cache
def ring(*, left_hand: bool = False) -> World:
    return world_of(roundabout(origin=_origin(left_hand), clockwise=left_hand))


@functools.cache
def motorway() -> World:
    """Two lanes to the east, a slip road that leaves them, 600 m in all."""
    nodes = {1: (-300.0, 0.0), 2: (0.0, 0.0), 3: (300.0, 0.0), 4: (250.0, -40.0), 5: (60.0, -6.0)}
    tags = {"highway": "motorway", "lanes": "2", "oneway": "yes", "maxspeed": "130"}
    link = {"highway": "motorway_link", "oneway": "yes", "lanes": "1"}
    osm = drawn_map(nodes, [(1, [1, 2, 3], tags), (2, [2, 5, 4], link)])
    return build_region(osm, build_road_graph(osm), osm.bounds)


@functools.cache
def race_track() -> World:
    """An oval, 300 m by 120 m."""
    nodes = {}
    for i in range(48):
        angle = 2 * math.pi * i / 48
        nodes[100 + i] = (
            90.0 * math.copysign(1.0, math.cos(angle)) * (abs(math.cos(angle)) > 1e-9)
            + 60.0 * math.cos(angle),
            60.0 * math.sin(angle),
        )
    way = [*nodes, 100]
    osm = drawn_map(nodes, [(1, way, {"highway": "raceway", "oneway": "yes", "name": "Oval"})])
    return build_region(osm, build_road_graph(osm), osm.bounds)


def _origin(left_hand: bool) -> GeoPoint:
    return IRELAND if left_hand else GERMANY
