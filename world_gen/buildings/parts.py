"""Buildings and the parts that describe them: parts stand in their outline's place."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.provenance import Provenance, Quantity
from foretwin.world_gen.buildings.outlines import valid_polygons
from foretwin.world_gen.buildings.roofs import RoofTags
from foretwin.world_gen.polygon_areas import GRID_M

_OWN_SHARE = 0.5
"""A part belongs to the outline that holds at least this share of it."""
_SLIVER_M = 0.25
"""Where no more than this width of an outline is left beside its parts, it was drawn inexactly."""
_ON_TOP_M = 0.5


class Footprint(NamedTuple):
    """A building in the map's frame; `note` says what its map entry left unclear."""

    id: str
    polygon: Polygon
    height_m: Quantity
    min_height_m: float
    is_part: bool
    note: str = ""
    roof: RoofTags | None = None


def resolve_parts(
    outlines: Sequence[Footprint], parts: Sequence[Footprint]
) -> tuple[list[list[Footprint]], list[Footprint]]:
    """Return what is left of each outline beside its parts, and the parts with their heights.

    What parts do not cover stays at the outline's height. A part that begins at the top of its
    outline stands on it and takes nothing away; one that begins lower is an overhang, and below
    it is open. A part without a height has its outline's.
    """
    left: list[list[Footprint]] = [[outline] for outline in outlines]
    known = list(parts)
    if not outlines or not parts:
        return left, known
    of_outline = _members(outlines, parts)
    for i, mine in of_outline.items():
        outline = outlines[i]
        for k in mine:
            if parts[k].height_m.source == "default":
                known[k] = _with_height_of(parts[k], outline)
        top_m = outline.height_m.value - _ON_TOP_M
        cutting = [parts[k].polygon for k in mine if parts[k].min_height_m < top_m]
        if cutting:
            left[i] = _remainder(outline, cutting)
    return left, known


def _members(outlines: Sequence[Footprint], parts: Sequence[Footprint]) -> dict[int, list[int]]:
    """Return for outlines the parts of which they hold most."""
    part_shapes = np.array([p.polygon for p in parts], dtype=object)
    outline_shapes = np.array([o.polygon for o in outlines], dtype=object)
    of_outline: dict[int, list[int]] = defaultdict(list)
    tree = shapely.STRtree(part_shapes)
    i, k = tree.query(outline_shapes, predicate="intersects")
    inside = shapely.area(shapely.intersection(outline_shapes[i], part_shapes[k]))
    own = inside >= _OWN_SHARE * shapely.area(part_shapes[k])
    for outline, part in sorted(zip(i[own].tolist(), k[own].tolist(), strict=True)):
        of_outline[outline].append(part)
    return of_outline


def _with_height_of(part: Footprint, outline: Footprint) -> Footprint:
    height = outline.height_m
    if height.value <= part.min_height_m:
        return part
    source: Provenance = "default" if height.source == "default" else "inferred"
    return part._replace(height_m=Quantity(height.value, source))


def _remainder(outline: Footprint, parts: list[Polygon]) -> list[Footprint]:
    free = shapely.difference(outline.polygon, shapely.union_all(parts), grid_size=GRID_M)
    # Opened: slivers and spikes vanish, mitred corners come back.
    core = shapely.buffer(free, -_SLIVER_M / 2, join_style="mitre")
    opened = shapely.buffer(core, _SLIVER_M / 2, join_style="mitre")
    pieces = valid_polygons(shapely.intersection(opened, free, grid_size=GRID_M))
    return [
        outline._replace(
            id=outline.id if n == 0 else f"{outline.id}.rest{n}", polygon=piece, roof=None
        )
        for n, piece in enumerate(pieces)
    ]
