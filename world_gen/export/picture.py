"""A World as a picture for people: seen from above, the junction close and its surroundings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.left_out import LEFT_OUT
from foretwin.contracts.terminal import plain
from foretwin.contracts.world import World
from foretwin.world_gen.export import picture_marks as marks
from foretwin.world_gen.export.picture_fonts import PLAIN, fonts_for
from foretwin.world_gen.export.picture_ground import draw_ground
from foretwin.world_gen.export.picture_style import View, view_around
from foretwin.world_gen.export.picture_traffic import draw_traffic
from foretwin.world_gen.report.report import WorldReport, report_of

_SIZE_IN = (20.0, 13.0)
_DPI = 110
_MAIN_BOX = (0.01, 0.145, 0.59, 0.785)
_WHOLE_BOX = (0.612, 0.585, 0.378, 0.345)
_CLOSE_MIN_M, _CLOSE_MARGIN_M = 30.0, 16.0
_DETAILED_M = 500.0
"""Regions wider than this are drawn without arrows and marks, which would cover them."""


def write_picture(world: World, path: Path) -> None:
    """Write a top-down picture as PNG or SVG, by the suffix: north up, all of a region.

    A World of a junction is drawn close up beside all of it. What the map tagged is drawn solid
    and full, what was inferred dashed or hollow, a default dotted or hatched; the legend says how
    and the title how sure that makes it. The same World gives the same bytes.

    Raises UserError for another suffix.
    """
    form = path.suffix.lower().lstrip(".")
    if form not in ("png", "svg"):
        raise UserError(f"{path}: a picture is written as .png or .svg, not .{form}")
    report, rights = report_of(world), plain(world.attribution)
    settings = {"svg.hashsalt": "foretwin", "svg.fonttype": "none", "hatch.linewidth": 0.5}
    with matplotlib.rc_context(settings):  # type: ignore[arg-type]
        figure = _figure(world, report)
        if form == "svg":
            metadata = {"Date": None, "Rights": rights, "Title": plain(_title(world, report))}
            FigureCanvasSVG(figure).print_figure(str(path), format=form, metadata=metadata)
        else:
            metadata = {"Copyright": rights, "Software": "foretwin"}
            FigureCanvasAgg(figure).print_figure(str(path), format=form, metadata=metadata)


def _figure(world: World, report: WorldReport) -> Figure:
    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, facecolor="white")
    main = figure.add_axes(_MAIN_BOX)
    if world.bounds_m is not None:
        view = _all_of(world, _aspect(_MAIN_BOX))
        _draw(main, world, view)
        marks.number_junctions(main, world, view)
        top = 0.93
    else:
        _draw(main, world, _close_view(world))
        view = view_around(np.zeros(2), world.radius_m, _aspect(_WHOLE_BOX), close=False)
        _draw(figure.add_axes(_WHOLE_BOX), world, view)
        top = 0.57
    title = plain(_title(world, report))
    fonts = fonts_for(title)
    title = fonts.drawable(title)
    size = min(18.0, 1550.0 / len(title))
    look: dict[str, Any] = {"fontsize": size, "weight": "bold", "family": fonts.families(PLAIN)}
    figure.text(0.01, 0.972, title, va="center", parse_math=False, **look)
    figure.text(
        0.01,
        0.945,
        plain(_subtitle(world)),
        fontsize=10.5,
        va="center",
        color="#444444",
        parse_math=False,
    )
    figure.text(
        0.99,
        0.012,
        plain(world.attribution),
        fontsize=12,
        ha="right",
        weight="bold",
        parse_math=False,
    )
    marks.draw_legend(figure)
    marks.draw_height_scale(figure, (0.84, 0.135, 0.15, 0.011))
    marks.draw_panel(figure, world, report, top=top)
    return figure


def _title(world: World, report: WorldReport) -> str:
    place = world.intersection
    if world.bounds_m is not None:
        what = f"{len(world.junctions)} junctions, {place.driving_side}-hand traffic"
        sure = report.confidence
    else:
        kind, control = place.kind.replace("_", " "), place.control.replace("_", " ")
        words = kind if kind == control else f"{kind}, {control}"
        what = f"{words}, {place.driving_side}-hand traffic"
        sure = report.junctions[0].confidence if report.junctions else report.confidence
    trust = "" if sure is None else f"   confidence {sure:.2f}"
    name = place.name or place.id
    if LEFT_OUT in fonts_for(name).drawable(name):
        name = f"{name} {place.id}"
    return f"{name}   ({what}){trust}"


def _subtitle(world: World) -> str:
    place = world.intersection
    name, reach = f"intersection {place.id}", f"radius {world.radius_m:g} m"
    if world.bounds_m is not None:
        west, south, east, north = world.bounds_m
        name, reach = place.id, f"{east - west:.0f} m by {north - south:.0f} m"
    return (
        f"{name}   world {world.id}   {place.lat:.6f}, {place.lon:.6f}   "
        f"{reach}   {len(world.lanes)} lanes, {len(world.connections)} connections, "
        f"{len(world.conflicts)} conflicts, {len(world.buildings)} buildings"
    )


def _draw(axes: Axes, world: World, view: View) -> None:
    draw_ground(axes, world, view)
    draw_traffic(axes, world, view)
    marks.scale_bar(axes, view)
    if view.close or world.bounds_m is not None:
        marks.north_arrow(axes)


def _aspect(box: tuple[float, float, float, float]) -> float:
    return box[2] * _SIZE_IN[0] / (box[3] * _SIZE_IN[1])


def _all_of(world: World, aspect: float) -> View:
    """Return a view that holds all of a region."""
    assert world.bounds_m is not None
    west, south, east, north = world.bounds_m
    middle = np.array([(west + east) / 2, (south + north) / 2])
    half = 1.02 * max((north - south) / 2, (east - west) / 2 / aspect)
    return view_around(middle, half, aspect, close=east - west <= _DETAILED_M)


def _close_view(world: World) -> View:
    """Return a view of the junction that the World is made for, with its ways in and out."""
    points = _junction_points(world)
    low, high = points.min(axis=0), points.max(axis=0)
    aspect = _aspect(_MAIN_BOX)
    half = max((high - low)[1] / 2, (high - low)[0] / 2 / aspect) + _CLOSE_MARGIN_M
    half = min(max(half, _CLOSE_MIN_M), world.radius_m)
    return view_around((low + high) / 2, half, aspect, close=True)


def _junction_points(world: World) -> Array:
    if not world.junctions:
        return np.zeros((1, 2))
    junction = world.junctions[0]
    found = [c.centerline for c in world.connections if c.junction_id == junction.summary.id]
    if junction.area is not None:
        found.append(junction.area.outline)
    return np.concatenate([np.zeros((1, 2)), *found])
