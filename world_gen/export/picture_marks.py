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
from foretwin.contracts.terminal import visible
from foretwin.contracts.world import World, WorldJunction
from foretwin.world_gen.export import picture_style as style
from foretwin.world_gen.export.picture_fonts import FIXED, fonts_for
from foretwin.world_gen.export.picture_ground import HEIGHT_SCALE_M
from foretwin.world_gen.export.picture_style import Look, View
from foretwin.world_gen.report.report import JunctionReport, WorldReport
from foretwin.world_gen.report.text import subject_table

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
    look = Look(ha="center", va="bottom", fontsize=11)
    axes.text(x + size / 2, y + 0.008 * height, f"{size} m", zorder=10, bbox=_BOX, **look)


def north_arrow(axes: Axes) -> None:
    """Draw an arrow to the north at the upper right."""
    place = Look(xy=(0.97, 0.975), xytext=(0.97, 0.905), xycoords="axes fraction")
    look = Look(ha="center", va="center", fontsize=14, weight="bold", zorder=10)
    arrow = {"arrowstyle": "-|>", "lw": 2.5, "color": "black"}
    axes.annotate("N", arrowprops=arrow, bbox=_BOX, **place, **look)


def number_junctions(axes: Axes, world: World, view: View) -> None:
    """Write each junction's number, in the order of the panel's list, where it lies."""
    for number, junction in enumerate(world.junctions, start=1):
        at = local_from_geo(world.frame, junction.summary.lat, junction.summary.lon)
        if view.holds(at):
            place = Look(xytext=(7, 7), textcoords="offset points", annotation_clip=True)
            look = Look(fontsize=8.5, weight="bold", bbox={**_BOX, "pad": 0.8})
            axes.annotate(str(number), tuple(at), zorder=11, **place, **look)


def _line(colour: str, label: str, dash: Any = "-", width: float = 2.0) -> Line2D:
    return Line2D([], [], color=colour, linestyle=dash, linewidth=width, label=label)


def _dot(marker: str, edge: str, fill: str, label: str, size: float = 8.0) -> Line2D:
    mark = Look(marker=marker, markersize=size, markeredgewidth=1.4)
    mark |= {"color": fill, "markeredgecolor": edge}
    return Line2D([], [], linestyle="", label=label, **mark)


def _box(fill: str, label: str, edge: str | None = None, **look: Any) -> Patch:
    return Patch(facecolor=fill, edgecolor=edge, label=label, **look)


def draw_legend(figure: Figure) -> None:
    """Explain every colour, mark and pattern, in columns by subject."""
    sources = [
        _line("#222222", "tagged: said by the map"),
        _line("#222222", "inferred: follows from other tags", style.DASH["inferred"]),
        _line("#222222", "default: nothing says it", style.DASH["default"]),
        _dot("^", style.LANE, style.LANE, "filled mark: tagged"),
        _dot("^", style.LANE, "white", "hollow mark: inferred or default"),
        _dot("^", style.LANE, style.LANE, "driving direction", 6.0),
    ]
    lanes = [
        _line(style.LANE, "lane (dashes: where its number is from)"),
        _line("#b9bdc4", "lane edge (dashes: its width)"),
        _line(style.RING, "ring lane"),
        _line(style.BUS, "bus lane"),
        _line(style.BICYCLE, "bicycle lane"),
        _line(style.TRAM, "tram"),
    ]
    turns = [_line(c, f"turn: {t.replace('_', '-')}") for t, c in style.TURN_COLOUR.items()]
    turns += [
        _dot("x", style.CROSSING_CONFLICT, style.CROSSING_CONFLICT, "paths cross", 6.0),
        _dot("+", style.MERGING_CONFLICT, style.MERGING_CONFLICT, "paths merge", 7.0),
    ]
    waits = [
        _line(style.LINE_COLOUR["signal"], "stop line: signal", width=4.0),
        _line(style.LINE_COLOUR["stop"], "stop line: stop", width=4.0),
        _line(style.LINE_COLOUR["give_way"], "stop line: give way", width=4.0),
        _line(style.LINE_COLOUR["none"], "stop line: no control", width=2.2),
        _dot("o", style.SIGNAL, style.SIGNAL, "signal head, its group", 9.0),
        _dot("s", style.SIGNAL, style.SIGNAL, "signal on foot", 3.5),
    ]
    signs = [
        _dot("v", style.WAITS, style.WAITS, "gives way by a sign"),
        _dot("v", style.WAITS, "white", "gives way by a rule, no sign"),
        _dot("8", style.LINE_COLOUR["stop"], style.LINE_COLOUR["stop"], "stops by a sign"),
        _dot("D", style.WAITS, "white", "nobody first: near side goes", 7.0),
        _box("white", "crossing, marked", "#6f757d", hatch="|||"),
        _box("white", "crossing, unmarked", "#6f757d"),
    ]
    ground = [
        _box(style.ROAD, "road"),
        _box(style.JUNCTION, "junction"),
        _box(style.ISLAND, "island", style.ISLAND_EDGE),
        _box(style.SIDEWALK, "sidewalk", "none"),
        _box(style.ROAD, "bridge, above", style.DECK_EDGE, linewidth=1.6),
        _box(style.TUNNEL, "tunnel, below", alpha=0.4),
    ]
    beside = [
        _box(style.OPAQUE, "wall, hedge"),
        _box(style.SEEN_PAST, "tree, post, fence"),
        *(_box("none", "", "none") for _ in range(4)),
    ]
    heights = [
        _box(style.PARKING, "parking lane"),
        _box(_BUILDING, "height tagged", "#3f3226", linewidth=1.4),
        _box(_BUILDING, "height from levels", _GUESSED, hatch=style.HATCH["inferred"]),
        _box(_BUILDING, "height default", _GUESSED, hatch=style.HATCH["default"]),
        _box(_BUILDING, "open below", _GUESSED, alpha=0.35, linestyle=":"),
        _box("none", "", "none"),
    ]
    columns: list[list[Any]] = [sources, lanes, turns, waits, signs, ground, heights, beside]
    handles = [entry for column in columns for entry in column]
    place = Look(loc="lower left", bbox_to_anchor=(0.008, 0.022), ncols=len(columns))
    look = Look(fontsize=9.2, frameon=False, labelcolor="#222222")
    space = Look(columnspacing=1.3, handlelength=2.2, handletextpad=0.6)
    figure.legend(handles=handles, **place, **look, **space)


