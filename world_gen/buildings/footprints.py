"""Buildings of a map, made when a World needs them, and their footprints in a World's frame."""

from __future__ import annotations

from collections.abc import Container, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from shapely import GeometryType

from foretwin.contracts.beside_road import Building
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.contracts.world import Area
from foretwin.world_gen.buildings.outlines import (
    MIN_PIECE_M2,
    Indices,
    OutlineTable,
    outline_table,
    outlines,
    valid_polygons,
)
from foretwin.world_gen.buildings.parts import Footprint, resolve_parts
from foretwin.world_gen.buildings.roofs import roof_over, roof_tags
from foretwin.world_gen.buildings.tags import HEADROOM_M, building_extent
from foretwin.world_gen.extent import box_deg
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.polygon_areas import GRID_M, areas_of, rings_of

SILHOUETTE_TOLERANCE_M = 0.25
"""How far a silhouette may move from the map's outline to the parts that are run into."""
FOOTPRINT_TOLERANCE_M = 0.05
"""The share of it that footprints take; convex parts take the rest."""

_LEAST_CUT_M2 = 0.1
"""Less of a building is no more than how its outline was drawn."""


Polygons = npt.NDArray[np.object_]


class BuildingIndex:
    """A map's buildings by place: what no World needs is never made into polygons."""

    def __init__(self, osm: OsmMap) -> None:
        self._osm = osm
        self._raw: dict[int, tuple[Footprint, ...]] = {}
        self._done: dict[int, tuple[Footprint, ...]] = {}
        self._lost: dict[int, str] = {}

    @cached_property
    def _table(self) -> OutlineTable:
        return outline_table(self._osm)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        south, west, north, east = self._table.boxes_deg.T
        return shapely.STRtree(shapely.box(west, south, east, north))

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out so far because it can be no building, in words."""
        return (*self._table.notes, *(self._lost[k] for k in sorted(self._lost)))

    def __len__(self) -> int:
        return len(self._table.names)

    def within(self, area: shapely.Geometry) -> tuple[Footprint, ...]:
        """Return the buildings that reach into `area`, a shape in the map's frame."""
        near = np.sort(self._tree.query(box_deg(area, self._osm.frame)))
        self._make(near)
        found = [footprint for k in near.tolist() for footprint in self._done[k]]
        shapely.prepare(area)
        hit = shapely.intersects(area, np.array([f.polygon for f in found], dtype=object))
        return tuple(f for f, inside in zip(found, hit.tolist(), strict=True) if inside)

    def _make(self, entries: Indices) -> None:
        todo = np.array([k for k in entries.tolist() if k not in self._done], dtype=np.intp)
        if not len(todo):
            return
        is_part = np.array(self._table.is_part)
        involved = np.zeros(0, dtype=np.intp)
        if is_part.any():
            # An outline gives way to its parts, and a part takes its outline's height.
            which, other = self._tree.query(self._tree.geometries[todo])
            apart = is_part[todo[which]] != is_part[other]
            involved = np.concatenate([todo[which[apart]], other[apart]])
        self._make_raw(_distinct(np.concatenate([todo, involved])))
        done = {k: self._raw[k] for k in todo.tolist()}
        done.update(self._resolved(_distinct(involved), is_part, done))
        self._done.update(done)

    def _resolved(
        self, entries: Indices, is_part: npt.NDArray[np.bool_], wanted: Container[int]
    ) -> dict[int, tuple[Footprint, ...]]:
        """Return the entries that are `wanted`, outlines without what parts describe."""
        wholes = [(k, f) for k in entries[~is_part[entries]].tolist() for f in self._raw[k]]
        parts = [(k, f) for k in entries[is_part[entries]].tolist() for f in self._raw[k]]
        left, known = resolve_parts([f for _, f in wholes], [f for _, f in parts])
        found: dict[int, tuple[Footprint, ...]] = {k: () for k in entries.tolist() if k in wanted}
        pieces = [*left, *([part] for part in known)]
        for (k, _), mine in zip(wholes + parts, pieces, strict=True):
            if k in found:
                found[k] += tuple(mine)
        return found

    def _make_raw(self, entries: Indices) -> None:
        todo = np.array([k for k in entries.tolist() if k not in self._raw], dtype=np.intp)
        table = self._table
        made = outlines(self._osm, table, todo)
        starts = np.searchsorted(made.owner, np.arange(len(todo)))
        pieces = np.split(made.polygons, starts)[1:]
        for n, (k, polygons) in enumerate(zip(todo.tolist(), pieces, strict=True)):
            height, low, unclear = building_extent(table.tags[k])
            name, part = table.names[k], table.is_part[k]
            note = made.notes.get(n, "")
            if note or unclear:
                kind = "way" if name[0] == "w" else "relation"
                note = f"{kind} {name[1:]}: building {'; '.join(filter(None, (note, unclear)))}"
                if not len(polygons):
                    self._lost[k] = note
            roof = roof_tags(table.tags[k])
            self._raw[k] = tuple(
                Footprint(name if i == 0 else f"{name}.{i}", polygon, height, low, part, note, roof)
                for i, polygon in enumerate(polygons)
            )


def _distinct(rows: Indices) -> Indices:
    """Return the rows once each, ascending; plain `np.unique` would load masked arrays for this."""
    return np.unique(rows, return_index=True)[0]


