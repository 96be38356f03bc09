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
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.world_heights import heights_of

DEGREE_DIGITS = 9
"""A nanodegree is 0.1 mm: files keep the millimetres of a World."""

FIELDS = {
    "road": "osm_way name road_class left_m right_m lane_ids from_place to_place layer bridge "
    "tunnel",
    "lane": "osm_way name kind:lane_kind role width_m speed_limit_mps turns turns_source "
    "direction_source change change_source left_id right_id road_id layer successor_ids "
    "position_source",
    "connection": "from_lane_id to_lane_id turn width_m control conflicts_with yields_to "
    "junction_id place_id signal_group_id layer path_source red_after_stop",
    "stop_line": "lane_id connection_id control",
    "crossing": "kind:crossing_kind width_m osm_node island:refuge",
    "signal": "osm_node group_id lane_ids",
    "conflict": "first_id second_id kind:conflict_kind yields_id rule source",
    "building": "height_m min_height_m",
    "obstacle": "kind:obstacle_kind height_m",
    "road_surface": "source",
    "sidewalk": "source",
    "island": "source",
}
"""The fields of each kind of thing, in the order of the file; after a colon its name there."""
_LINES = {
    "road": ("roads", "reference_line"),
    "lane": ("lanes", "centerline"),
    "connection": ("connections", "centerline"),
    "stop_line": ("stop_lines", "ends"),
    "crossing": ("crossings", "line"),
}
"""Where a World has what is written as lines, and which line."""
_AREAS = {
    "road_surface": "road_surface",
    "sidewalk": "sidewalks",
    "island": "islands",
    "building": "buildings",
    "obstacle": "obstacles",
}

Shape = Literal["Point", "LineString", "Polygon"]
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _FeatureDraft:
    """A feature whose rings (each (N, 2), in the World's frame) are still metres."""

    kind: str
    id: str
    shape: Shape
    rings: tuple[Array, ...]
    properties: Json


def write_geojson(world: World, path: Path) -> None:
    """Write a World as one FeatureCollection; coordinates are longitude, latitude.

    Where the World has heights a third number is that above the sea, as its elevation model has it.
    Lengths are metres, angles radians counter-clockwise from east, speeds m/s. A value `x` of the
    map has its source (tagged, inferred or default) in `x_source`. What crosses the antimeridian
    is cut there, as RFC 7946 recommends.
    """
    path.write_bytes(msgspec.json.encode(geojson_of(world)))


def geojson_of(world: World) -> Json:
    """Return the FeatureCollection of `write_geojson` as plain values."""
    drafts = list(_drafts(world))
    rings = [ring for draft in drafts for ring in draft.rings]
    lon_lat = iter(_with_heights(world, drafts, _lon_lat(world.frame, rings)))
    features = [
        {
            "type": "Feature",
            "id": f"{draft.kind}:{draft.id}",
            "geometry": _geometry(draft.shape, [next(lon_lat) for _ in draft.rings]),
            "properties": {"kind": draft.kind, "id": draft.id, **draft.properties},
        }
        for draft in drafts
    ]
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


def _drafts(world: World) -> Iterable[_FeatureDraft]:
    yield from _junctions(world)
    for kind, (parts, line) in _LINES.items():
        for part in getattr(world, parts):
            points, properties = getattr(part, line), _properties(kind, part)
            yield _FeatureDraft(kind, part.id, "LineString", (points,), properties)
    yield from _signals_and_conflicts(world)
    for kind, parts in _AREAS.items():
        for area in getattr(world, parts):
            rings = _closed(area.outline, area.holes)
            yield _FeatureDraft(kind, area.id, "Polygon", rings, _properties(kind, area))


def _junctions(world: World) -> Iterable[_FeatureDraft]:
    for junction in world.junctions:
        summary = msgspec.to_builtins(junction.summary)
        properties = {
            "junction_kind": summary.pop("kind"),
            **{key: value for key, value in summary.items() if key not in ("id", "lat", "lon")},
            "arms": [msgspec.to_builtins(arm) for arm in junction.arms],
            "signal_plan": msgspec.to_builtins(junction.plan),
        }
        if junction.area is None:
            lat, lon = np.array([junction.summary.lat]), np.array([junction.summary.lon])
            at = (local_from_geo(world.frame, lat, lon),)
            yield _FeatureDraft("junction", junction.summary.id, "Point", at, properties)
        else:
            properties["area_source"] = junction.area.source
            rings = _closed(junction.area.outline, junction.area.holes)
            yield _FeatureDraft("junction", junction.summary.id, "Polygon", rings, properties)


