"""What stands beside the road: trunks, posts, walls and rails, clear of where cars drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Obstacle
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.geometry.polyline_batch import Polylines
from foretwin.world_gen.extent import Extent, box_deg
from foretwin.world_gen.osm.osm_map import OsmMap, boxes_deg
from foretwin.world_gen.polygon_areas import GRID_M
from foretwin.world_gen.roadside.obstacle_kinds import (
    SHELTER_LENGTH_M,
    Obstacle3d,
    standing_along,
    standing_at,
)

CLEAR_OF_LANES_M = 0.3
"""What a map puts nearer to a lane stands elsewhere, or the lane is narrower: nobody knows which,
and a car that keeps to its lane must not hit it."""
LEAST_PIECE_M2 = 0.02
"""Smaller pieces of a wall are left out; a bollard has as much."""
_SIMPLIFIED_M = 0.05


class _Standing(NamedTuple):
    name: str
    points_deg: Array
    """(N, 2) latitude and longitude; one of what stands at a node."""
    closed: bool
    what: Obstacle3d


class ObstacleIndex:
    """What stands beside a map's roads, collected once and looked up place by place."""

    def __init__(self, osm: OsmMap) -> None:
        self._osm = osm

    @cached_property
    def _all(self) -> tuple[_Standing, ...]:
        return tuple(_standing(self._osm))

    @cached_property
    def _boxes_deg(self) -> Array:
        first = np.cumsum([0, *(len(one.points_deg) for one in self._all)])
        return boxes_deg(np.concatenate([one.points_deg for one in self._all]), first)

    def within(self, area: shapely.Geometry) -> tuple[_Standing, ...]:
        """Return what may reach into `area`, a shape in the map's frame."""
        if not self._all:
            return ()
        west, south, east, north = box_deg(area, self._osm.frame).bounds
        boxes = self._boxes_deg
        apart = (boxes[:, :2] > (north, east)) | (boxes[:, 2:] < (south, west))
        return tuple(self._all[k] for k in np.flatnonzero(~apart.any(axis=1)).tolist())


def _standing(osm: OsmMap) -> Iterator[_Standing]:
    found = ((node, standing_at(tags)) for node, tags in osm.node_tags.items())
    nodes = [(node, what) for node, what in found if what is not None and node in osm.locations]
    at_deg = osm.locations.of([node for node, _ in nodes])
    for k, (node, what) in enumerate(nodes):
        yield _Standing(f"n{node}", at_deg[k : k + 1], closed=False, what=what)
    for way in osm.ways.values():
        if len(way.nodes) > 1 and (along := standing_along(way.tags)) is not None:
            ring = way.nodes[0] == way.nodes[-1] and len(way.nodes) > 3
            filled = along.kind == "shelter" or way.tags.get("area") == "yes"
            area = ring and filled and along.kind != "fence"  # a fence goes around its area
            yield _Standing(f"w{way.id}", osm.locations.of(way.nodes), closed=area, what=along)


def obstacles_in_frame(
    near: Sequence[_Standing],
    frame: LocalFrame,
    extent: Extent,
    driven: np.ndarray,
    lines: Sequence[Array],
) -> tuple[tuple[Obstacle, ...], tuple[str, ...]]:
    """Return obstacles in the World's frame, clear of what is `driven` (polygons), with notes.

    A point that stands on a lane is left out, a wall that crosses one is cut there. `lines` are
    those along which a shelter at a point is turned, the nearest one's way.
    """
    if not near:
        return (), ()
    shapes = _shapes(near, frame, lines)
    which, lane = shapely.STRtree(driven).query(shapes, "dwithin", CLEAR_OF_LANES_M)
    first = np.searchsorted(which, np.arange(len(near) + 1))
    inside = shapely.intersects(shapes, extent.polygon)
    whole = shapely.contains_properly(extent.polygon, shapes)
    left_out, cut = [], []
    found: list[Obstacle] = []
    for k in np.flatnonzero(inside).tolist():
        one, shape, close = near[k], shapes[k], driven[lane[first[k] : first[k + 1]]]
        if len(close):
            if len(one.points_deg) == 1:
                left_out.append(one.name)
                continue
            cut.append(one.name)
            shape = shape.difference(shapely.union_all(close).buffer(CLEAR_OF_LANES_M))
        found.extend(_obstacles(one, shape if whole[k] else shape.intersection(extent.polygon)))
    notes = []
    if left_out:
        notes.append(f"beside the road, left out where a lane passes: {', '.join(left_out)}")
    if cut:
        notes.append(f"beside the road, cut where a lane passes: {', '.join(cut)}")
    return tuple(found), tuple(notes)


def _shapes(near: Sequence[_Standing], frame: LocalFrame, lines: Sequence[Array]) -> np.ndarray:
    lat_lon = np.concatenate([one.points_deg for one in near])
    ends = np.cumsum([len(one.points_deg) for one in near])
    points = np.split(local_from_geo(frame, lat_lon[:, 0], lat_lon[:, 1]), ends[:-1])
    half_m = np.array([one.what.width_m / 2.0 for one in near])
    at = np.array([xy[0] for xy in points])
    low, high = at - half_m[:, None], at + half_m[:, None]
    found: np.ndarray = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    roads = Polylines.of(lines) if lines else None
    for k, (one, xy) in enumerate(zip(near, points, strict=True)):
        if one.closed:
            found[k] = shapely.make_valid(shapely.Polygon(xy))
        elif len(xy) > 1:
            line = shapely.LineString(xy).simplify(_SIMPLIFIED_M)
            ends_flat = {"cap_style": "flat", "join_style": "mitre", "mitre_limit": 2.0}
            found[k] = line.buffer(half_m[k], **ends_flat)
        elif one.what.kind == "shelter":
            found[k] = _shelter(xy[0], float(half_m[k]), roads)
    return found


def _shelter(at: Array, half_m: float, roads: Polylines | None) -> shapely.Polygon:
    """Return its outline, along the nearest piece of a road."""
    ahead = np.array([1.0, 0.0])
    if roads is not None:
        step, length = roads.steps
        away = np.hypot(*(roads.xy_m + step / 2.0 - at).T)
        k = int(np.where(length > 0.0, away, np.inf).argmin())
        ahead = step[k] / length[k]
    along, aside = SHELTER_LENGTH_M / 2.0 * ahead, half_m * np.array([-ahead[1], ahead[0]])
    return shapely.Polygon(
        [at - along - aside, at + along - aside, at + along + aside, at - along + aside]
    )


def _obstacles(one: _Standing, shape: shapely.Geometry) -> Iterator[Obstacle]:
    """Yield the pieces of a shape as obstacles in millimetres, counter-clockwise."""
    pieces = shapely.get_parts(shapely.set_precision(shape, GRID_M))
    kept = [p for p in pieces if p.geom_type == "Polygon" and p.area >= LEAST_PIECE_M2]
    for n, piece in enumerate(kept):
        turned = shapely.orient_polygons(piece)
        rings = [turned.exterior, *turned.interiors]
        outline, *holes = (shapely.get_coordinates(ring)[:-1] for ring in rings)
        yield Obstacle(
            id=one.name if n == 0 else f"{one.name}-{n}",
            kind=one.what.kind,
            outline=outline,
            holes=tuple(holes),
            height_m=one.what.height_m,
        )