class StandingBuildings(NamedTuple):
    """Buildings, what of them was cut away where no passage is, and notes."""

    buildings: tuple[Building, ...] = ()
    cut_away: tuple[Area, ...] = ()
    notes: tuple[str, ...] = ()


def buildings_in_frame(
    near: Sequence[Footprint],
    frame: LocalFrame,
    map_frame: LocalFrame,
    driven: Polygons,
    passages: shapely.Geometry | None = None,
) -> StandingBuildings:
    """Return buildings in the World's frame, cut back where they stand on what is `driven`.

    Outlines are simplified by `FOOTPRINT_TOLERANCE_M` and written in millimetres. Lanes run
    through passages and under overhangs, and inferred lane widths can reach into a facade: a car
    must not collide there. What is cut is told but on `passages`, ground of roads that the map
    leads through or below buildings. Notes name the buildings that were cut, and what their tags
    leave unclear.
    """
    if not near:
        return StandingBuildings()
    shapes = np.array([f.polygon for f in near], dtype=object)
    moved = shapely.transform(shapes, lambda xy: target_from_source_m(frame, map_frame, xy))
    moved = shapely.simplify(moved, FOOTPRINT_TOLERANCE_M - GRID_M, preserve_topology=True)
    low = np.flatnonzero([f.min_height_m < HEADROOM_M for f in near])
    touched, taken = _cut_back(moved, low, driven)
    blocked = low[touched]
    if passages is not None:
        taken = shapely.difference(taken, passages)
    cut_away = areas_of([near[k].id for k in blocked.tolist()], taken, smallest_m2=_LEAST_CUT_M2)
    whole = shapely.get_type_id(moved) == GeometryType.POLYGON
    owners, pieces = np.arange(len(near)), moved
    if not whole.all():
        pieces, owners = shapely.get_parts(moved, return_index=True)
    pieces = shapely.transform(pieces, lambda xy: np.round(xy, 3))
    sound = shapely.is_valid(pieces) & (shapely.get_type_id(pieces) == GeometryType.POLYGON)
    sound &= (shapely.area(pieces) >= MIN_PIECE_M2) | ~np.isin(owners, blocked)
    if not sound.all():
        pieces, owners = _mended(pieces, owners, sound)
    buildings = _buildings([near[k] for k in owners.tolist()], pieces)
    notes = list(dict.fromkeys(f.note for f in near if f.note))
    if len(blocked):
        cut = ", ".join(dict.fromkeys(near[k].id for k in blocked.tolist()))
        notes.append(f"buildings cut back where a lane passes: {cut}")
    return StandingBuildings(
        buildings, tuple(area for found in cut_away for area in found), tuple(notes)
    )


def _cut_back(shapes: Polygons, chosen: Indices, driven: Polygons) -> tuple[Indices, Polygons]:
    """Take what is driven out of the chosen shapes; return which of those it touched, and what was
    taken from each."""
    if not len(driven):
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=object)
    building, lane = shapely.STRtree(driven).query(shapes[chosen], predicate="intersects")
    touched, first = np.unique(building, return_index=True)
    taken = np.empty(len(touched), dtype=object)
    if not len(touched):
        return touched, taken
    for n, (k, lanes) in enumerate(zip(touched.tolist(), np.split(lane, first[1:]), strict=True)):
        row = chosen[k]
        shape = shapes[row] if shapes[row].is_valid else shapely.make_valid(shapes[row])
        ground = shapely.union_all(driven[lanes])
        shapes[row], taken[n] = (
            shapely.difference(shape, ground),
            shapely.intersection(shape, ground),
        )
    return touched, taken


def _mended(
    pieces: Polygons, owners: Indices, sound: npt.NDArray[np.bool_]
) -> tuple[Polygons, Indices]:
    """Return pieces as polygons that are valid also when written in millimetres."""
    found: list[tuple[shapely.Polygon, int]] = []
    for piece, owner, is_sound in zip(pieces, owners.tolist(), sound.tolist(), strict=True):
        polygons = [] if is_sound else valid_polygons(piece)
        mended = (shapely.set_precision(polygon, GRID_M) for polygon in polygons)
        parts = [piece] if is_sound else [p for shape in mended for p in valid_polygons(shape)]
        found.extend((part, owner) for part in parts)
    return np.array([p for p, _ in found], dtype=object), np.array([k for _, k in found], np.intp)


def _buildings(of: Sequence[Footprint], pieces: npt.NDArray[np.object_]) -> tuple[Building, ...]:
    """Return buildings of valid polygons; the second piece of a footprint is named `-1`."""
    found: list[Building] = []
    count: dict[str, int] = {}
    for footprint, (outline, *holes) in zip(of, rings_of(pieces), strict=True):
        n = count[footprint.id] = count.get(footprint.id, -1) + 1
        found.append(
            Building(
                id=footprint.id if n == 0 else f"{footprint.id}-{n}",
                outline=outline,
                holes=tuple(holes),
                height_m=footprint.height_m,
                min_height_m=footprint.min_height_m,
                roof=roof_over(
                    outline,
                    footprint.roof,
                    height_m=footprint.height_m.value,
                    min_height_m=footprint.min_height_m,
                ),
            )
        )
    return tuple(found)
