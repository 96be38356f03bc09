"""The traffic of a World's picture: lanes, turns, connections, lines, signals, right of way."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Conflict, Connection, Lane, StopLine, Turn, World, YieldRule
from foretwin.geometry.polyline import direction_at, left_of, length, offset, points_at, unit
from foretwin.world_gen.export import picture_style as style
from foretwin.world_gen.export.picture_style import Look, View

ARROW_SPACING_M = 24.0
_UNDRIVEN = ("parking", "closed")
_KIND_COLOUR: Mapping[str, str] = {"bus": style.BUS, "bicycle": style.BICYCLE, "tram": style.TRAM}
_TURN_DEG: Mapping[Turn, float] = {"straight": 0.0, "left": 75.0, "right": -75.0, "u_turn": 160.0}
_GENERAL: frozenset[YieldRule] = frozenset(("near_side", "far_side", "order", "merge_order"))
"""Rules under which two roads wait for each other: neither has priority."""
_ACROSS: frozenset[YieldRule] = frozenset(("turn_across", "u_turn"))


def draw_traffic(axes: Axes, world: World, view: View) -> None:
    """Draw lanes, then what leads across junctions, then what gives the right of way."""
    _draw_lanes(axes, world, view)
    _draw_lines(axes, _connections(world, view))
    _draw_lines(axes, _stop_lines(world, view))
    if view.close:
        _draw_conflicts(axes, world, view)
        _draw_who_waits(axes, world, view)
    _draw_signals(axes, world, view)


class _LineLook(NamedTuple):
    """How a line is drawn, dashed by the source of what it shows."""

    colour: str
    source: Provenance
    width: float
    order: float
    alpha: float = 1.0


def _draw_lines(axes: Axes, lines: Iterable[tuple[_LineLook, Array]]) -> None:
    """Draw lines, those that look alike at once."""
    groups: dict[_LineLook, list[Array]] = defaultdict(list)
    for line, points in lines:
        groups[line].append(points)
    for (colour, source, width, order, alpha), together in groups.items():
        look = Look(colors=colour, linestyles=style.DASH[source], linewidths=width, alpha=alpha)
        axes.add_collection(LineCollection(together, zorder=order, **look))


def _order(layer: int) -> float:
    """Return how far above the ground's marks those of a bridge are drawn."""
    return 2.0 if layer > 0 else 0.0


def _fade(layer: int) -> float:
    """Return how firmly the lines of a layer are drawn: those of tunnels faintly."""
    return 0.45 if layer < 0 else 1.0


def _draw_lanes(axes: Axes, world: World, view: View) -> None:
    counted = {road.id: road.lane_count_source for road in world.roads}
    near = [lane for lane in world.lanes if view.meets(lane.centerline)]
    strips: list[Array] = []
    lines: list[tuple[_LineLook, Array]] = []
    broad, narrow = (1.2, 1.0) if view.close else (0.5, 0.5)
    for lane in near:
        half, order, fade = lane.width_m.value / 2, _order(lane.layer), _fade(lane.layer)
        left, right = offset(lane.centerline, half), offset(lane.centerline, -half)
        edge = _LineLook(style.LANE_EDGE, lane.width_m.source, broad, 4.5 + order, fade)
        lines += [(edge, left), (edge, right)]
        if lane.kind in _UNDRIVEN:
            strips.append(np.concatenate([left, right[::-1]]))
        else:
            source = counted.get(lane.road_id, "inferred")
            middle = _LineLook(_colour(lane), source, narrow, 5.0 + order, fade)
            lines.append((middle, lane.centerline))
    if strips:
        axes.add_collection(PolyCollection(strips, facecolors=style.PARKING, zorder=1.3))
    _draw_lines(axes, lines)
    if view.close:
        _draw_arrows(axes, (lane for lane in near if lane.kind not in _UNDRIVEN), view)


def _colour(lane: Lane) -> str:
    return _KIND_COLOUR.get(lane.kind, style.RING if lane.role == "ring" else style.LANE)


