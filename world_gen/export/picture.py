"""A World as a picture for people: seen from above, the junction close and its surroundings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.path import Path as Outline

from contracts.arrays import Array
from contracts.world import Lane, Turn, World
from world_gen.export.picture_marks import (
    BUS,
    GROUND,
    HATCH,
    HEIGHT_COLOURS,
    HEIGHT_SCALE_M,
    ISLAND,
    ISLAND_EDGE,
    JUNCTION,
    KERB,
    LANE,
    LANE_EDGE,
    LINE_COLOUR,
    RING,
    ROAD,
    TURN_COLOUR,
    draw_legend,
    draw_notes,
    north_arrow,
    scale_bar,
)
from world_gen.polyline import direction_at, left_of, length, offset, points_at

_DPI = 110
_CLOSE_MIN_M, _CLOSE_MARGIN_M = 42.0, 28.0


def write_picture(world: World, path: Path) -> None:
    """Write a top-down PNG: left the junction close up, right all of the World, north up.

    What the map tagged is drawn full, what was inferred or is a default is dashed, hollow or
    hatched; the legend says how.
    """
    figure = Figure(figsize=(20.0, 12.6), dpi=_DPI, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    close = figure.add_axes((0.015, 0.115, 0.565, 0.815))
    whole = figure.add_axes((0.6, 0.33, 0.385, 0.6))
    place = world.intersection
    reach = _close_reach(world)
    _draw(close, world, reach, close_up=True)
    _draw(whole, world, world.radius_m, close_up=False)
    scale_bar(close, reach)
    scale_bar(whole, world.radius_m)
    north_arrow(close)
    traits = f"{place.kind}, {place.control}, {place.driving_side}-hand traffic"
    title = f"{place.name or 'unnamed'}   ({traits})"
    figure.text(
        0.015, 0.962, title, fontsize=min(19.0, 1500.0 / len(title)), weight="bold", va="center"
    )
    under = (
        f"intersection {place.id}   world {world.id}   {place.lat:.6f}, {place.lon:.6f}   "
        f"radius {world.radius_m:g} m   {len(world.lanes)} lanes, "
        f"{len(world.connections)} connections, "
        f"{len(world.buildings)} buildings"
    )
    figure.text(0.015, 0.939, under, fontsize=11, va="center", color="#444444")
    figure.text(0.985, 0.012, world.attribution, fontsize=13, ha="right", weight="bold")
    draw_legend(figure, world)
    draw_notes(figure, world)
    canvas.print_figure(str(path), format="png", metadata={"Copyright": world.attribution})


def _close_reach(world: World) -> float:
    points = [lane.centerline[-1] for lane in world.lanes if lane.role == "approach"]
    points += [lane.centerline[0] for lane in world.lanes if lane.role == "exit"]
    far = max((float(np.hypot(*p)) for p in points), default=0.0)
    return float(min(max(_CLOSE_MIN_M, far + _CLOSE_MARGIN_M), world.radius_m))


def _draw(axes: Axes, world: World, reach: float, *, close_up: bool) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_facecolor(GROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    for area in world.road_surface:
        axes.add_patch(_patch(area.outline, area.holes, facecolor=ROAD, edgecolor="none", zorder=1))
    for area in (j.area for j in world.junctions if j.area is not None):
        axes.add_patch(
            _patch(area.outline, area.holes, facecolor=JUNCTION, edgecolor="none", zorder=1.1)
        )
    for area in world.islands:
        axes.add_patch(
            _patch(area.outline, area.holes, facecolor=ISLAND, edgecolor=ISLAND_EDGE, zorder=2)
        )
    axes.add_collection(LineCollection(list(world.kerbs), colors=KERB, linewidths=1.2, zorder=2.1))
    _draw_buildings(axes, world, close_up=close_up)
    _draw_crossings(axes, world, close_up=close_up)
    _draw_lanes(axes, world, reach, close_up=close_up)
    _draw_connections(axes, world, close_up=close_up)
    _draw_stop_lines(axes, world, close_up=close_up)
    _draw_signals(axes, world, close_up=close_up)


def _patch(outline: Array, holes: Iterable[Array], **style: Any) -> PathPatch:
    rings = [np.concatenate([ring, ring[:1]]) for ring in (outline, *holes)]
    codes = [
        code
        for ring in rings
        for code in (Outline.MOVETO, *[Outline.LINETO] * (len(ring) - 2), Outline.CLOSEPOLY)
    ]
    return PathPatch(Outline(np.concatenate(rings), codes), **style)


def _draw_buildings(axes: Axes, world: World, *, close_up: bool) -> None:
    colours = ScalarMappable(HEIGHT_SCALE_M, HEIGHT_COLOURS)
    for building in sorted(world.buildings, key=lambda b: b.height_m.value):
        source = building.height_m.source
        axes.add_patch(
            _patch(
                building.outline,
                building.holes,
                facecolor=colours.to_rgba(np.array([building.height_m.value]), alpha=0.85)[0],
                edgecolor="#5b4a3a" if source == "tagged" else "#9a8a7a",
                hatch=HATCH[source],
                linewidth=0.8 if close_up else 0.4,
                linestyle="-" if building.min_height_m < 2.5 else ":",
                zorder=3,
            )
        )


def _draw_crossings(axes: Axes, world: World, *, close_up: bool) -> None:
    for crossing in world.crossings:
        along = crossing.line[1] - crossing.line[0]
        span = float(np.hypot(*along))
        if span < 0.5:
            continue
        along = along / span
        side = left_of(along) * crossing.width_m.value / 2
        marked = crossing.kind.value != "unmarked"
        stripes = np.arange(0.3, span - 0.2, 1.0)
        bars = [
            PolygonPatch(
                np.array([a - side, a + side, a + 0.5 * along + side, a + 0.5 * along - side])
            )
            for a in (crossing.line[0] + s * along for s in stripes)
        ]
        colour = "#ffffff" if marked else "#dfe2e6"
        axes.add_collection(
            PatchCollection(
                bars, facecolor=colour, edgecolor="#9097a0", linewidths=0.3, zorder=4,
                alpha=1.0 if crossing.kind.source == "tagged" else 0.6,
            )
        )  # fmt: skip
        if close_up and crossing.kind.value == "traffic_signals":
            axes.plot(*crossing.line.T, "s", color="#d62728", markersize=2.5, zorder=7)


def _draw_lanes(axes: Axes, world: World, reach: float, *, close_up: bool) -> None:
    borders: list[Array] = []
    for lane in world.lanes:
        half = lane.width_m.value / 2
        borders += [offset(lane.centerline, half), offset(lane.centerline, -half)]
    axes.add_collection(
        LineCollection(borders, colors=LANE_EDGE, linewidths=1.1 if close_up else 0.5, zorder=4.5)
    )
    for lane in world.lanes:
        colour = BUS if lane.kind == "bus" else RING if lane.role == "ring" else LANE
        tagged = lane.width_m.source == "tagged"
        axes.plot(
            *lane.centerline.T,
            color=colour,
            linewidth=1.0 if close_up else 0.5,
            linestyle="-" if tagged else (0, (5, 3)),
            zorder=5,
        )
        if close_up:
            _lane_arrows(axes, lane, colour, reach)


def _lane_arrows(axes: Axes, lane: Lane, colour: str, reach: float) -> None:
    total = length(lane.centerline)
    if total < 5.0:
        return
    tagged = lane.turns_source == "tagged"
    for at in np.arange(min(6.0, total / 2), total - 2.0, 24.0):
        s = total - at if lane.role == "approach" else at
        tip = points_at(lane.centerline, s)
        if np.abs(tip).max() > reach:
            continue
        ahead = direction_at(lane.centerline, max(s - 0.1, 0.0))
        side = left_of(ahead)
        head = np.array([tip, tip - 2.2 * ahead + 0.8 * side, tip - 2.2 * ahead - 0.8 * side])
        axes.add_patch(
            PolygonPatch(
                head,
                facecolor=colour if tagged else "white",
                edgecolor=colour,
                linewidth=0.9,
                zorder=6,
            )
        )
        if lane.role == "approach" and at < 7.0:
            _turn_arrows(axes, lane, tip - 2.4 * ahead, ahead)


def _turn_arrows(axes: Axes, lane: Lane, at: Array, ahead: Array) -> None:
    angles: Mapping[Turn, float] = {"straight": 0.0, "left": 75.0, "right": -75.0, "u_turn": 160.0}
    for turn in lane.turns:
        a = math.radians(angles[turn])
        way = np.array(
            [
                math.cos(a) * ahead[0] - math.sin(a) * ahead[1],
                math.sin(a) * ahead[0] + math.cos(a) * ahead[1],
            ]
        )
        axes.annotate(
            "",
            xy=tuple(at + 1.7 * way - 1.2 * ahead),
            xytext=tuple(at - 1.2 * ahead),
            arrowprops={
                "arrowstyle": "-|>",
                "color": TURN_COLOUR[turn],
                "lw": 1.6,
                "shrinkA": 0,
                "shrinkB": 0,
            },
            zorder=6.5,
        )


def _draw_connections(axes: Axes, world: World, *, close_up: bool) -> None:
    role = {lane.id: lane.role for lane in world.lanes}
    main = [
        c
        for c in world.connections
        if role[c.from_lane_id] in ("approach", "ring") or role[c.to_lane_id] == "exit"
    ]
    chosen = {c.id for c in main}
    for connection in world.connections:
        here = connection.id in chosen
        axes.plot(
            *connection.centerline.T,
            color=TURN_COLOUR[connection.turn],
            linewidth=(1.7 if here else 0.9) * (1.0 if close_up else 0.5),
            alpha=0.9 if here else 0.6,
            zorder=5.5,
        )


def _draw_stop_lines(axes: Axes, world: World, *, close_up: bool) -> None:
    for line in world.stop_lines:
        tagged = line.control.source == "tagged"
        axes.plot(
            *line.ends.T,
            color=LINE_COLOUR[line.control.value],
            linewidth=4.0 if close_up else 1.6,
            linestyle="-" if tagged else (0, (1.2, 0.7)),
            solid_capstyle="butt",
            zorder=6,
        )


def _draw_signals(axes: Axes, world: World, *, close_up: bool) -> None:
    for signal in world.signals:
        x, y = signal.position[:2]
        tagged = signal.source == "tagged"
        size = 11 if close_up else 4
        axes.plot(
            x, y, "o", markersize=size, color="#d62728" if tagged else "white",
            markeredgecolor="#d62728", markeredgewidth=1.6, zorder=8,
        )  # fmt: skip
        if close_up:
            axes.annotate(
                signal.group_id, (x, y), ha="center", va="center", fontsize=6.5, zorder=9,
                color="white" if tagged else "#d62728", annotation_clip=True,
            )  # fmt: skip
