"""A World as SDFormat 1.7, the newest that Gazebo Classic reads; Gazebo reads it too.

All buildings are shapes of one static link: as models of their own, 800 of them take seven times
as long and as much memory to load. The ground alone is driven on; road, sidewalks, markings and
signals are seen and never touched.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Area, World
from foretwin.world_gen.export.choices import SIMULATORS, Simulator
from foretwin.world_gen.export.sdformat_plugins import HEADING_DEG, world_plugins
from foretwin.world_gen.export.sdformat_shapes import (
    Element,
    StaticLink,
    child,
    extrusions,
    numbers,
)
from foretwin.world_gen.export.sdformat_vehicles import SdfVehicle, add_vehicle
from foretwin.world_gen.export.solids import (
    BUILDING,
    GROUND,
    ISLAND,
    ROAD,
    ROAD_TOP_M,
    THINNEST_M,
    Rgba,
    island_height_m,
    stops_cars,
)
from foretwin.world_gen.export.xml_tree import in_comment

SDF_VERSION = "1.7"
NAMESPACE = "urn:foretwin:sdformat"
"""Of our own elements, which SDFormat lets pass and keeps because they have a namespace."""
MARKING_TOP_M, SIDEWALK_TOP_M = 0.02, 0.03
BUILDING_TOLERANCE_M, AREA_TOLERANCE_M = 0.1, 0.02
STOP_LINE_WIDTH_M, YIELD_LINE_WIDTH_M = 0.5, 0.3
STEP_S = 0.002

_SIDEWALK: Rgba = (0.62, 0.61, 0.58, 1.0)
_PAINT: Rgba = (0.92, 0.92, 0.9, 1.0)
_CROSSING: Rgba = (0.8, 0.8, 0.74, 1.0)
_SIGNAL: Rgba = (0.1, 0.1, 0.1, 1.0)
_LAMPS: tuple[tuple[str, Rgba], ...] = (
    ("red", (0.85, 0.1, 0.1, 1.0)),
    ("amber", (0.9, 0.65, 0.1, 1.0)),
    ("green", (0.1, 0.7, 0.3, 1.0)),
)


def write_sdf(
    world: World,
    path: Path,
    *,
    simulator: Simulator = "classic",
    vehicles: Sequence[SdfVehicle] = (),
) -> None:
    """Write a World, and vehicles in it, for Gazebo Classic with ROS 2 or for Gazebo.

    Coordinates are the World's; `<spherical_coordinates>` has its origin. Raises ValueError for
    an unknown simulator and for vehicles whose names are not their own.
    """
    if simulator not in SIMULATORS:
        raise ValueError(f"simulator {simulator!r}: one of {', '.join(SIMULATORS)}")
    _check_names(vehicles)
    root = etree.Element("sdf", version=SDF_VERSION)
    element = child(root, "world", name=f"world_{world.id or 'unnamed'}")
    attribution = etree.SubElement(
        element, f"{{{NAMESPACE}}}attribution", nsmap={"foretwin": NAMESPACE}
    )
    attribution.text = world.attribution
    _surroundings(element, world, simulator)
    _road(element, world)
    _markings(element, world)
    _signals(element, world)
    _buildings(element, world)
    for vehicle in vehicles:
        add_vehicle(element, vehicle, simulator)
    place = world.intersection
    about = f" {world.attribution}; world {world.id}, {place.kind} {place.name} ({place.id}) "
    root.insert(0, etree.Comment(in_comment(about)))
    tree = etree.ElementTree(root)
    etree.indent(tree, space=" ")
    with path.open("wb") as file:  # lxml would not say which file cannot be written
        tree.write(file, xml_declaration=True, encoding="utf-8")


def _check_names(vehicles: Sequence[SdfVehicle]) -> None:
    taken = {"ground", "road", "markings", "signals", "buildings"}
    for vehicle in vehicles:
        if not vehicle.name.isidentifier() or vehicle.name.startswith("__"):
            raise ValueError(f"vehicle name {vehicle.name!r}: letters, digits and _ alone")
        if vehicle.name in taken:
            raise ValueError(f"vehicle name {vehicle.name!r} is taken")
        taken.add(vehicle.name)


def _surroundings(element: Element, world: World, simulator: Simulator) -> None:
    physics = child(element, "physics", type="ode")
    child(physics, "max_step_size", numbers(STEP_S))
    child(physics, "real_time_factor", "1")
    child(physics, "real_time_update_rate", numbers(1 / STEP_S))
    world_plugins(element, simulator)
    scene = child(element, "scene")
    child(scene, "ambient", "0.5 0.5 0.5 1")
    child(scene, "background", "0.7 0.8 0.9 1")
    child(scene, "shadows", "0")
    where = child(element, "spherical_coordinates")
    child(where, "surface_model", "EARTH_WGS84")
    child(where, "world_frame_orientation", "ENU")
    child(where, "latitude_deg", numbers(world.frame.origin.lat_deg, digits=9))
    child(where, "longitude_deg", numbers(world.frame.origin.lon_deg, digits=9))
    child(where, "elevation", numbers(world.frame.origin.alt_m))
    child(where, "heading_deg", HEADING_DEG[simulator])
    sun = child(element, "light", name="sun", type="directional")
    child(sun, "pose", "0 0 200 0 0 0")
    child(sun, "diffuse", "0.8 0.8 0.8 1")
    child(sun, "specular", "0.1 0.1 0.1 1")
    child(sun, "direction", "0.3 0.2 -1")
    _ground(element, world)


def _ground(element: Element, world: World) -> None:
    model = child(element, "model", name="ground")
    child(model, "static", "1")
    link = child(model, "link", name="link")
    for tag in ("collision", "visual"):
        part = child(link, tag, name=f"plane.{tag}")
        shape = child(child(part, "geometry"), "plane")
        child(shape, "normal", "0 0 1")
        child(shape, "size", numbers(2 * world.radius_m, 2 * world.radius_m))
        if tag == "visual":
            paint = child(part, "material")
            child(paint, "ambient", numbers(*GROUND))
            child(paint, "diffuse", numbers(*GROUND))


def _road(element: Element, world: World) -> None:
    link = StaticLink(element, "road")
    for area in world.road_surface:
        _area(link, area, ROAD_TOP_M, ROAD)
    for area in world.sidewalks:
        _area(link, area, SIDEWALK_TOP_M, _SIDEWALK)
    for island in world.islands:
        solid = stops_cars(island)
        _area(link, island, island_height_m(solid=solid), ISLAND, solid=solid)


def _area(link: StaticLink, area: Area, top_m: float, rgba: Rgba, *, solid: bool = False) -> None:
    rings = extrusions(area.outline, area.holes, tolerance_m=AREA_TOLERANCE_M)
    for number, ring in enumerate(rings):
        link.prism(f"{area.id}.{number}", ring, 0.0, top_m, rgba=rgba, solid=solid)


def _markings(element: Element, world: World) -> None:
    link = StaticLink(element, "markings")
    for line in world.stop_lines:
        if line.control.value != "none":
            wide = YIELD_LINE_WIDTH_M if line.control.value == "give_way" else STOP_LINE_WIDTH_M
            _stripe(link, line.id, line.ends, wide, _PAINT)
    for crossing in world.crossings:
        _stripe(link, crossing.id, crossing.line, crossing.width_m.value, _CROSSING)


def _stripe(link: StaticLink, name: str, ends: Array, width_m: float, rgba: Rgba) -> None:
    along = ends[1] - ends[0]
    middle, long = ends.mean(axis=0), float(np.hypot(*along))
    if long < 0.05:
        return
    link.box(
        name,
        (middle[0], middle[1], MARKING_TOP_M / 2),
        (long, width_m, MARKING_TOP_M),
        yaw_rad=math.atan2(along[1], along[0]),
        rgba=rgba,
    )


def _signals(element: Element, world: World) -> None:
    link = StaticLink(element, "signals")
    for signal in world.signals:
        x, y, z = (float(v) for v in signal.position)
        facing = np.array([math.cos(signal.yaw_rad), math.sin(signal.yaw_rad)])
        link.cylinder(f"{signal.id}.pole", (x, y, z / 2), 0.06, z, rgba=_SIGNAL)
        link.box(
            f"{signal.id}.head", (x, y, z), (0.2, 0.35, 0.95), yaw_rad=signal.yaw_rad, rgba=_SIGNAL
        )
        for number, (lamp, rgba) in enumerate(_LAMPS):
            at = np.array([x, y]) + 0.11 * facing
            link.box(
                f"{signal.id}.{lamp}",
                (at[0], at[1], z + 0.3 * (1 - number)),
                (0.03, 0.2, 0.2),
                yaw_rad=signal.yaw_rad,
                rgba=rgba,
            )


def _buildings(element: Element, world: World) -> None:
    link = StaticLink(element, "buildings")
    for building in world.buildings:
        low, high = building.min_height_m, building.height_m.value
        if high - low < THINNEST_M:
            continue
        rings = extrusions(building.outline, building.holes, tolerance_m=BUILDING_TOLERANCE_M)
        for number, ring in enumerate(rings):
            link.prism(f"{building.id}.{number}", ring, low, high, rgba=BUILDING, solid=True)