def _draw_arrows(axes: Axes, lanes: Iterable[Lane], view: View) -> None:
    size = min(max(view.width_m / 90.0, 0.7), 1.25)
    for lane in lanes:
        total = length(lane.centerline)
        if total < 4.0:
            continue
        colour, fade = _colour(lane), 0.5 if lane.layer < 0 else 1.0
        heads: list[Array] = []
        for at in np.arange(min(7.0, total / 2), total - 2.0, ARROW_SPACING_M):
            s = float(total - at if lane.role in ("approach", "ring") else at)
            tip, ahead = points_at(lane.centerline, s), direction_at(lane.centerline, s - 0.1)
            if not view.holds(tip):
                continue
            if lane.turns and at < 8.0 and lane.role in ("approach", "ring"):
                _draw_turns(axes, lane, tip, ahead, size)
            else:
                heads.append(_head(tip, ahead, size))
        if heads:
            order, tagged = 6.0 + _order(lane.layer), lane.direction_source == "tagged"
            _filled(axes, heads, colour, tagged, linewidths=0.9, alpha=fade, zorder=order)


def _filled(axes: Axes, shapes: list[Array], colour: str, tagged: bool, **look: Any) -> None:
    """Fill shapes whose value is tagged; of others draw the edge alone."""
    inner = colour if tagged else "white"
    axes.add_collection(PolyCollection(shapes, facecolors=inner, edgecolors=colour, **look))


def _head(tip: Array, ahead: Array, size: float) -> Array:
    side = 0.5 * size * left_of(ahead)
    return np.array([tip, tip - 1.4 * size * ahead + side, tip - 1.4 * size * ahead - side])


def _draw_turns(axes: Axes, lane: Lane, at: Array, ahead: Array, size: float) -> None:
    """Draw one arrow for each turn, within the lane, as it would be painted there."""
    tagged = lane.turns_source == "tagged"
    foot, fork = at - 4.6 * size * ahead, at - 2.2 * size * ahead
    reach = dict.fromkeys(lane.turns, 1.5 * size) | {"straight": 2.6 * size}
    for turn in lane.turns:
        a = math.radians(_TURN_DEG[turn])
        cos, sin = math.cos(a), math.sin(a)
        way = np.array([cos * ahead[0] - sin * ahead[1], sin * ahead[0] + cos * ahead[1]])
        tip = fork + reach[turn] * way
        colour, order = style.TURN_COLOUR[turn], 6.3 + _order(lane.layer)
        shaft = np.array([foot, fork, tip - 0.7 * size * way])
        look = Look(colors=colour, linestyles="-" if tagged else (0, (2, 1)), linewidths=1.6)
        axes.add_collection(LineCollection([shaft], zorder=order, **look))
        head = _head(tip, way, 0.75 * size)
        _filled(axes, [head], colour, tagged, linewidths=1.0, zorder=order + 0.1)


def _connections(world: World, view: View) -> Iterator[tuple[_LineLook, Array]]:
    tagged = {lane.id for lane in world.lanes if lane.turns_source == "tagged"}
    share = 1.0 if view.close else 0.45
    for connection in world.connections:
        if view.meets(connection.centerline):
            colour, order = style.TURN_COLOUR[connection.turn], 5.5 + _order(connection.layer)
            alpha = 0.9 if connection.junction_id else 0.5
            line = _LineLook(colour, "inferred", 1.3 * share, order, alpha)
            if connection.from_lane_id in tagged:
                line = line._replace(source="tagged", width=1.8 * share)
            yield line, connection.centerline


def _stop_lines(world: World, view: View) -> Iterator[tuple[_LineLook, Array]]:
    for line in world.stop_lines:
        if view.holds(line.ends):
            control, source = line.control.value, line.control.source
            colour = style.LINE_COLOUR.get(control, style.LINE_COLOUR["none"])
            width = (4.0 if control != "none" else 2.2) * (1.0 if view.close else 0.4)
            yield _LineLook(colour, source, width, 6.0), line.ends


