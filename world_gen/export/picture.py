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
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.path import Path as Outline

from contracts.arrays import Array
from contracts.world import Lane, Provenance, Turn, World
from world_gen.polyline import direction_at, left_of, length, offset, points_at

_DPI = 110
_CLOSE_MIN_M, _CLOSE_MARGIN_M = 42.0, 28.0
_GROUND, _ROAD, _JUNCTION, _KERB = "#e9ece4", "#c9ccd1", "#b9bdc4", "#7c828a"
_LANE_EDGE, _LANE, _BUS, _RING = "#ffffff", "#4c5560", "#a8326e", "#2b6f9e"
_ISLAND, _ISLAND_EDGE = "#b7cfa1", "#6f8f56"
_TURN: Mapping[Turn, str] = {
    "straight": "#2a7f3f",
    "left": "#1f5fd0",
    "right": "#d8781a",
    "u_turn": "#8a3fb0",
}
_LINE: Mapping[str, str] = {
    "signal": "#d62728",
    "stop": "#8b0000",
    "give_way": "#e3a100",
    "none": "#6b7280",
}
_HATCH: Mapping[Provenance, str | None] = {"tagged": None, "inferred": "///", "default": "xxx"}
_HEIGHT_M = Normalize(0.0, 40.0, clip=True)
_HEIGHTS = "YlOrBr"


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
    _scale_bar(close, reach)
    _scale_bar(whole, world.radius_m)
    _north(close)
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
    _legend(figure, world)
    _notes(figure, world)
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
    axes.set_facecolor(_GROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    for area in world.road_surface:
        axes.add_patch(
            _patch(area.outline, area.holes, facecolor=_ROAD, edgecolor="none", zorder=1)
        )
    if world.junction_area is not None:
        area = world.junction_area
        axes.add_patch(
            _patch(area.outline, area.holes, facecolor=_JUNCTION, edgecolor="none", zorder=1.1)
        )
    for area in world.islands:
        axes.add_patch(
            _patch(area.outline, area.holes, facecolor=_ISLAND, edgecolor=_ISLAND_EDGE, zorder=2)
        )
    axes.add_collection(LineCollection(list(world.kerbs), colors=_KERB, linewidths=1.2, zorder=2.1))
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
    colours = ScalarMappable(_HEIGHT_M, _HEIGHTS)
    for building in sorted(world.buildings, key=lambda b: b.height_m.value):
        source = building.height_m.source
        axes.add_patch(
            _patch(
                building.outline,
                building.holes,
                facecolor=colours.to_rgba(np.array([building.height_m.value]), alpha=0.85)[0],
                edgecolor="#5b4a3a" if source == "tagged" else "#9a8a7a",
                hatch=_HATCH[source],
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
        LineCollection(borders, colors=_LANE_EDGE, linewidths=1.1 if close_up else 0.5, zorder=4.5)
    )
    for lane in world.lanes:
        colour = _BUS if lane.kind == "bus" else _RING if lane.role == "ring" else _LANE
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
                "color": _TURN[turn],
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
            color=_TURN[connection.turn],
            linewidth=(1.7 if here else 0.9) * (1.0 if close_up else 0.5),
            alpha=0.9 if here else 0.6,
            zorder=5.5,
        )


def _draw_stop_lines(axes: Axes, world: World, *, close_up: bool) -> None:
    for line in world.stop_lines:
        tagged = line.control.source == "tagged"
        axes.plot(
            *line.ends.T,
            color=_LINE[line.control.value],
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


def _scale_bar(axes: Axes, reach: float) -> None:
    size = next(s for s in (5, 10, 20, 50, 100, 200, 500) if s >= reach / 6 or s == 500)
    x, y = -0.95 * reach, -0.94 * reach
    axes.plot([x, x + size], [y, y], color="black", linewidth=4, solid_capstyle="butt", zorder=10)
    axes.text(
        x + size / 2, y + 0.015 * reach, f"{size} m", ha="center", va="bottom", fontsize=12,
        zorder=10,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5},
    )  # fmt: skip


def _north(axes: Axes) -> None:
    axes.annotate(
        "N", xy=(0.965, 0.975), xytext=(0.965, 0.905), xycoords="axes fraction",
        ha="center", va="center", fontsize=15, weight="bold", zorder=10,
        arrowprops={"arrowstyle": "-|>", "lw": 2.5, "color": "black"},
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 2.0},
    )  # fmt: skip


