"""The whole drive from above: the roads of its Worlds, the way driven, its junctions by number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo, target_from_source_m
from foretwin.contracts.world import World
from foretwin.orchestrator.report.drawing import UNITS_PER_M, Canvas
from foretwin.orchestrator.report.driven_track import CarTrack
from foretwin.orchestrator.report.passages import JunctionPassed, tone_of
from foretwin.world_gen.export import picture_style as style

_MARGIN_M, _LEAST_M = 60.0, 160.0
_MARGIN, _MARK = 0.05, 0.014
"""Of the length and of the width: the margin of a long way, and the radius of a junction's mark."""
_PUSHES = 200
_WIDEST, _TALLEST = 2.6, 0.75
"""Width over height is at most the first; at least one over the second is too tall for a page."""
_TONES = {"bad": style.SIGNAL, "watch": style.LINE_COLOUR["give_way"], "": "#1f5fd0"}


def route_svg(
    track: CarTrack | None,
    worlds: Sequence[World],
    passed: Sequence[JunctionPassed],
    *,
    linked: bool = True,
) -> str | None:
    """Return the picture of a drive as SVG; None where neither track nor junctions are known.

    Each junction is a link to its section, where they are `linked`.
    """
    placed = [one for one in passed if "lat" in one.place and "lon" in one.place]
    degrees = [] if track is None else [track.lat_lon_deg]
    degrees += [np.array([[one.place["lat"], one.place["lon"]]]) for one in placed]
    if not degrees:
        return None
    every = np.concatenate(degrees)
    middle = (every.min(axis=0) + every.max(axis=0)) / 2.0
    frame = LocalFrame(GeoPoint(*middle.tolist()))
    canvas = _canvas(np.asarray(local_from_geo(frame, every[:, 0], every[:, 1])))
    _roads(canvas, frame, worlds)
    if track is not None:
        way = np.asarray(local_from_geo(frame, track.lat_lon_deg[:, 0], track.lat_lon_deg[:, 1]))
        look = 'stroke-linejoin="round" stroke-linecap="round"'
        wide, thin = (round(share * canvas.width_m * UNITS_PER_M) for share in (0.009, 0.0045))
        canvas.line(way, f'stroke="#ffffff" stroke-width="{wide}" {look}')
        canvas.line(way, f'stroke="#10151c" stroke-width="{thin}" {look}', title="the way driven")
        edge = round(0.0015 * canvas.width_m * UNITS_PER_M)
        canvas.dots(
            way[:1],
            0.008 * canvas.width_m,
            f'fill="#ffffff" stroke="#10151c" stroke-width="{edge}"',
        )
    if placed:
        degrees_there = np.array([[one.place["lat"], one.place["lon"]] for one in placed], float)
        places = np.asarray(local_from_geo(frame, degrees_there[:, 0], degrees_there[:, 1]))
        beside = apart(places, 2.0 * _MARK * canvas.width_m)
        for one, place, shown in zip(placed, places, beside, strict=True):
            _junction(canvas, place, shown, one, linked=linked)
    canvas.scale_bar()
    return canvas.svg("the way driven, with its junctions by number", style.GROUND)


def _canvas(xy_m: Array) -> Canvas:
    low, high = xy_m.min(axis=0), xy_m.max(axis=0)
    margin_m = max(_MARGIN_M, _MARGIN * float((high - low).max()))
    low, high = low - margin_m, high + margin_m
    wide, high_m = np.maximum(high - low, _LEAST_M).tolist()
    wide = max(wide, high_m / _TALLEST)
    high_m = max(high_m, wide / _WIDEST)
    x, y = ((low + high) / 2.0).tolist()
    return Canvas(x - wide / 2.0, y - high_m / 2.0, x + wide / 2.0, y + high_m / 2.0)


def _roads(canvas: Canvas, frame: LocalFrame, worlds: Sequence[World]) -> None:
    drawn: dict[tuple[str, int], Array] = {}
    for world in worlds:
        for building in world.buildings:
            drawn.setdefault(
                (building.id, 0), target_from_source_m(frame, world.frame, building.outline)
            )
    for outline in drawn.values():
        canvas.area((outline,), 'fill="#e0d7c9"', tolerance_m=0.8)
    for width_m, colour in ((4.0, style.SIDEWALK), (0.5, style.ROAD)):
        for world in worlds:
            for area in world.road_surface:
                rings = [
                    target_from_source_m(frame, world.frame, ring)
                    for ring in (area.outline, *area.holes)
                ]
                edge = f'stroke="{colour}" stroke-width="{round(width_m * UNITS_PER_M)}"'
                canvas.area(rings, f'fill="{colour}" {edge}', tolerance_m=0.4)


def apart(xy_m: Array, least_m: float) -> Array:
    """Return points (N, 2) pushed from each other until no two are nearer than `least_m`."""
    xy_m = np.array(xy_m, dtype=np.float64)
    turn = np.arange(len(xy_m)) * 2.4  # so that points of one place part in different directions
    own = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    for _ in range(_PUSHES):
        between = xy_m[:, None] - xy_m[None]
        far_m = np.hypot(between[..., 0], between[..., 1])
        lacks_m = np.where(np.eye(len(xy_m), dtype=bool), 0.0, least_m - far_m).clip(0.0)
        if lacks_m.max(initial=0.0) <= 1e-3 * least_m:
            break
        away = np.where(
            far_m[..., None] > 1e-6 * least_m,
            between / np.maximum(far_m, 1e-12)[..., None],
            own[:, None] - own[None],
        )
        xy_m += 0.5 * (away * lacks_m[..., None]).sum(axis=1)
    return xy_m


def _junction(
    canvas: Canvas, place: Array, shown: Array, one: JunctionPassed, *, linked: bool
) -> None:
    colour = _TONES.get(tone_of(one.gravest), _TONES[""])
    if one.arrived_s is None:
        colour = "#8a929c"
    radius_m = _MARK * canvas.width_m
    if np.hypot(*(shown - place)) > 0.5 * radius_m:
        wide = round(0.002 * canvas.width_m * UNITS_PER_M)
        canvas.line(np.stack([place, shown]), f'stroke="{colour}" stroke-width="{wide}"')
    edge = f'stroke="#ffffff" stroke-width="{round(0.003 * canvas.width_m * UNITS_PER_M)}"'
    canvas.dots(shown[None], radius_m, f'fill="{colour}" {edge}')
    look = 'fill="#ffffff" font-weight="700" text-anchor="middle" dominant-baseline="central"'
    canvas.words(shown, str(one.number), 1.25 * radius_m, look, to=one.anchor if linked else "")
