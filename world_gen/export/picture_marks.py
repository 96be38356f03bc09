"""What explains a picture of a World: legend, scale bar, north arrow, and a panel of text."""

from __future__ import annotations

import textwrap
from collections import Counter
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.world import World, WorldJunction
from foretwin.world_gen.export.picture_style import (
    BICYCLE,
    BUS,
    CROSSING_CONFLICT,
    DASH,
    DECK_EDGE,
    HATCH,
    HEIGHT_COLOURS,
    HEIGHT_SCALE_M,
    ISLAND,
    ISLAND_EDGE,
    JUNCTION,
    LANE,
    LINE_COLOUR,
    MERGING_CONFLICT,
    PARKING,
    RING,
    ROAD,
    SIDEWALK,
    SIGNAL,
    TRAM,
    TUNNEL,
    TURN_COLOUR,
    WAITS,
    View,
)
from foretwin.world_gen.report.report import JunctionReport, WorldReport

_BUILDING, _GUESSED = "#f3cf8e", "#8a7762"
_PANEL_COLUMNS, _PANEL_LINES = 84, 32
_BOX = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 2.0}


def scale_bar(axes: Axes, view: View) -> None:
    """Draw a bar of a round length at the lower left."""
    sizes = (5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
    size = next((s for s in sizes if s >= view.width_m / 12), sizes[-1])
    height = view.north_m - view.south_m
    x, y = view.west_m + 0.025 * view.width_m, view.south_m + 0.03 * height
    axes.plot([x, x + size], [y, y], color="black", linewidth=4, solid_capstyle="butt", zorder=10)
    axes.text(
        x + size / 2,
        y + 0.008 * height,
        f"{size} m",
        ha="center",
        va="bottom",
        fontsize=11,
        zorder=10,
        bbox=_BOX,
    )


def north_arrow(axes: Axes) -> None:
    """Draw an arrow to the north at the upper right."""
    axes.annotate(
        "N",
        xy=(0.97, 0.975),
        xytext=(0.97, 0.905),
        xycoords="axes fraction",
        ha="center",
        va="center",
        fontsize=14,
        weight="bold",
        zorder=10,
        arrowprops={"arrowstyle": "-|>", "lw": 2.5, "color": "black"},
        bbox=_BOX,
    )


def number_junctions(axes: Axes, world: World, view: View) -> None:
    """Write each junction's number, in the order of the panel's list, where it lies."""
    for number, junction in enumerate(world.junctions, start=1):
        at = local_from_geo(world.frame, junction.summary.lat, junction.summary.lon)
        if view.holds(at):
            axes.annotate(
                str(number),
                tuple(at),
                xytext=(7, 7),
                textcoords="offset points",
                fontsize=8.5,
                weight="bold",
                zorder=11,
                bbox={**_BOX, "pad": 0.8},
                annotation_clip=True,
            )


def _line(colour: str, label: str, style: Any = "-", width: float = 2.0) -> Line2D:
    return Line2D([], [], color=colour, linestyle=style, linewidth=width, label=label)


def _dot(marker: str, edge: str, fill: str, label: str, size: float = 8.0) -> Line2D:
    return Line2D(
        [],
        [],
        marker=marker,
        linestyle="",
        color=fill,
        markeredgecolor=edge,
        markersize=size,
        markeredgewidth=1.4,
        label=label,
    )


def draw_legend(figure: Figure) -> None:
    """Explain every colour, mark and pattern, in columns by subject."""
    sources = [
        _line("#222222", "tagged: said by the map"),
        _line("#222222", "inferred: follows from other tags", DASH["inferred"]),
        _line("#222222", "default: nothing says it", DASH["default"]),
        _dot("^", LANE, LANE, "filled mark: tagged"),
        _dot("^", LANE, "white", "hollow mark: inferred or default"),
        _dot("^", LANE, LANE, "driving direction", 6.0),
    ]
    lanes = [
        _line(LANE, "lane (dashes: where its number is from)"),
        _line("#b9bdc4", "lane edge (dashes: its width)"),
        _line(RING, "ring lane"),
        _line(BUS, "bus lane"),
        _line(BICYCLE, "bicycle lane"),
        _line(TRAM, "tram"),
    ]
    turns = [_line(c, f"turn: {t.replace('_', '-')}") for t, c in TURN_COLOUR.items()]
    turns += [
        _dot("x", CROSSING_CONFLICT, CROSSING_CONFLICT, "paths cross", 6.0),
        _dot("+", MERGING_CONFLICT, MERGING_CONFLICT, "paths merge", 7.0),
    ]
    waits = [
        *(
            _line(LINE_COLOUR[name], f"stop line: {words}", width=4.0)
            for name, words in (("signal", "signal"), ("stop", "stop"), ("give_way", "give way"))
        ),
        _line(LINE_COLOUR["none"], "stop line: no control", width=2.2),
        _dot("o", SIGNAL, SIGNAL, "signal head, its group", 9.0),
        _dot("s", SIGNAL, SIGNAL, "signal on foot", 3.5),
    ]
    signs = [
        _dot("v", WAITS, WAITS, "gives way by a sign"),
        _dot("v", WAITS, "white", "gives way by a rule, no sign"),
        _dot("8", LINE_COLOUR["stop"], LINE_COLOUR["stop"], "stops by a sign"),
        _dot("D", WAITS, "white", "nobody first: near side goes", 7.0),
        Patch(facecolor="white", edgecolor="#6f757d", hatch="|||", label="crossing, marked"),
        Patch(facecolor="white", edgecolor="#6f757d", label="crossing, unmarked"),
    ]
    ground: list[Any] = [
        Patch(facecolor=ROAD, label="road"),
        Patch(facecolor=JUNCTION, label="junction"),
        Patch(facecolor=ISLAND, edgecolor=ISLAND_EDGE, label="island"),
        Patch(facecolor=SIDEWALK, edgecolor="none", label="sidewalk"),
        Patch(facecolor=ROAD, edgecolor=DECK_EDGE, linewidth=1.6, label="bridge, above"),
        Patch(facecolor=TUNNEL, alpha=0.4, label="tunnel, below"),
    ]
    heights = [
        Patch(facecolor=_BUILDING, edgecolor="#3f3226", linewidth=1.4, label="height tagged"),
        Patch(
            facecolor=_BUILDING,
            edgecolor=_GUESSED,
            hatch=HATCH["inferred"],
            label="height from levels",
        ),
        Patch(
            facecolor=_BUILDING, edgecolor=_GUESSED, hatch=HATCH["default"], label="height default"
        ),
        Patch(
            facecolor=_BUILDING, alpha=0.35, linestyle=":", edgecolor=_GUESSED, label="open below"
        ),
    ]
    heights.insert(0, Patch(facecolor=PARKING, label="parking lane"))
    heights.append(Patch(facecolor="none", edgecolor="none", label=""))
    columns: list[list[Any]] = [sources, lanes, turns, waits, signs, ground, heights]
    figure.legend(
        handles=[entry for column in columns for entry in column],
        loc="lower left",
        bbox_to_anchor=(0.008, 0.022),
        ncols=len(columns),
        fontsize=9.2,
        frameon=False,
        columnspacing=1.3,
        handlelength=2.2,
        handletextpad=0.6,
        labelcolor="#222222",
    )


def draw_height_scale(figure: Figure, box: tuple[float, float, float, float]) -> None:
    """Draw the scale of building heights."""
    bar = figure.add_axes(box)
    scale = ScalarMappable(HEIGHT_SCALE_M, HEIGHT_COLOURS)
    figure.colorbar(scale, cax=bar, orientation="horizontal")
    bar.set_xlabel("building height in m (40 and more: darkest)", fontsize=9)
    bar.tick_params(labelsize=8)


def draw_panel(figure: Figure, world: World, report: WorldReport, *, top: float) -> None:
    """List what a junction, or all of a region, is made of, what was guessed, and the notes."""
    if world.bounds_m is not None:
        lines = _listed(report)
    elif world.junctions:
        lines = _described(world, world.junctions[0], report.junctions[0])
    else:
        lines = []
    b = report.buildings
    lines += [
        "",
        f"buildings: height tagged {b.tagged}, from levels {b.inferred}, default {b.default}",
    ]
    for note in report.notes:
        lines += textwrap.wrap(
            f"{note.kind} ({note.count})",
            _PANEL_COLUMNS,
            initial_indent="note: ",
            subsequent_indent="      ",
        )
    room = _PANEL_LINES if world.bounds_m is None else 2 * _PANEL_LINES - 8
    if len(lines) > room:
        lines = [*lines[: room - 1], "… more in the report"]
    figure.text(
        0.612,
        top,
        "\n".join(lines),
        fontsize=9.2,
        va="top",
        color="#222222",
        linespacing=1.25,
        family="monospace",
    )


def _listed(report: WorldReport) -> list[str]:
    """Return all junctions of a region, numbered as in the drawing."""
    lines = [f"{'':5}{'sure':6}{'kind':17}{'control':14}name"]
    for number, junction in enumerate(report.junctions, start=1):
        sure = "" if junction.confidence is None else f"{junction.confidence:.2f}"
        kind, control = junction.kind.replace("_", " "), junction.control.replace("_", " ")
        name = textwrap.shorten(junction.name or junction.id, 42, placeholder="…")
        lines.append(f"{number:4} {sure:6}{kind:17}{control:14}{name}")
    # Notes and buildings keep their place below a long list.
    room = 2 * _PANEL_LINES - 20
    return lines if len(lines) <= room else [*lines[: room - 1], "… more in the report"]


def _described(world: World, junction: WorldJunction, report: JunctionReport) -> list[str]:
    lines = [
        f"{arm.id:4} {arm.name or 'unnamed'}: {arm.lanes_in} in, {arm.lanes_out} out"
        for arm in junction.arms[:8]
    ]
    lines += ["", *_table(report), ""]
    mine = {c.id for c in world.connections if c.junction_id == junction.summary.id}
    rules = Counter(c.rule.replace("_", " ") for c in world.conflicts if c.first_id in mine)
    if rules:
        told = ", ".join(f"{rule} {n}" for rule, n in rules.most_common())
        lines += textwrap.wrap(f"who waits: {told}", _PANEL_COLUMNS, subsequent_indent=" " * 11)
    if junction.plan is not None:
        plan = junction.plan
        cycle = " | ".join(
            f"{'+'.join(g.rpartition(':')[2] for g in phase.green_group_ids)} {phase.green_s:g} s"
            for phase in plan.phases
        )
        told = f"signal plan ({plan.source}): {cycle}; "
        told += f"amber {plan.amber_s:g} s, all red {plan.all_red_s:g} s"
        lines += textwrap.wrap(told, _PANEL_COLUMNS, subsequent_indent=" " * 4)
    return lines


def _table(junction: JunctionReport) -> list[str]:
    return [
        f"{'this junction':16}{'tagged':>8}{'inferred':>10}{'default':>9}{'confidence':>12}",
        *(
            f"{s.subject:16}{s.tagged:8}{s.inferred:10}{s.default:9}{s.confidence:12.2f}"
            for s in junction.subjects
        ),
    ]
