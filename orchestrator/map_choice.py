"""What a command asks of a map: one junction by id or place, those along a line, or a region."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contracts.errors import UserError
from contracts.frames import local_from_geo
from world_gen.build_graph import build_road_graph
from world_gen.find_intersections import find_intersections
from world_gen.intersections import Junction
from world_gen.osm_map import LatLonBounds, OsmMap
from world_gen.read_osm import read_map
from world_gen.road_graph import RoadGraph

FARTHEST_M = 200.0
"""A place farther than this from every junction names none."""


@dataclass(frozen=True, slots=True)
class OpenMap:
    """A map that was read, its roads, and its junctions by id."""

    file: Path
    osm: OsmMap
    graph: RoadGraph
    junctions: tuple[Junction, ...]


def open_map(file: Path) -> OpenMap:
    """Read a map and find its junctions."""
    osm = read_map(file)
    graph = build_road_graph(osm)
    return OpenMap(file, osm, graph, find_intersections(osm, graph))


def junction_by_id(opened: OpenMap, junction_id: str) -> Junction:
    """Return the junction of that id; UserError where there is none."""
    for junction in opened.junctions:
        if junction.summary.id == junction_id:
            return junction
    raise UserError(
        f"--id {junction_id}: {opened.file} holds no such intersection; "
        f"`foretwin intersections {opened.file}` lists its {len(opened.junctions)}"
    )


def nearest_junction(opened: OpenMap, at: str) -> Junction:
    """Return the junction nearest to LAT,LON; UserError where that is no place near one."""
    lat, lon = _degrees("--at", at, "two numbers, LAT,LON", 2)
    if not -90.0 <= lat <= 90.0 or not -180.0 <= lon <= 180.0:
        raise UserError(f"--at {at}: latitude -90 to 90, then longitude -180 to 180")
    if not opened.junctions:
        raise UserError(f"{opened.file}: no intersection in this map")
    here = local_from_geo(opened.osm.frame, lat, lon)
    away = [float(np.hypot(*(j.centre_xy_m - here))) for j in opened.junctions]
    best = int(np.argmin(away))
    if not away[best] <= FARTHEST_M:
        raise UserError(
            f"--at {at}: the nearest intersection of {opened.file} is {away[best]:.0f} m away"
        )
    return opened.junctions[best]


def junctions_along(opened: OpenMap, route: Path) -> tuple[Junction, ...]:
    """Return the junctions along a GPX or GeoJSON line in driving order, once per passage."""
    from orchestrator.line_matching import match_line
    from telemetry.logs import read_line
    from world_gen.route_junctions import junctions_on_route

    line = read_line(route)
    lat_lon_deg = np.stack([line.lat_deg, line.lon_deg], axis=-1)
    matched = match_line(opened.graph, lat_lon_deg, name=f"--route {route}")
    return tuple(
        passage.junction
        for stretch in matched.routes
        for passage in junctions_on_route(opened.junctions, stretch.edges)
    )


def bounds_of(opened: OpenMap, bbox: str) -> LatLonBounds:
    """Return W,S,E,N as bounds that the map reaches into; UserError says what else they are."""
    bounds = parse_bbox("--bbox", bbox)
    have = opened.osm.bounds
    if (
        bounds.east <= have.west or bounds.west >= have.east
        or bounds.north <= have.south or bounds.south >= have.north
    ):  # fmt: skip
        raise UserError(
            f"--bbox {bbox}: outside {opened.file}, which spans {have.west:.5f},{have.south:.5f},"
            f"{have.east:.5f},{have.north:.5f}"
        )
    return bounds


def parse_bbox(option: str, bbox: str) -> LatLonBounds:
    """Return bounds from W,S,E,N in degrees; UserError where they enclose nothing."""
    west, south, east, north = _degrees(option, bbox, "four numbers, W,S,E,N in degrees", 4)
    if not (-180.0 <= west <= 180.0 and -180.0 <= east <= 180.0):
        raise UserError(f"{option} {bbox}: longitudes (first and third) are -180 to 180")
    if not (-90.0 <= south <= 90.0 and -90.0 <= north <= 90.0):
        raise UserError(f"{option} {bbox}: latitudes (second and fourth) are -90 to 90")
    if west >= east:
        raise UserError(
            f"{option} {bbox}: west must be less than east (W,S,E,N); a box across the "
            "antimeridian is to be asked for in two parts"
        )
    if south >= north:
        raise UserError(f"{option} {bbox}: south must be less than north (W,S,E,N)")
    return LatLonBounds(south=south, west=west, north=north, east=east)


def _degrees(option: str, text: str, wanted: str, count: int) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"{option} {text}: {wanted}") from None
    if len(values) != count or not np.isfinite(values).all():
        raise UserError(f"{option} {text}: {wanted}")
    return values