def draw_height_scale(figure: Figure, box: tuple[float, float, float, float]) -> None:
    """Draw the scale of building heights."""
    bar = figure.add_axes(box)
    scale = ScalarMappable(HEIGHT_SCALE_M, style.HEIGHT_COLOURS)
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
    heights = f"height tagged {b.tagged}, from levels {b.inferred}, default {b.default}"
    lines += ["", f"buildings: {heights}"]
    for note in report.notes:
        lines += _wrapped(f"note: {note.kind} ({note.count})", 6)
    room = _PANEL_LINES if world.bounds_m is None else 2 * _PANEL_LINES - 8
    text = visible("\n".join(_at_most(room, lines)))
    fonts = fonts_for(text)
    look = Look(fontsize=9.2, color="#222222", family=fonts.families(FIXED), linespacing=1.25)
    figure.text(0.612, top, fonts.drawable(text), va="top", parse_math=False, **look)


def _wrapped(text: str, indent: int) -> list[str]:
    return textwrap.wrap(text, _PANEL_COLUMNS, subsequent_indent=" " * indent)


def _at_most(room: int, lines: list[str]) -> list[str]:
    return lines if len(lines) <= room else [*lines[: room - 1], "… more in the report"]


def _listed(report: WorldReport) -> list[str]:
    """Return all junctions of a region, numbered as in the drawing."""
    lines = [f"{'':5}{'sure':6}{'kind':17}{'control':14}name"]
    for number, junction in enumerate(report.junctions, start=1):
        sure = "" if junction.confidence is None else f"{junction.confidence:.2f}"
        kind, control = junction.kind.replace("_", " "), junction.control.replace("_", " ")
        name = textwrap.shorten(junction.name or junction.id, 42, placeholder="…")
        lines.append(f"{number:4} {sure:6}{kind:17}{control:14}{name}")
    # Notes and buildings keep their place below a long list.
    return _at_most(2 * _PANEL_LINES - 20, lines)


def _described(world: World, junction: WorldJunction, report: JunctionReport) -> list[str]:
    lines = [
        f"{arm.id:4} {arm.name or 'unnamed'}: {arm.lanes_in} in, {arm.lanes_out} out"
        for arm in junction.arms[:8]
    ]
    lines += ["", *subject_table(report.subjects, head="this junction", width=16), ""]
    mine = {c.id for c in world.connections if c.junction_id == junction.summary.id}
    rules = Counter(c.rule.replace("_", " ") for c in world.conflicts if c.first_id in mine)
    if rules:
        counts = ", ".join(f"{rule} {n}" for rule, n in rules.most_common())
        lines += _wrapped(f"who waits: {counts}", 11)
    if junction.plan is not None:
        plan = junction.plan
        cycle = " | ".join(
            f"{'+'.join(g.rpartition(':')[2] for g in phase.green_group_ids)} {phase.green_s:g} s"
            for phase in plan.phases
        )
        words = f"signal plan ({plan.source}): {cycle}; "
        words += f"amber {plan.amber_s:g} s, all red {plan.all_red_s:g} s"
        lines += _wrapped(words, 4)
    return lines
