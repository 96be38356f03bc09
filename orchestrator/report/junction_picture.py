"""A junction from above: its lanes, the futures of one round, and the way that was then driven."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.simulation import AMBER_FROM, RED_FROM
from foretwin.contracts.world import Lane, World
from foretwin.geometry.polyline import left_of, offset, unit
from foretwin.orchestrator.report.blocks import power
from foretwin.orchestrator.report.drawing import UNITS_PER_M, Canvas
from foretwin.orchestrator.report.replayed import SeenFuture
from foretwin.world_gen.export import picture_style as style

_ASPECT = 1.6
_LEAST_HALF_M, _MOST_HALF_M, _MARGIN_M = 24.0, 70.0, 7.0
_BUILDING, _BUILDING_EDGE = "#dccfbe", "#b3a28c"
_DRIVEN, _NOMINAL = "#10151c", "#1f5fd0"
_STILL_M = 0.5


def junction_svg(
    world: World, futures: Sequence[SeenFuture], driven_m: Array, seconds_m: Array
) -> str:
    """Return the picture of a junction as SVG.

    In the World's frame: `driven_m` (N, 2) is where the car went from the futures' beginning on,
    `seconds_m` (K, 2) where it was after each whole second.
    """
    canvas = _canvas(world, futures, driven_m)
    draw_ground(canvas, world)
    _futures(canvas, futures)
    wide = _stroke(canvas, 0.0055)
    if len(driven_m) > 1:
        look = f'stroke-width="{wide}" stroke-linejoin="round" stroke-linecap="round"'
        canvas.line(driven_m, f'stroke="#ffffff" stroke-opacity="0.8" {look}')
        thin = f'stroke-width="{_stroke(canvas, 0.003)}"'
        canvas.line(driven_m, f'stroke="{_DRIVEN}" {thin}', title="what the car did")
        canvas.dots(seconds_m, 0.005 * canvas.width_m, f'fill="{_DRIVEN}"')
    for one in futures:
        if is_touching(one):
            assert one.touch_m is not None
            mark = f'fill="#ffd400" stroke="{_DRIVEN}" stroke-width="{_stroke(canvas, 0.0012)}"'
            canvas.dots(one.touch_m[None], 0.006 * canvas.width_m, mark)
    canvas.scale_bar()
    name = world.intersection.name or world.intersection.id
    return canvas.svg(f"{name} from above, with {len(futures)} futures", style.GROUND)


def is_touching(one: SeenFuture) -> bool:
    """Whether a future's touch is marked."""
    return one.touch_m is not None and (one.row["criticality"] or 0.0) > 0.0


def _stroke(canvas: Canvas, share: float) -> int:
    return max(1, round(share * canvas.width_m * UNITS_PER_M))


def _canvas(world: World, futures: Sequence[SeenFuture], driven_m: Array) -> Canvas:
    junction = next((j for j in world.junctions if j.area is not None), None)
    points = [np.zeros((1, 2)), driven_m[:1], driven_m[-1:]]
    if junction is not None and junction.area is not None:
        points.append(junction.area.outline)
    nominal = [one.xy_m for one in futures if one.row["index"] == 0]
    held = np.concatenate([*points, *nominal[:1]])
    low, high = held.min(axis=0), held.max(axis=0)
    half = max((high - low)[1], (high - low)[0] / _ASPECT) / 2.0 + _MARGIN_M
    half = min(max(half, _LEAST_HALF_M), _MOST_HALF_M)
    middle = (low + high) / 2.0
    if half == _MOST_HALF_M:  # the junction stays in it
        middle = np.clip(middle, -half / 2.0, half / 2.0)
    x, y = middle.tolist()
    return Canvas(x - half * _ASPECT, y - half, x + half * _ASPECT, y + half)


