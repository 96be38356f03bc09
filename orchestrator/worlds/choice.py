"""What a command asks of a map: one junction by id or place, those along a line, or a region."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, local_from_geo
from foretwin.contracts.terminal import command_line, say
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.opening import Clip, NodeClip, OpenMap
from foretwin.world_gen.osm.osm_map import LatLonBounds

_JUNCTION_ID = re.compile(r"n-?\d{1,18}", re.ASCII)
FARTHEST_M = 200.0
"""A place farther than this from every junction names none."""


def junction_by_id(opened: OpenMap, junction_id: str) -> Junction:
    """Return the junction of that id; UserError where there is none."""
    for junction in opened.junctions:
        if junction.summary.id == junction_id:
            return junction
    raise UserError(
        f"{junction_id}: {opened.file} holds no such intersection; "
        f"`{command_line('intersections', opened.file)}` lists all"
    )


def node_of_id(junction_id: str) -> int:
    """Return the node that a junction is named by; UserError where no junction is named so."""
    if not _JUNCTION_ID.fullmatch(junction_id):
        raise UserError(
            f"{junction_id}: intersections are named n and a number, as n25; "
            "`foretwin intersections MAP` lists all"
        )
    return int(junction_id[1:])


def nearest_junction(opened: OpenMap, lat: float, lon: float) -> Junction:
    """Return the junction nearest to a place; UserError where there is none near it."""
    if not opened.junctions:
        raise UserError(f"{opened.file}: no intersection in this map")
    GeoPoint(lat, lon).validate()
    away_m = _away_m(opened, lat, lon)
    best = int(np.argmin(away_m))
    if not away_m[best] <= FARTHEST_M:
        turned = abs(lon) <= 90.0 and _away_m(opened, lon, lat).min() <= FARTHEST_M
        raise UserError(
            f"{lat},{lon}: the nearest intersection of {opened.file} is "
            f"{away_m[best]:.0f} m away, more than {FARTHEST_M:.0f}"
            + (f"; latitude comes first: {lon},{lat}?" if turned else "")
        )
    return opened.junctions[best]


def _away_m(opened: OpenMap, lat: float, lon: float) -> Array:
    """Return how far each junction is from a place, (J,)."""
    here = local_from_geo(opened.osm.frame, lat, lon)
    return np.array([np.hypot(*(j.centre_xy_m - here)) for j in opened.junctions])


def parse_place(at: str) -> tuple[float, float]:
    """Return latitude and longitude of LAT,LON; UserError where they are none."""
    lat, lon = _degrees("--at", at, "two numbers, LAT,LON", 2)
    if not -90.0 <= lat <= 90.0 or not -180.0 <= lon <= 180.0:
        raise UserError(f"--at {at}: latitude -90 to 90, then longitude -180 to 180")
    return lat, lon


def read_route(route: Path) -> Array:
    """Return a GPX or GeoJSON line as (N, 2) latitudes and longitudes in degrees.

    Where its file holds others, and none was chosen, a line on stderr says so.
    """
    from foretwin.telemetry.logs import read_line

    line = read_line(route)
    if line.passed_over:
        text = f"{route} holds {1 + line.passed_over} lines: the first is the route"
        say(f"{text}; {route.name}#1 would be the second", error=True)
    return line.lat_lon_deg


class ChosenJunctions(NamedTuple):
    """Junctions that a command is about, in its order, and the map they are of."""

    opened: OpenMap
    junctions: tuple[Junction, ...]


def choose_junctions(
    map_file: Path,
    *,
    at: str | None = None,
    junction_id: str | None = None,
    route: Path | None = None,
    radius_m: float = 0.0,
    service_roads: bool = False,
) -> ChosenJunctions:
    """Open as much of a map as is needed, and choose one junction by a place or id, those along a
    route in driving order, once per passage, or else all by their ids.

    Of a large map, what lies within `radius_m` is read. Raises UserError where there is none.
    """
    clip: Clip | NodeClip | None = None
    if at is not None:
        place = parse_place(at)
        clip = Clip(np.array([place]), radius_m + FARTHEST_M)
    elif junction_id is not None:
        clip = NodeClip(node_of_id(junction_id), radius_m)
    elif route is not None:
        line_deg = read_route(route)
        clip = Clip(line_deg, radius_m)
    opened = open_map(map_file, clip=clip, service_roads=service_roads, tides=route is None)
    if at is not None:
        return ChosenJunctions(opened, (nearest_junction(opened, *place),))
    if junction_id is not None:
        return ChosenJunctions(opened, (junction_by_id(opened, junction_id),))
    if route is not None:
        return junctions_along(opened, route, line_deg)
    everything = sorted(opened.junctions, key=lambda junction: junction.summary.id)
    return ChosenJunctions(opened, tuple(everything))


def junctions_along(opened: OpenMap, route: Path, line_deg: Array) -> ChosenJunctions:
    """Return the junctions along a route's line; the service roads that it uses count there."""
    from foretwin.orchestrator.routing.line_matching import match_line
    from foretwin.world_gen.junctions.intersections import junctions_on_route
    from foretwin.world_gen.roads.service_roads import open_service_roads

    matched = match_line(opened.graph, line_deg, name=f"--route {route}")
    used = [item for stretch in matched.routes for item in stretch.edges]
    opened = opened.with_roads(open_service_roads(item.edge for item in used))
    opened = opened.with_tides([item.key for item in used])
    junctions = tuple(
        passage.junction
        for stretch in matched.routes
        for passage in junctions_on_route(opened.junctions, stretch.edges)
    )
    return ChosenJunctions(opened, junctions)


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
