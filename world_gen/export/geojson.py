"""A World as GeoJSON (RFC 7946): WGS84, one feature for each thing, each value with its source."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.provenance import Choice, Quantity
from foretwin.contracts.world import World

DEGREE_DIGITS = 9
"""A nanodegree is 0.1 mm: files keep the millimetres of a World."""

Shape = Literal["Point", "LineString", "Polygon"]
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Draft:
    """A feature whose rings (each (N, 2), in the World's frame) are still metres."""

    kind: str
    id: str
    shape: Shape
    rings: tuple[Array, ...]
    properties: Json


def write_geojson(world: World, path: Path) -> None:
    """Write a World as one FeatureCollection; coordinates are longitude, latitude.

    Lengths are metres, angles radians counter-clockwise from east, speeds m/s. A value `x` of the
    map has its source (tagged, inferred or default) in `x_source`. What crosses the antimeridian
    is cut there, as RFC 7946 asks for.
    """
    path.write_bytes(msgspec.json.encode(geojson_of(world)))


def geojson_of(world: World) -> Json:
    """Return the FeatureCollection of `write_geojson` as plain values."""
    drafts = list(_drafts(world))
    rings = [ring for draft in drafts for ring in draft.rings]
    lon_lat = iter(_lon_lat(world.frame, rings))
    features = []
    for draft in drafts:
        geometry = _geometry(draft.shape, [next(lon_lat) for _ in draft.rings])
        features.append(
            {
                "type": "Feature",
                "id": f"{draft.kind}:{draft.id}",
                "geometry": geometry,
                "properties": {"kind": draft.kind, "id": draft.id, **draft.properties},
            }
        )
    origin = world.frame.origin
    return {
        "type": "FeatureCollection",
        "attribution": world.attribution,
        "world": {
            "id": world.id,
            "intersection": msgspec.to_builtins(world.intersection),
            "origin": [origin.lon_deg, origin.lat_deg],
            "radius_m": world.radius_m,
            "map_sha256": world.map_sha256,
            "notes": list(world.notes),
        },
        "features": features,
    }


def _drafts(world: World) -> Iterable[_Draft]:
    yield from _junctions(world)
    yield from _ways(world)
    yield from _control(world)
    for kind, areas in (
        ("road_surface", world.road_surface), ("sidewalk", world.sidewalks),
        ("island", world.islands),
    ):  # fmt: skip
        for area in areas:
            yield _polygon(kind, area.id, area.outline, area.holes, {"source": area.source})
    for building in world.buildings:
        properties = {
            **_valued("height_m", building.height_m), "min_height_m": building.min_height_m
        }  # fmt: skip
        yield _polygon("building", building.id, building.outline, building.holes, properties)


def _junctions(world: World) -> Iterable[_Draft]:
    for junction in world.junctions:
        summary = msgspec.to_builtins(junction.summary)
        properties = {
            "junction_kind": summary.pop("kind"),
            **{key: value for key, value in summary.items() if key not in ("id", "lat", "lon")},
            "arms": [msgspec.to_builtins(arm) for arm in junction.arms],
            "signal_plan": msgspec.to_builtins(junction.plan),
        }
        if junction.area is None:
            at = _local_point(world.frame, junction.summary.lat, junction.summary.lon)
            yield _Draft("junction", junction.summary.id, "Point", (at,), properties)
        else:
            properties["area_source"] = junction.area.source
            yield _polygon(
                "junction", junction.summary.id, junction.area.outline, junction.area.holes,
                properties,
            )  # fmt: skip


def _ways(world: World) -> Iterable[_Draft]:
    for road in world.roads:
        yield _line(
            "road", road.id, road.reference_line,
            {
                "osm_way": road.osm_way, "name": road.name, "road_class": road.road_class,
                "left_m": road.left_m, "right_m": road.right_m, "lane_ids": road.lane_ids,
                "from_place": road.from_place, "to_place": road.to_place, "layer": road.layer,
                "bridge": road.bridge, "tunnel": road.tunnel,
            },
        )  # fmt: skip
    for lane in world.lanes:
        yield _line(
            "lane", lane.id, lane.centerline,
            {
                "osm_way": lane.osm_way, "name": lane.name, "lane_kind": lane.kind,
                "role": lane.role, **_valued("width_m", lane.width_m),
                **_valued("speed_limit_mps", lane.speed_limit_mps),
                "turns": lane.turns, "turns_source": lane.turns_source,
                "direction_source": lane.direction_source,
                "change": lane.change, "change_source": lane.change_source,
                "left_id": lane.left_id, "right_id": lane.right_id, "road_id": lane.road_id,
                "layer": lane.layer, "successor_ids": lane.successor_ids,
            },
        )  # fmt: skip
    for connection in world.connections:
        yield _line(
            "connection", connection.id, connection.centerline,
            {
                "from_lane_id": connection.from_lane_id, "to_lane_id": connection.to_lane_id,
                "turn": connection.turn, **_valued("width_m", connection.width_m),
                "control": connection.control, "conflicts_with": connection.conflicts_with,
                "yields_to": connection.yields_to, "junction_id": connection.junction_id,
                "place_id": connection.place_id, "signal_group_id": connection.signal_group_id,
                "layer": connection.layer,
            },
        )  # fmt: skip


def _control(world: World) -> Iterable[_Draft]:
    for line in world.stop_lines:
        properties = {
            "lane_id": line.lane_id, "connection_id": line.connection_id,
            **_valued("control", line.control),
        }  # fmt: skip
        yield _line("stop_line", line.id, line.ends, properties)
    for crossing in world.crossings:
        yield _line(
            "crossing", crossing.id, crossing.line,
            {
                **_valued("crossing_kind", crossing.kind), **_valued("width_m", crossing.width_m),
                "osm_node": crossing.osm_node, "refuge": crossing.island,
            },
        )  # fmt: skip
    for signal in world.signals:
        yield _Draft(
            "signal", signal.id, "Point", (signal.position[None, :2],),
            {
                "osm_node": signal.osm_node, "group_id": signal.group_id,
                "lane_ids": signal.lane_ids, "height_m": float(signal.position[2]),
                "facing_rad": signal.yaw_rad, "source": signal.source,
            },
        )  # fmt: skip
    for conflict in world.conflicts:
        properties = {
            "first_id": conflict.first_id, "second_id": conflict.second_id,
            "conflict_kind": conflict.kind, "yields_id": conflict.yields_id,
            "rule": conflict.rule, "source": conflict.source,
        }  # fmt: skip
        name = f"{conflict.first_id}|{conflict.second_id}"
        if len(conflict.area) >= 3 and abs(_doubled_area(conflict.area)) > 1e-4:
            yield _polygon("conflict", name, conflict.area, (), properties)
        else:
            yield _Draft("conflict", name, "Point", (conflict.point[None, :],), properties)


def _valued(name: str, value: Quantity | Choice) -> Json:
    return {name: value.value, f"{name}_source": value.source}


def _line(kind: str, name: str, points: Array, properties: Json) -> _Draft:
    return _Draft(kind, name, "LineString", (points,), properties)


def _polygon(
    kind: str, name: str, outline: Array, holes: Sequence[Array], properties: Json
) -> _Draft:
    """Close the rings, counter-clockwise outside and clockwise inside (RFC 7946, section 3.1.6)."""
    rings = [_turned(outline, 1.0), *(_turned(hole, -1.0) for hole in holes)]
    closed = tuple(np.concatenate([ring, ring[:1]]) for ring in rings)
    return _Draft(kind, name, "Polygon", closed, properties)


def _turned(ring: Array, sign: float) -> Array:
    return ring if _doubled_area(ring) * sign > 0.0 else ring[::-1]


def _doubled_area(ring: Array) -> float:
    ahead = np.roll(ring, -1, axis=0)
    return float((ring[:, 0] * ahead[:, 1] - ahead[:, 0] * ring[:, 1]).sum())


def _local_point(frame: LocalFrame, lat: float, lon: float) -> Array:
    return local_from_geo(frame, np.array([lat]), np.array([lon]))


def _lon_lat(frame: LocalFrame, rings: Sequence[Array]) -> list[Array]:
    """Convert all rings at once; longitudes go on past 180 degrees where the World does."""
    if not rings:
        return []
    geo = geo_from_local(frame, np.concatenate(rings))
    around = frame.origin.lon_deg
    lon = around + (geo[:, 1] - around + 180.0) % 360.0 - 180.0
    lon_lat = np.round(np.stack([lon, geo[:, 0]], axis=-1), DEGREE_DIGITS)
    return np.split(lon_lat, np.cumsum([len(ring) for ring in rings])[:-1])


def _geometry(shape: Shape, rings: list[Array]) -> Json:
    west = min(float(ring[:, 0].min()) for ring in rings)
    east = max(float(ring[:, 0].max()) for ring in rings)
    if west < -180.0 or east > 180.0:
        return _cut(shape, rings)
    if shape == "Point":
        return {"type": shape, "coordinates": rings[0][0].tolist()}
    if shape == "LineString":
        return {"type": shape, "coordinates": rings[0].tolist()}
    return {"type": shape, "coordinates": [ring.tolist() for ring in rings]}


def _cut(shape: Shape, rings: list[Array]) -> Json:
    """Cut a geometry at the antimeridian and bring its parts back to within 180 degrees."""
    if shape == "Point":
        lon, lat = rings[0][0].tolist()
        return {"type": shape, "coordinates": [(lon + 180.0) % 360.0 - 180.0, lat]}
    whole: shapely.Geometry = (
        shapely.LineString(rings[0])
        if shape == "LineString"
        else shapely.make_valid(shapely.Polygon(rings[0], rings[1:]))
    )
    parts: list[Any] = []
    for turn in (-360.0, 0.0, 360.0):
        piece = whole.intersection(shapely.box(turn - 180.0, -90.0, turn + 180.0, 90.0))
        for part in shapely.get_parts(piece):
            if part.is_empty or part.geom_type != shape:
                continue
            moved = shapely.transform(part, lambda xy, turn=turn: xy - [turn, 0.0])
            if shape == "Polygon":
                moved = shapely.orient_polygons(moved)
            parts.append(shapely.geometry.mapping(moved)["coordinates"])
    return {"type": f"Multi{shape}", "coordinates": parts}