def draw_ground(canvas: Canvas, world: World) -> None:
    """Draw roads, lanes, kerbs, crossings, stop lines and buildings, in the World's frame."""
    for areas, colour in ((world.sidewalks, style.SIDEWALK), (world.road_surface, style.ROAD)):
        for area in areas:
            canvas.area((area.outline, *area.holes), f'fill="{colour}"')
    for junction in world.junctions:
        if junction.area is not None:
            rings = (junction.area.outline, *junction.area.holes)
            canvas.area(rings, f'fill="{style.JUNCTION}"')
    for island in world.islands:
        canvas.area((island.outline, *island.holes), f'fill="{style.ISLAND}"')
    for lane in world.lanes:
        _lane_edges(canvas, lane)
    canvas.lines(world.kerbs, f'stroke="{style.KERB}" stroke-width="3"')
    for building in world.buildings:
        look = f'fill="{_BUILDING}" stroke="{_BUILDING_EDGE}" stroke-width="3"'
        canvas.area((building.outline, *building.holes), look)
    for crossing in world.crossings:
        along = unit(crossing.line[1] - crossing.line[0])
        side = left_of(along) * crossing.width_m.value / 2.0
        a, b = crossing.line
        edges = ([a - side, b - side], [a + side, b + side])
        canvas.lines(
            map(np.array, edges), 'stroke="#ffffff" stroke-width="4" stroke-dasharray="8 6"'
        )
    for line in world.stop_lines:
        colour = style.LINE_COLOUR.get(line.control.value, style.LINE_COLOUR["none"])
        if line.control.value != "none":
            canvas.lines([line.ends], f'stroke="{colour}" stroke-width="6"')


def _lane_edges(canvas: Canvas, lane: Lane) -> None:
    if len(lane.centerline) < 2 or lane.kind == "tram":
        return
    half = lane.width_m.value / 2.0
    edges = [offset(lane.centerline, side) for side in (half, -half)]
    canvas.lines(edges, 'stroke="#ffffff" stroke-width="1.5" stroke-opacity="0.75"')


def future_colour(row: Any) -> str:
    """Return the colour of a future by its criticality and the one table of limits."""
    criticality = row["criticality"] or 0.0
    if criticality >= RED_FROM:
        return style.SIGNAL
    return (
        style.LINE_COLOUR["give_way"]
        if criticality >= AMBER_FROM
        else style.TURN_COLOUR["straight"]
    )


def _futures(canvas: Canvas, futures: Sequence[SeenFuture]) -> None:
    """Draw the least critical first, the nominal future over all others."""
    thin, broad = _stroke(canvas, 0.0016), _stroke(canvas, 0.0032)
    ranked = sorted(futures, key=_rank)
    for one in ranked:
        if (one.row["criticality"] or 0.0) > 0.0 and one.met_xy_m is not None:
            look = f'stroke="{style.MERGING_CONFLICT}" stroke-width="{thin}" stroke-opacity="0.7"'
            canvas.line(one.met_xy_m, look)
    for one in ranked:
        row = one.row
        title = (
            f"{row['name']}: likelihood {power(row['likelihood'] or 0.0)}, "
            f"criticality {power(row['criticality'] or 0.0)}"
        )
        colour = future_colour(row)
        strong = row["index"] == 0 or (row["criticality"] or 0.0) >= AMBER_FROM
        if row["index"] == 0:
            colour = _NOMINAL
        look = f'stroke="{colour}" stroke-width="{broad if strong else thin}"'
        if not strong:
            look += ' stroke-opacity="0.65"'
        if float(np.ptp(one.xy_m, axis=0).max()) > _STILL_M:
            canvas.line(one.xy_m, look, title=title)
        canvas.dots(
            one.xy_m[-1:], (0.005 if strong else 0.003) * canvas.width_m, f'fill="{colour}"'
        )


def _rank(one: SeenFuture) -> tuple[bool, float, float]:
    return one.row["index"] == 0, one.row["criticality"] or 0.0, one.row["likelihood"] or 0.0
