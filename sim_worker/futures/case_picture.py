"""A case of a scenario seen from above: who starts where, and what becomes of it.

The ego is blue where it keeps its speed, green where a planner drives it; others are red, those
that stand brown. Starts are hollow, the moment of the impact, or the closest one, is full.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from foretwin.contracts.arrays import Array
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.terminal import plain, visible
from foretwin.contracts.world import World
from foretwin.geometry.polyline import offset
from foretwin.geometry.rectangles import Rectangles, corners
from foretwin.sim_worker.futures.case_picture_runs import Run, box_at
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.world_gen.export.picture_ground import draw_ground
from foretwin.world_gen.export.picture_marks import scale_bar
from foretwin.world_gen.export.picture_style import LANE_EDGE, LINE_COLOUR, View, view_around

EGO, PLANNED, OTHERS, STANDING, IMPACT = "#1f5fd0", "#0b8a4b", "#d62728", "#7a4b22", "#ffd400"
_LEAST_HALF_M, _MOST_HALF_M, _MARGIN_M = 20.0, 75.0, 8.0
_GHOST_EVERY_S = 1.0


def draw_case(
    axes: Axes,
    played: StagedCase,
    world: World,
    heedless: Run,
    planned: Run | None,
    *,
    aspect: float,
    view: View | None = None,
) -> None:
    """Draw one case in its World; `aspect` is the width of the axes over their height.

    Without a `view`, it holds what happens, but for who comes from afar.
    """
    view = view or _view(heedless, planned, aspect)
    draw_ground(axes, world, view)
    draw_lanes(axes, world, view)
    _draw_paths(axes, played)
    _draw_run(axes, heedless.ego, EGO, heedless.moment, above=13.0)
    if planned is not None:
        _draw_run(axes, planned.ego, PLANNED, planned.moment, above=12.8)
    _draw_ghosts(axes, heedless, heedless.ego, EGO)
    for number, actor in enumerate(played.actors):
        track = heedless.others[number]
        if actor.speed_mps <= 0.0:
            _draw_full(axes, track, STANDING, heedless.moment, above=12.9)
            continue
        _draw_run(axes, track, OTHERS, heedless.moment, width=1.3, start_above=12.2, above=12.9)
        _draw_ghosts(axes, heedless, track, OTHERS)
        if planned is not None:
            box = box_at(planned.others[number], planned.moment)
            _draw_outline(axes, box, PLANNED, linewidth=1.4, zorder=13.1)
    if played.impact_with:
        mark: dict[str, Any] = {"marker": "*", "markersize": 11.0, "markeredgecolor": "black"}
        axes.plot(*played.impact_point_m, color=IMPACT, markeredgewidth=0.7, zorder=14.0, **mark)
    scale_bar(axes, view)


def _draw_run(
    axes: Axes,
    track: Rectangles,
    colour: str,
    moment: int,
    *,
    above: float,
    width: float = 1.6,
    start_above: float = 12.1,
) -> None:
    """Draw the line of a box, its start, and where it is at the moment."""
    axes.plot(*track.centre_m.T, color=colour, linewidth=width, zorder=12.0)
    _draw_outline(axes, box_at(track, 0), colour, linewidth=1.1, zorder=start_above)
    _draw_full(axes, track, colour, moment, above=above)


def _draw_full(axes: Axes, track: Rectangles, colour: str, moment: int, *, above: float) -> None:
    style: dict[str, Any] = {"edgecolor": "black", "linewidth": 0.7, "alpha": 0.85}
    draw_box(axes, box_at(track, moment), facecolor=colour, zorder=above, **style)


def _draw_ghosts(axes: Axes, run: Run, track: Rectangles, colour: str) -> None:
    """Draw a box at whole seconds between the start and the moment."""
    every = max(1, round(_GHOST_EVERY_S / float(run.time_s[1] - run.time_s[0])))
    for instant in range(every, run.moment, every):
        ghost = box_at(track, instant)
        _draw_outline(axes, ghost, colour, linewidth=0.5, alpha=0.55, zorder=12.0)


def _draw_outline(axes: Axes, box: Rectangles, colour: str, **style: float) -> None:
    draw_box(axes, box, facecolor="none", edgecolor=colour, **style)


def caption(played: StagedCase, heedless: Run, planned: Run | None, planner: str) -> str:
    """Say in one line each who is how fast, what is planned, and what the planner makes of it."""
    moving = [
        f"ego {3.6 * played.ego_speed_mps:.0f} km/h{' backwards' if played.place.reverse else ''}"
    ]
    moving += [
        f"{_words(a.name)} {3.6 * a.speed_mps:.0f} km/h" for a in played.actors if a.speed_mps > 0.0
    ]
    lines = [", ".join(moving) + _faults(played)]
    if played.impact_with:
        hit = f"{_words(played.impact_with)} after {played.impact_time_s:.1f} s"
        lines.append(f"keeping its speed: hits {hit}")
    elif played.actors:
        lines.append(f"keeping its speed: {heedless.clearance_m:.1f} m to the nearest")
    else:
        lines.append("keeping its speed: alone")
    if planned is not None:
        end = f"hits {planned.collision_with} after {planned.collision_s:.1f} s"
        if not planned.collision_with:
            end = "no collision"
            if np.isfinite(planned.clearance_m):
                end += f", {planned.clearance_m:.1f} m to the nearest"
        lines.append(f"{planner}: {end}")
    return "\n".join(lines)


def write_case_picture(
    path: Path,
    played: StagedCase,
    scenario: Scenario,
    world: World,
    heedless: Run,
    planned: Run | None,
    *,
    planner: str,
) -> None:
    """Write one case as PNG, with its legend and the map's attribution."""
    figure, axes = upright_figure(0.1, 0.77)
    draw_case(axes, played, world, heedless, planned, aspect=0.96 * 9.0 / 7.7)
    where = world.intersection.name or played.place.junction_id
    figure.text(
        0.02,
        0.965,
        f"{scenario.title}: {plain(where)}",
        fontsize=13,
        weight="bold",
        parse_math=False,
    )
    words = caption(played, heedless, planned, planner)
    figure.text(0.02, 0.88, f"{scenario.shows}\n{visible(words)}", fontsize=9.5, parse_math=False)
    draw_case_legend(figure, planner if planned is not None else "", ncols=3)
    write_upright(figure, path, world)


