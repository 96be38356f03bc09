"""The commands that look at maps: `intersections` and `world`."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from contracts.errors import UserError
from contracts.frames import local_from_geo
from world_gen.build_graph import build_road_graph
from world_gen.find_intersections import find_intersections
from world_gen.intersections import Junction
from world_gen.osm_map import OsmMap
from world_gen.read_osm import read_map
from world_gen.road_graph import RoadGraph

FORMATS = ("mjcf", "png")
FARTHEST_M = 200.0
"""A place farther than this from every junction names none."""


def list_intersections(map_file: Path, *, route: Path | None, as_json: bool) -> None:
    """Print the junctions of a map, or those along a line, in driving order."""
    osm = read_map(map_file)
    graph = build_road_graph(osm)
    junctions: tuple[Junction, ...] = find_intersections(osm, graph)
    if route is not None:
        junctions = _along(graph, junctions, route)
    else:
        junctions = tuple(sorted(junctions, key=lambda j: j.summary.id))
    if as_json:
        body = msgspec.json.encode([j.summary for j in junctions])
        print(msgspec.json.format(body, indent=1).decode())
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("id", "kind", "control", "arms", "lat", "lon", "name", title=str(map_file))
    for junction in junctions:
        s = junction.summary
        table.add_row(s.id, s.kind, s.control, str(s.arms), f"{s.lat:.6f}", f"{s.lon:.6f}", s.name)
    Console().print(table)


def _along(graph: RoadGraph, junctions: tuple[Junction, ...], route: Path) -> tuple[Junction, ...]:
    from orchestrator.line_matching import match_line
    from telemetry.logs import read_line
    from world_gen.route_junctions import junctions_on_route

    line = read_line(route)
    lat_lon_deg = np.stack([line.lat_deg, line.lon_deg], axis=-1)
    matched = match_line(graph, lat_lon_deg, name=f"--route {route}")
    return tuple(
        passage.junction
        for stretch in matched.routes
        for passage in junctions_on_route(junctions, stretch.edges)
    )


def write_world(
    map_file: Path, *, at: str | None, junction_id: str | None, radius_m: float, file_format: str,
    out: Path,
) -> None:  # fmt: skip
    """Build the World of one junction and write it; the folder of `out` must exist."""
    if file_format not in FORMATS:
        raise UserError(f"--format {file_format}: one of {', '.join(FORMATS)}")
    if (at is None) == (junction_id is None):
        raise UserError("name the junction by either --at LAT,LON or --id ID")
    if not 20.0 <= radius_m <= 2000.0:
        raise UserError(f"--radius {radius_m}: 20 to 2000 metres")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: folder {out.parent} does not exist")
    osm = read_map(map_file)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    if junction_id is not None:
        junction = _by_id(junctions, junction_id, map_file)
    else:
        junction = _nearest(osm, junctions, at or "", map_file)
    from world_gen.build import build_world
    from world_gen.map_index import index_map

    index = index_map(osm, graph, junctions)
    world = build_world(osm, graph, junction, radius_m=radius_m, index=index)
    if file_format == "png":
        from world_gen.export.picture import write_picture

        write_picture(world, out)
    else:
        from world_gen.export.mjcf import write_mjcf

        write_mjcf(world, out)
    s = junction.summary
    print(f"{out}: {s.kind} {s.name or s.id} ({s.id}), {len(world.lanes)} lanes, "
          f"{len(world.buildings)} buildings. {world.attribution}")  # fmt: skip


def _by_id(junctions: tuple[Junction, ...], junction_id: str, map_file: Path) -> Junction:
    for junction in junctions:
        if junction.summary.id == junction_id:
            return junction
    raise UserError(
        f"--id {junction_id}: {map_file} holds no such intersection; "
        f"`foretwin intersections {map_file}` lists its {len(junctions)}"
    )


def _nearest(osm: OsmMap, junctions: tuple[Junction, ...], at: str, map_file: Path) -> Junction:
    try:
        lat, lon = (float(part) for part in at.split(","))
    except ValueError:
        raise UserError(f"--at {at}: two numbers, LAT,LON") from None
    if not junctions:
        raise UserError(f"{map_file}: no intersection in this map")
    here = local_from_geo(osm.frame, lat, lon)
    away = [float(np.hypot(*(j.centre_xy_m - here))) for j in junctions]
    best = int(np.argmin(away))
    if not away[best] <= FARTHEST_M:
        raise UserError(
            f"--at {at}: the nearest intersection of {map_file} is {away[best]:.0f} m away"
        )
    return junctions[best]
