"""The ground of a World's picture: road surface, islands, sidewalks, buildings, crossings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.path import Path as Outline

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import PROVENANCES, Provenance
from foretwin.contracts.world import Area, Building, Crossing, Road, World
from foretwin.geometry.polyline import left_of, offset
from foretwin.world_gen.export.picture_style import (
    DASH,
    DECK_EDGE,
    GROUND,
    HATCH,
    HEIGHT_COLOURS,
    HEIGHT_SCALE_M,
    ISLAND,
    ISLAND_EDGE,
    JUNCTION,
    KERB,
    ROAD,
    SIDEWALK,
    SIGNAL,
    TUNNEL,
    View,
)

OVERHANG_M = 2.5
"""What begins higher is drawn see-through: cars pass below it."""


def draw_ground(axes: Axes, world: World, view: View) -> None:
    """Draw all that lies flat, then buildings and crossings."""
    axes.set_aspect("equal")
    axes.set_xlim(view.west_m, view.east_m)
    axes.set_ylim(view.south_m, view.north_m)
    axes.set_facecolor(GROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    _areas(axes, view, world.sidewalks, facecolor=SIDEWALK, edgecolor="none", zorder=0.8)
    _areas(axes, view, world.road_surface, facecolor=ROAD, edgecolor="none", zorder=1.0)
    junctions = [j.area for j in world.junctions if j.area is not None]
    _areas(axes, view, junctions, facecolor=JUNCTION, edgecolor="none", zorder=1.1)
    for source in PROVENANCES:
        islands = [island for island in world.islands if island.source == source]
        style = {"linestyle": DASH[source], "linewidth": 0.9, "zorder": 2.0}
        _areas(axes, view, islands, facecolor=ISLAND, edgecolor=ISLAND_EDGE, **style)
    axes.add_collection(
        LineCollection(
            list(world.kerbs), colors=KERB, linewidths=1.2 if view.close else 0.6, zorder=4.7
        )
    )
    _tunnels_and_decks(axes, world, view)
    _buildings(axes, world, view)
    _crossings(axes, world, view)


def _outline(outline: Array, holes: Iterable[Array] = ()) -> Outline:
    rings = [np.concatenate([ring, ring[:1]]) for ring in (outline, *holes)]
    codes = [
        code
        for ring in rings
        for code in (Outline.MOVETO, *[Outline.LINETO] * (len(ring) - 2), Outline.CLOSEPOLY)
    ]
    return Outline(np.concatenate(rings), codes)


def _areas(axes: Axes, view: View, areas: Sequence[Area], **style: Any) -> None:
    paths = [_outline(area.outline, area.holes) for area in areas if view.meets(area.outline)]
    if paths:
        axes.add_collection(PathCollection(paths, **style))


def _buildings(axes: Axes, world: World, view: View) -> None:
    groups: dict[tuple[Provenance, bool], list[Building]] = {}
    for building in sorted(world.buildings, key=lambda b: b.height_m.value):
        if view.meets(building.outline):
            key = building.height_m.source, building.min_height_m >= OVERHANG_M
            groups.setdefault(key, []).append(building)
    colours = ScalarMappable(HEIGHT_SCALE_M, HEIGHT_COLOURS)
    for (source, overhang), buildings in sorted(groups.items()):
        heights = np.array([b.height_m.value for b in buildings])
        # Hatching is drawn in the edge's colour: tagged heights are told by their firm outline.
        axes.add_collection(
            PathCollection(
                [_outline(b.outline, b.holes) for b in buildings],
                facecolors=colours.to_rgba(heights, alpha=0.3 if overhang else 0.9),
                edgecolors="#3f3226" if source == "tagged" else "#8a7762",
                hatch=HATCH[source] if view.close and not overhang else None,
                linewidths=1.4 if source == "tagged" else 0.7,
                linestyles=":" if overhang else DASH[source],
                zorder=6.8 if overhang else 3.0,
            )
        )


def _tunnels_and_decks(axes: Axes, world: World, view: View) -> None:
    """Draw roads on bridges over all that lies on the ground, and roads in tunnels faintly."""
    near = [road for road in world.roads if view.meets(road.reference_line)]
    below = [_edges(road) for road in near if road.tunnel or road.layer < 0]
    above = [_edges(road) for road in near if not road.tunnel and road.layer > 0]
    for roads, fill, edge, alpha, order in (
        (below, TUNNEL, TUNNEL, 0.35, 2.2),
        (above, ROAD, DECK_EDGE, 1.0, 6.6),
    ):
        if roads:
            decks = [np.concatenate([left, right[::-1]]) for left, right in roads]
            axes.add_collection(
                PolyCollection(decks, facecolors=fill, edgecolors="none", alpha=alpha, zorder=order)
            )
            axes.add_collection(
                LineCollection(
                    [line for sides in roads for line in sides],
                    colors=edge,
                    linewidths=1.6,
                    linestyles="-" if alpha == 1.0 else "--",
                    zorder=order + 0.05,
                )
            )


def _edges(road: Road) -> tuple[Array, Array]:
    return offset(road.reference_line, road.left_m), offset(road.reference_line, road.right_m)


def _crossings(axes: Axes, world: World, view: View) -> None:
    for crossing in world.crossings:
        if not view.holds(crossing.line):
            continue
        bars = _bars(crossing)
        unmarked = crossing.kind.value == "unmarked"
        if bars:
            axes.add_collection(
                PolyCollection(
                    bars,
                    facecolors="none" if unmarked else "#ffffff",
                    edgecolors="#6f757d",
                    linewidths=0.6 if view.close else 0.2,
                    linestyles=DASH[crossing.kind.source],
                    zorder=4.0,
                )
            )
        if view.close and crossing.kind.value == "traffic_signals":
            axes.plot(*crossing.line.T, "s", color=SIGNAL, markersize=3.0, zorder=7.0)


def _bars(crossing: Crossing) -> list[Array]:
    """Return the stripes of a crossing; one frame where none are painted."""
    along = crossing.line[1] - crossing.line[0]
    span = float(np.hypot(*along))
    if span < 0.5:
        return []
    along = along / span
    side = left_of(along) * crossing.width_m.value / 2
    if crossing.kind.value == "unmarked":
        a, b = crossing.line
        return [np.array([a - side, a + side, b + side, b - side])]
    starts = [crossing.line[0] + s * along for s in np.arange(0.3, span - 0.2, 1.0)]
    ahead = 0.5 * along
    return [np.array([a - side, a + side, a + ahead + side, a + ahead - side]) for a in starts]