def upright_figure(bottom: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure of 9 by 10 inches with axes from a share of its height on."""
    figure = Figure(figsize=(9.0, 10.0), dpi=110, facecolor="white")
    return figure, figure.add_axes((0.02, bottom, 0.96, height))


def write_upright(figure: Figure, path: Path, world: World) -> None:
    """Write a figure as PNG with the attribution of the World's map."""
    figure.text(
        0.98,
        0.012,
        plain(world.attribution),
        fontsize=9,
        ha="right",
        weight="bold",
        parse_math=False,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Copyright": world.attribution, "Software": "foretwin"}
    FigureCanvasAgg(figure).print_figure(str(path), format="png", metadata=metadata)


def draw_case_legend(figure: Figure, planner: str, *, ncols: int = 4) -> None:
    """Explain the colours at the figure's lower edge."""
    boxes = [
        (EGO, "black", "ego, keeping its speed"),
        (OTHERS, "black", "others at the impact, or when nearest"),
        (STANDING, "black", "standing"),
        ("none", EGO, "start (hollow), each second (faint)"),
    ]
    if planner:
        boxes[1:1] = [
            (PLANNED, "black", f"ego by {planner}, when nearest"),
            ("none", PLANNED, "others at that moment"),
        ]
    handles: list[Any] = [
        Patch(facecolor=face, edgecolor=edge, label=label) for face, edge, label in boxes
    ]
    star: dict[str, Any] = {
        "marker": "*",
        "linestyle": "",
        "markersize": 10,
        "markeredgecolor": "black",
    }
    handles.append(Line2D([], [], color=IMPACT, label="planned impact", **star))
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.012, 0.0), "ncols": ncols}
    figure.legend(
        handles=handles, fontsize=8.5, frameon=False, columnspacing=1.2, handlelength=1.6, **place
    )


def _words(name: str) -> str:
    return name.replace("_", " ")


def _faults(played: StagedCase) -> str:
    """Name the faults of the case that are not none."""
    said = [
        f"{_words(field)} {value:.2g}"
        for name, value in played.values.items()
        if name.startswith("faults.")
        and value != FUTURE_NUMBERS[field := name.removeprefix("faults.")].neutral
    ]
    return f"; {', '.join(said)}" if said else ""


def _view(heedless: Run, planned: Run | None, aspect: float) -> View:
    """Return a view that holds what happens; who comes from afar comes in from beyond its edge."""
    points = [heedless.ego.centre_m[[0, heedless.moment]]]
    points += [box.centre_m[[0, heedless.moment]] for box in heedless.others]
    if planned is not None:
        points.append(planned.ego.centre_m[planned.moment][None])
    middle = heedless.ego.centre_m[heedless.moment]
    spread = np.clip(
        np.concatenate(points), middle - 1.6 * _MOST_HALF_M, middle + 1.6 * _MOST_HALF_M
    )
    centre, half = framed(spread, aspect)
    reach = 0.75 * half * np.array([aspect, 1.0])
    return view_around(np.clip(centre, middle - reach, middle + reach), half, aspect, close=False)


def framed(xy_m: Array, aspect: float) -> tuple[Array, float]:
    """Return the middle (2,) of points (N, 2), and half the height of a picture that shows them."""
    low, high = xy_m.min(axis=0) - _MARGIN_M, xy_m.max(axis=0) + _MARGIN_M
    half = max((high - low)[1] / 2.0, (high - low)[0] / 2.0 / aspect)
    return (low + high) / 2.0, min(max(half, _LEAST_HALF_M), _MOST_HALF_M)


def draw_lanes(axes: Axes, world: World, view: View) -> None:
    """Draw the edges of lanes, and stop lines."""
    lines = [
        offset(lane.centerline, side * lane.width_m.value / 2.0)
        for lane in world.lanes
        if view.meets(lane.centerline)
        for side in (1.0, -1.0)
    ]
    axes.add_collection(LineCollection(lines, colors=LANE_EDGE, linewidths=0.7, zorder=4.5))
    for stop in world.stop_lines:
        if view.holds(stop.ends):
            colour = LINE_COLOUR.get(stop.control.value, LINE_COLOUR["none"])
            axes.plot(*stop.ends.T, color=colour, linewidth=1.8, solid_capstyle="butt", zorder=6.0)


def _draw_paths(axes: Axes, played: StagedCase) -> None:
    style: dict[str, Any] = {
        "linewidth": 0.8,
        "linestyle": (0, (4, 3)),
        "alpha": 0.7,
        "zorder": 11.0,
    }
    axes.plot(*played.place.ego.xy_m.T, color=EGO, **style)
    for actor in played.actors:
        if actor.speed_mps > 0.0:
            axes.plot(*actor.xy_m.T, color=OTHERS, **style)


def draw_box(axes: Axes, box: Rectangles, **style: Any) -> None:
    """Draw the outlines of boxes."""
    outline: Array = corners(box)
    axes.add_collection(PolyCollection(list(outline), **style))