def _legend(figure: Figure, world: World) -> None:
    def line(colour: str, label: str, style: Any = "-", width: float = 2.0) -> Line2D:
        return Line2D([], [], color=colour, linestyle=style, linewidth=width, label=label)

    def dot(fill: str, label: str) -> Line2D:
        return Line2D(
            [],
            [],
            marker="o",
            linestyle="",
            color=fill,
            markeredgecolor="#d62728",
            markersize=9,
            label=label,
        )

    entries: list[Any] = [
        line(colour, f"connection: {turn.replace('_', '-')}") for turn, colour in _TURN.items()
    ]
    entries += [
        line(_LANE, "lane, width tagged"),
        line(_LANE, "lane, width inferred", (0, (5, 3))),
        line(_RING, "ring lane", (0, (5, 3))),
        line(_BUS, "bus lane", (0, (5, 3))),
    ]
    entries += [
        line(
            colour,
            f"stop line: {'no control' if name == 'none' else name.replace('_', ' ')}",
            "-",
            4.0,
        )
        for name, colour in _LINE.items()
    ]
    entries += [
        line("#555555", "control inferred", (0, (1.2, 0.7)), 4.0),
        dot("#d62728", "signal tagged (with its group)"),
        dot("white", "signal inferred"),
        Patch(facecolor="white", edgecolor="#9097a0", hatch="|||", label="crossing"),
        Patch(facecolor=_ISLAND, edgecolor=_ISLAND_EDGE, label="island"),
        Patch(facecolor="#e8b96a", edgecolor="#5b4a3a", label="building, height tagged"),
        Patch(facecolor="#e8b96a", edgecolor="#9a8a7a", hatch="///", label="height from levels"),
        Patch(facecolor="#e8b96a", edgecolor="#9a8a7a", hatch="xxx", label="height default (6 m)"),
    ]  # fmt: skip
    legend = figure.legend(
        handles=entries, loc="lower left", bbox_to_anchor=(0.012, 0.002), ncols=5, fontsize=10,
        frameon=False, columnspacing=1.6, handlelength=2.4,
    )  # fmt: skip
    for text in legend.get_texts():
        text.set_color("#222222")
    bar = figure.add_axes((0.6, 0.295, 0.2, 0.013))
    figure.colorbar(ScalarMappable(_HEIGHT_M, _HEIGHTS), cax=bar, orientation="horizontal")
    bar.set_xlabel("building height in m", fontsize=10)


def _notes(figure: Figure, world: World) -> None:
    guessed = sum(lane.width_m.source != "tagged" for lane in world.lanes)
    heights = [b.height_m.source for b in world.buildings]
    lines = [
        f"arm {arm.id}: {arm.name or 'unnamed'}, {arm.lanes_in} in, {arm.lanes_out} out"
        for arm in world.arms[:8]
    ]
    lines += [
        "",
        f"lane widths inferred: {guessed} of {len(world.lanes)}",
        f"building heights tagged {heights.count('tagged')}, "
        f"from levels {heights.count('inferred')}, "
        f"default {heights.count('default')}",
    ]
    lines += [f"note: {note[:88]}" for note in world.notes[:5]]
    if len(world.notes) > 5:
        lines.append(f"... and {len(world.notes) - 5} more notes")
    figure.text(
        0.6, 0.245, "\n".join(lines), fontsize=10, va="top", color="#222222", linespacing=1.35
    )