def _signals_and_conflicts(world: World) -> Iterable[_FeatureDraft]:
    for signal in world.signals:
        properties = {
            **_properties("signal", signal),
            "height_m": float(signal.position[2]),
            "facing_rad": signal.yaw_rad,
            "source": signal.source,
        }
        yield _FeatureDraft("signal", signal.id, "Point", (signal.position[None, :2],), properties)
    for conflict in world.conflicts:
        properties = _properties("conflict", conflict)
        name = f"{conflict.first_id}|{conflict.second_id}"
        if len(conflict.area) >= 3 and abs(_doubled_area(conflict.area)) > 1e-4:
            rings = _closed(conflict.area, ())
            yield _FeatureDraft("conflict", name, "Polygon", rings, properties)
        else:
            yield _FeatureDraft("conflict", name, "Point", (conflict.point[None, :],), properties)


def _properties(kind: str, part: object) -> Json:
    """Return what `FIELDS` names of a part; with a value that has a source, its source too."""
    found: Json = {}
    for field in FIELDS[kind].split():
        own, _, shown = field.partition(":")
        value, name = getattr(part, own), shown or own
        if value is msgspec.UNSET:
            continue
        if isinstance(value, Quantity | Choice):
            found |= {name: value.value, f"{name}_source": value.source}
        else:
            found[name] = value
    return found


def _closed(outline: Array, holes: Sequence[Array]) -> tuple[Array, ...]:
    """Close the rings, counter-clockwise outside and clockwise inside (RFC 7946, section 3.1.6)."""
    rings = [_turned(outline, 1.0), *(_turned(hole, -1.0) for hole in holes)]
    return tuple(np.concatenate([ring, ring[:1]]) for ring in rings)


def _turned(ring: Array, sign: float) -> Array:
    return ring if _doubled_area(ring) * sign > 0.0 else ring[::-1]


def _doubled_area(ring: Array) -> float:
    ahead = np.roll(ring, -1, axis=0)
    return float((ring[:, 0] * ahead[:, 1] - ahead[:, 0] * ring[:, 1]).sum())


def _lon_lat(frame: LocalFrame, rings: Sequence[Array]) -> list[Array]:
    """Convert all rings at once; longitudes go on past 180 degrees where the World does."""
    if not rings:
        return []
    geo = geo_from_local(frame, np.concatenate(rings))
    around = frame.origin.lon_deg
    lon = around + (geo[:, 1] - around + 180.0) % 360.0 - 180.0
    lon_lat = np.round(np.stack([lon, geo[:, 0]], axis=-1), DEGREE_DIGITS)
    return np.split(lon_lat, np.cumsum([len(ring) for ring in rings])[:-1])


def _with_heights(
    world: World, drafts: Sequence[_FeatureDraft], lon_lat: list[Array]
) -> list[Array]:
    """Return all rings with heights above the sea beside them, where the World has some."""
    hills = heights_of(world)
    if hills is None:
        return lon_lat
    parts = {f"lane:{lane.id}": lane for lane in world.lanes}
    links = {f"connection:{link.id}": link for link in world.connections}
    heights = []
    for draft in drafts:
        name = f"{draft.kind}:{draft.id}"
        part, profile = parts.get(name) or links.get(name), None
        if draft.kind == "road":
            profile = hills.road(draft.id)
        for ring in draft.rings:
            if profile is not None:
                height = profile.height_at(arc_lengths(ring))
            else:
                height = hills.surface_at(ring) if part is None else hills.along(part, ring)
            heights.append(np.round(height + hills.elevation.base_m, 2))
    return [np.column_stack(both) for both in zip(lon_lat, heights, strict=True)]


def _geometry(shape: Shape, rings: list[Array]) -> Json:
    west = min(float(ring[:, 0].min()) for ring in rings)
    east = max(float(ring[:, 0].max()) for ring in rings)
    if west < -180.0 or east > 180.0:
        return _cut(shape, [ring[:, :2] for ring in rings])
    if shape == "Polygon":
        return {"type": shape, "coordinates": [ring.tolist() for ring in rings]}
    (line,) = rings
    return {"type": shape, "coordinates": (line[0] if shape == "Point" else line).tolist()}


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
