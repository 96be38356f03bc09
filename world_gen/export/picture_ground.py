"""The ground of a World's picture: road surface, islands, sidewalks, buildings, crossings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.path import Path as Outline

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.provenance import PROVENANCES, Provenance
from foretwin.contracts.world import Area, Crossing, Road, World
from foretwin.geometry.polyline import left_of, offset
from foretwin.world_gen.buildings.tags import HEADROOM_M
from foretwin.world_gen.export import picture_style as style
from foretwin.world_gen.export.picture_style import Look, View

HEIGHT_SCALE_M = Normalize(0.0, 40.0, clip=True)
"""Of buildings: the highest colour is for all above."""


def draw_ground(axes: Axes, world: World, view: View) -> None:
    """Draw all that lies flat, then buildings and crossings."""
    axes.set_aspect("equal")
    axes.set_xlim(view.west_m, view.east_m)
    axes.set_ylim(view.south_m, view.north_m)
    axes.set_facecolor(style.GROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    junctions = [j.area for j in world.junctions if j.area is not None]
    for areas, colour, order in (
        (world.sidewalks, style.SIDEWALK, 0.8),
        (world.road_surface, style.ROAD, 1.0),
        (junctions, style.JUNCTION, 1.1),
    ):
        _areas(axes, view, areas, facecolor=colour, edgecolor="none", zorder=order)
    for source in PROVENANCES:
        islands = [island for island in world.islands if island.source == source]
        colours = {"facecolor": style.ISLAND, "edgecolor": style.ISLAND_EDGE, "zorder": 2.0}
        _areas(axes, view, islands, linestyle=style.DASH[source], linewidth=0.9, **colours)
    broad = 1.2 if view.close else 0.6
    kerbs = LineCollection(list(world.kerbs), colors=style.KERB, linewidths=broad, zorder=4.7)
    axes.add_collection(kerbs)
    _tunnels_and_decks(axes, world, view)
    _buildings(axes, world, view)
    _obstacles(axes, world, view)
    _crossings(axes, world, view)


def _outline(area: Area | Building | Obstacle) -> Outline:
    rings = (np.concatenate([ring, ring[:1]]) for ring in (area.outline, *area.holes))
    return Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings))


def _areas(axes: Axes, view: View, areas: Sequence[Area], **look: Any) -> None:
    paths = [_outline(area) for area in areas if view.meets(area.outline)]
    if paths:
        axes.add_collection(PathCollection(paths, **look))


def _buildings(axes: Axes, world: World, view: View) -> None:
    groups: dict[tuple[Provenance, bool], list[Building]] = defaultdict(list)
    for building in sorted(world.buildings, key=lambda b: b.height_m.value):
        if view.meets(building.outline):
            # What cars pass below is drawn see-through.
            groups[building.height_m.source, building.min_height_m >= HEADROOM_M].append(building)
    colours = ScalarMappable(HEIGHT_SCALE_M, style.HEIGHT_COLOURS)
    for (source, overhang), buildings in sorted(groups.items()):
        heights = np.array([b.height_m.value for b in buildings])
        # Hatching is drawn in the edge's colour: tagged heights are marked by their firm outline.
        axes.add_collection(
            PathCollection(
                [_outline(building) for building in buildings],
                facecolors=colours.to_rgba(heights, alpha=0.3 if overhang else 0.9),
                edgecolors="#3f3226" if source == "tagged" else "#8a7762",
                hatch=style.HATCH[source] if view.close and not overhang else None,
                linewidths=1.4 if source == "tagged" else 0.7,
                linestyles=":" if overhang else style.DASH[source],
                zorder=6.8 if overhang else 3.0,
            )
        )


def _obstacles(axes: Axes, world: World, view: View) -> None:
    """Draw what stands beside the road; posts at least as dots, however far the view reaches."""
    near = [one for one in world.obstacles if view.meets(one.outline)]
    for opaque in (False, True):
        paths = [_outline(one) for one in near if one.opaque is opaque]
        colour = style.OPAQUE if opaque else style.SEEN_PAST
        if paths:
            drawn = PathCollection(paths, facecolors=colour, edgecolors=colour, linewidths=1.2)
            axes.add_collection(drawn).set_zorder(6.2)


def _tunnels_and_decks(axes: Axes, world: World, view: View) -> None:
    """Draw roads on bridges over all that lies on the ground, and roads in tunnels faintly."""
    near = [road for road in world.roads if view.meets(road.reference_line)]
    below = [_edges(road) for road in near if road.tunnel or road.layer < 0]
    above = [_edges(road) for road in near if not road.tunnel and road.layer > 0]
    for roads, fill, edge, alpha, order in (
        (below, style.TUNNEL, style.TUNNEL, 0.35, 2.2),
        (above, style.ROAD, style.DECK_EDGE, 1.0, 6.6),
    ):
        if roads:
            decks = [np.concatenate([left, right[::-1]]) for left, right in roads]
            look = Look(facecolors=fill, edgecolors="none", alpha=alpha)
            axes.add_collection(PolyCollection(decks, zorder=order, **look))
            sides = [line for edges in roads for line in edges]
            look = {"colors": edge, "linestyles": "-" if alpha == 1.0 else "--"}
            look |= {"linewidths": 1.6, "zorder": order + 0.05}
            axes.add_collection(LineCollection(sides, **look))


def _edges(road: Road) -> tuple[Array, Array]:
    return offset(road.reference_line, road.left_m), offset(road.reference_line, road.right_m)


def _crossings(axes: Axes, world: World, view: View) -> None:
    for crossing in world.crossings:
        if not view.holds(crossing.line):
            continue
        bars = _bars(crossing)
        unmarked = crossing.kind.value == "unmarked"
        if bars:
            look = {
                "facecolors": "none" if unmarked else "#ffffff",
                "edgecolors": "#6f757d",
                "linewidths": 0.6 if view.close else 0.2,
                "linestyles": style.DASH[crossing.kind.source],
            }
            axes.add_collection(PolyCollection(bars, zorder=4.0, **look))
        if view.close and crossing.kind.value == "traffic_signals":
            axes.plot(*crossing.line.T, "s", color=style.SIGNAL, markersize=3.0, zorder=7.0)


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
