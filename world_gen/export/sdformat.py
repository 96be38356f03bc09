"""A World as SDFormat 1.7, the newest that Gazebo Classic reads; Gazebo reads it too.

All buildings are shapes of one static link: as models of their own, 800 of them take seven times
as long and as much memory to load. The ground alone is driven on; road, sidewalks, markings and
signals are seen and never touched.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building
from foretwin.contracts.world import Area, World
from foretwin.geometry.world_heights import WorldHeights, heights_of, standing
from foretwin.world_gen.export import solids
from foretwin.world_gen.export.choices import SIMULATORS, Simulator
from foretwin.world_gen.export.roofs import eaves_m, roofs_mesh
from foretwin.world_gen.export.sdformat_hills import MeshModel, add_hills, add_mesh_model
from foretwin.world_gen.export.sdformat_plugins import HEADING_DEG, world_plugins
from foretwin.world_gen.export.sdformat_shapes import StaticLink, extrusions, numbers, shaped
from foretwin.world_gen.export.sdformat_vehicles import SdfVehicle, add_vehicle
from foretwin.world_gen.export.solids import Rgba
from foretwin.world_gen.export.xml_tree import (
    Element,
    child,
    document,
    element,
    in_comment,
    leaves,
    legal,
)

SDF_VERSION = "1.7"
NAMESPACE = "urn:foretwin:sdformat"
"""Of our own elements, which SDFormat lets pass and keeps because they have a namespace."""
BUILDING_TOLERANCE_M, AREA_TOLERANCE_M = 0.1, 0.02
STEP_S = 0.002

_SIGNAL: Rgba = (0.1, 0.1, 0.1, 1.0)
_LAMPS: tuple[tuple[str, Rgba], ...] = (
    ("red", (0.85, 0.1, 0.1, 1.0)),
    ("amber", (0.9, 0.65, 0.1, 1.0)),
    ("green", (0.1, 0.7, 0.3, 1.0)),
)
_SCENE = {"ambient": "0.5 0.5 0.5 1", "background": "0.7 0.8 0.9 1", "shadows": "0"}
_SUN = {
    "pose": "0 0 200 0 0 0",
    "diffuse": "0.8 0.8 0.8 1",
    "specular": "0.1 0.1 0.1 1",
    "direction": "0.3 0.2 -1",
}


def write_sdf(
    world: World,
    path: Path,
    *,
    simulator: Simulator = "classic",
    vehicles: Sequence[SdfVehicle] = (),
) -> None:
    """Write a World, and vehicles in it, for Gazebo Classic with ROS 2 or for Gazebo.

    Where the World has heights, ground, roads and what is painted on them lie beside the file as
    meshes of their own, which it names; so do roofs that are not flat.
    Coordinates are the World's; `<spherical_coordinates>` has its origin. Raises ValueError for
    an unknown simulator and for vehicles whose names are not their own.
    """
    if simulator not in SIMULATORS:
        raise ValueError(f"simulator {simulator!r}: one of {', '.join(SIMULATORS)}")
    hills = heights_of(world)
    _check_names(vehicles, hilly=hills is not None)
    root = element("sdf", version=SDF_VERSION)
    place = world.intersection
    about = f" {world.attribution}; world {world.id}, {place.kind} {place.name} ({place.id}) "
    root.append(etree.Comment(in_comment(about)))
    made = child(root, "world", name=f"world_{world.id or 'unnamed'}")
    attribution = f"{{{NAMESPACE}}}attribution"
    etree.SubElement(made, attribution, nsmap={"foretwin": NAMESPACE}).text = legal(
        world.attribution
    )
    _surroundings(made, world, simulator, flat=hills is None)
    if hills is None:
        _road(made, world)
        _markings(made, world)
    else:
        add_hills(made, world, hills, path)
    _signals(made, world, hills)
    _buildings(made, world, hills, path)
    _obstacles(made, world, hills)
    for vehicle in vehicles:
        add_vehicle(made, vehicle, simulator)
    etree.indent(root, space=" ")
    path.write_bytes(document(root))


def _check_names(vehicles: Sequence[SdfVehicle], *, hilly: bool) -> None:
    taken = {"ground", "road", "markings", "signals", "buildings", "roofs", "obstacles"}
    if hilly:
        taken |= {"sidewalks", "mounds", "islands", "crossings"}
    for vehicle in vehicles:
        if not vehicle.name.isidentifier() or vehicle.name.startswith("__"):
            raise ValueError(f"vehicle name {vehicle.name!r}: letters, digits and _ alone")
        if vehicle.name in taken:
            raise ValueError(f"vehicle name {vehicle.name!r} is taken")
        taken.add(vehicle.name)


def _surroundings(made: Element, world: World, simulator: Simulator, *, flat: bool) -> None:
    rate = {"max_step_size": numbers(STEP_S), "real_time_factor": "1"}
    rate["real_time_update_rate"] = numbers(1 / STEP_S)
    leaves(child(made, "physics", type="ode"), rate)
    world_plugins(made, simulator)
    leaves(child(made, "scene"), _SCENE)
    origin = world.frame.origin
    known = world.elevation
    base_m = 0.0 if isinstance(known, msgspec.UnsetType) else known.base_m
    where = {
        "surface_model": "EARTH_WGS84",
        "world_frame_orientation": "ENU",
        "latitude_deg": numbers(origin.lat_deg, digits=9),
        "longitude_deg": numbers(origin.lon_deg, digits=9),
        "elevation": numbers(origin.alt_m + base_m),
        "heading_deg": HEADING_DEG[simulator],
    }
    leaves(child(made, "spherical_coordinates"), where)
    leaves(child(made, "light", name="sun", type="directional"), _SUN)
    if not flat:
        return
    ground = child(made, "model", name="ground")
    child(ground, "static", "1")
    link = child(ground, "link", name="link")
    plane = [("normal", "0 0 1"), ("size", numbers(2 * world.radius_m, 2 * world.radius_m))]
    shaped(child(link, "collision", name="plane.collision"), "plane", plane)
    shaped(child(link, "visual", name="plane.visual"), "plane", plane, rgba=solids.GROUND)


def _road(made: Element, world: World) -> None:
    link = StaticLink(made, "road")
    for area in world.road_surface:
        _area(link, area, solids.ROAD_TOP_M, solids.ROAD)
    for area in world.sidewalks:
        _area(link, area, solids.SIDEWALK_TOP_M, solids.SIDEWALK)
    for island in world.islands:
        solid = solids.stops_cars(island)
        _area(link, island, solids.island_height_m(solid=solid), solids.ISLAND, solid=solid)


def _area(link: StaticLink, area: Area, top_m: float, rgba: Rgba, *, solid: bool = False) -> None:
    rings = extrusions(area.outline, area.holes, tolerance_m=AREA_TOLERANCE_M)
    for number, ring in enumerate(rings):
        link.prism(f"{area.id}.{number}", ring, (0.0, top_m), rgba, solid=solid)


def _markings(made: Element, world: World) -> None:
    link = StaticLink(made, "markings")
    for line in world.stop_lines:
        if line.control.value != "none":
            yields = line.control.value == "give_way"
            wide = solids.YIELD_LINE_M if yields else solids.STOP_LINE_M
            _stripe(link, line.id, line.ends, wide, solids.PAINT)
    for crossing in world.crossings:
        _stripe(link, crossing.id, crossing.line, crossing.width_m.value, solids.CROSSING)


def _stripe(link: StaticLink, name: str, ends: Array, width_m: float, rgba: Rgba) -> None:
    along = ends[1] - ends[0]
    middle, long = ends.mean(axis=0), float(np.hypot(*along))
    if long < solids.SHORTEST_STRIPE_M:
        return
    at = (*middle, solids.MARKING_TOP_M / 2, math.atan2(along[1], along[0]))
    link.box(name, at, (long, width_m, solids.MARKING_TOP_M), rgba)


def _signals(made: Element, world: World, hills: WorldHeights | None) -> None:
    link = StaticLink(made, "signals")
    for signal in world.signals:
        x, y, z = (float(v) for v in signal.position)
        foot = 0.0 if hills is None else float(hills.surface_at(signal.position[None, :2])[0])
        yaw = signal.yaw_rad
        link.cylinder(f"{signal.id}.pole", (x, y, foot + z / 2), 0.06, z, _SIGNAL)
        z += foot
        link.box(f"{signal.id}.head", (x, y, z, yaw), (0.2, 0.35, 0.95), _SIGNAL)
        front = x + 0.11 * math.cos(yaw), y + 0.11 * math.sin(yaw)
        for number, (lamp, rgba) in enumerate(_LAMPS):
            at = (*front, z + 0.3 * (1 - number), yaw)
            link.box(f"{signal.id}.{lamp}", at, (0.03, 0.2, 0.2), rgba)


def _buildings(made: Element, world: World, hills: WorldHeights | None, path: Path) -> None:
    link = StaticLink(made, "buildings")
    lifted: list[tuple[Building, float]] = []
    for building in world.buildings:
        walls = eaves_m(building)
        if walls - building.min_height_m < solids.THINNEST_M:
            continue
        low, high = standing(hills, building.outline, building.min_height_m, walls)
        lifted.append((building, high - walls))
        rings = extrusions(building.outline, building.holes, tolerance_m=BUILDING_TOLERANCE_M)
        for number, ring in enumerate(rings):
            link.prism(f"{building.id}.{number}", ring, (low, high), solids.BUILDING, solid=True)
    add_mesh_model(made, MeshModel("roofs", roofs_mesh(lifted), solids.ROOF), world, path)


def _obstacles(made: Element, world: World, hills: WorldHeights | None) -> None:
    if not world.obstacles:
        return
    link = StaticLink(made, "obstacles")
    for one in world.obstacles:
        rings = extrusions(one.outline, one.holes, tolerance_m=solids.THINNEST_M)
        for number, ring in enumerate(rings):
            name = f"{one.kind}.{one.id}.{number}"
            reach = standing(hills, ring, 0.0, one.height_m.value)
            link.prism(name, ring, reach, solids.OBSTACLE, solid=True)