def _draw_conflicts(axes: Axes, world: World, view: View) -> None:
    crossing, merging = ("x", style.CROSSING_CONFLICT), ("+", style.MERGING_CONFLICT)
    for kind, (marker, colour) in {"crossing": crossing, "merging": merging}.items():
        points = [c.point for c in world.conflicts if c.kind == kind and view.holds(c.point)]
        if points:
            look = {"marker": marker, "color": colour, "alpha": 0.85, "zorder": 7.5}
            _dots(axes, np.array(points), markersize=4.0, markeredgewidth=0.9, **look)


def _dots(axes: Axes, at: Array, **look: Any) -> None:
    """Draw marks at points (N, 2) or (2,)."""
    axes.plot(*at.T, linestyle="", **look)


def _sign(axes: Axes, at: Array, marker: str, colour: str, tagged: bool, **look: float) -> None:
    """Draw a mark at (2,), filled where its value is tagged."""
    inner = colour if tagged else "white"
    _dots(axes, at, marker=marker, color=inner, markeredgecolor=colour, **look)


def _draw_who_waits(axes: Axes, world: World, view: View) -> None:
    """Draw at the end of each lane why its drivers wait: a sign, a lesser road, the near side."""
    line_of = {line.across_id: line for line in world.stop_lines}
    rules = _rules_by_lane(world.connections, world.conflicts, line_of)
    for lane in world.lanes:
        mark = _mark(rules.get(lane.id, {}), line_of.get(lane.id))
        if mark is not None:
            ahead = direction_at(lane.centerline, length(lane.centerline))
            _draw_mark(axes, view, lane.centerline[-1], ahead, *mark)
    for line in world.stop_lines:
        mark = None if line.connection_id is None else _mark({}, line)
        if mark is not None:
            left, right = line.ends
            _draw_mark(axes, view, (left + right) / 2.0, left_of(unit(right - left)), *mark)


def _draw_mark(
    axes: Axes, view: View, at: Array, ahead: Array, shape: str, source: Provenance
) -> None:
    """Draw a mark just before a place (2,) at which drivers wait."""
    if not view.holds(at):
        return
    colour = style.LINE_COLOUR["stop"] if shape == "8" else style.WAITS
    look = {"markersize": 9.0, "markeredgewidth": 1.4, "zorder": 7.8}
    _sign(axes, at - 1.6 * ahead, shape, colour, source == "tagged", **look)


def _rules_by_lane(
    connections: Iterable[Connection],
    conflicts: Iterable[Conflict],
    line_of: Mapping[str, StopLine],
) -> dict[str, dict[YieldRule, Provenance]]:
    """Return for lanes the rules under which their connections wait, but for signs inside."""
    start = {c.id: c.from_lane_id for c in connections}
    found: dict[str, dict[YieldRule, Provenance]] = defaultdict(dict)
    for conflict in conflicts:
        line = line_of.get(conflict.yields_id)
        if line is None or line.control.value != conflict.rule:
            found[start[conflict.yields_id]][conflict.rule] = conflict.source
    return found


def _mark(
    rules: Mapping[YieldRule, Provenance], line: StopLine | None
) -> tuple[str, Provenance] | None:
    """Return the marker of the strongest reason to wait, and where it came from."""
    if line is not None and line.control.value == "signal":
        return None
    if line is not None and line.control.value in ("stop", "give_way"):
        return ("8" if line.control.value == "stop" else "v"), line.control.source
    if rules.keys() - _GENERAL - _ACROSS:
        return "v", "inferred"
    return ("D", "default") if rules.keys() & _GENERAL else None


def _draw_signals(axes: Axes, world: World, view: View) -> None:
    for signal in world.signals:
        at = signal.position[:2]
        if not view.holds(at):
            continue
        tagged = signal.source == "tagged"
        size = 12 if view.close else 3.5
        _sign(axes, at, "o", style.SIGNAL, tagged, markersize=size, markeredgewidth=1.6, zorder=8.6)
        if view.close:
            look = Look(color="white" if tagged else style.SIGNAL, fontsize=6.5)
            look |= {"ha": "center", "va": "center", "zorder": 9.0, "annotation_clip": True}
            axes.annotate(signal.group_id.rpartition(":")[2], tuple(at), **look)
