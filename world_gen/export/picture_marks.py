"""What explains a picture of a World: its colours, legend, scale bar, north arrow, notes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from contracts.world import Provenance, Turn, World

GROUND, ROAD, JUNCTION, KERB = "#e9ece4", "#c9ccd1", "#b9bdc4", "#7c828a"
LANE_EDGE, LANE, BUS, RING = "#ffffff", "#4c5560", "#a8326e", "#2b6f9e"
ISLAND, ISLAND_EDGE = "#b7cfa1", "#6f8f56"
TURN_COLOUR: Mapping[Turn, str] = {
    "straight": "#2a7f3f",
    "left": "#1f5fd0",
    "right": "#d8781a",
    "u_turn": "#8a3fb0",
}
LINE_COLOUR: Mapping[str, str] = {
    "signal": "#d62728",
    "stop": "#8b0000",
    "give_way": "#e3a100",
    "none": "#6b7280",
}
HATCH: Mapping[Provenance, str | None] = {"tagged": None, "inferred": "///", "default": "xxx"}
HEIGHT_SCALE_M = Normalize(0.0, 40.0, clip=True)
HEIGHT_COLOURS = "YlOrBr"


def scale_bar(axes: Axes, reach: float) -> None:
    """Draw a bar of a round length at the lower left; `reach` is half the view in metres."""
    size = next(s for s in (5, 10, 20, 50, 100, 200, 500) if s >= reach / 6 or s == 500)
    x, y = -0.95 * reach, -0.94 * reach
    axes.plot([x, x + size], [y, y], color="black", linewidth=4, solid_capstyle="butt", zorder=10)
    axes.text(
        x + size / 2, y + 0.015 * reach, f"{size} m", ha="center", va="bottom", fontsize=12,
        zorder=10,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.5},
    )  # fmt: skip


def north_arrow(axes: Axes) -> None:
    """Draw an arrow to the north at the upper right."""
    axes.annotate(
        "N", xy=(0.965, 0.975), xytext=(0.965, 0.905), xycoords="axes fraction",
        ha="center", va="center", fontsize=15, weight="bold", zorder=10,
        arrowprops={"arrowstyle": "-|>", "lw": 2.5, "color": "black"},
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 2.0},
    )  # fmt: skip


def draw_legend(figure: Figure, world: World) -> None:
    """Explain every colour and pattern, and the scale of building heights."""

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
        line(colour, f"connection: {turn.replace('_', '-')}")
        for turn, colour in TURN_COLOUR.items()
    ]
    entries += [
        line(LANE, "lane, width tagged"),
        line(LANE, "lane, width inferred", (0, (5, 3))),
        line(RING, "ring lane", (0, (5, 3))),
        line(BUS, "bus lane", (0, (5, 3))),
    ]
    entries += [
        line(
            colour,
            f"stop line: {'no control' if name == 'none' else name.replace('_', ' ')}",
            "-",
            4.0,
        )
        for name, colour in LINE_COLOUR.items()
    ]
    entries += [
        line("#555555", "control inferred", (0, (1.2, 0.7)), 4.0),
        dot("#d62728", "signal tagged (with its group)"),
        dot("white", "signal inferred"),
        Patch(facecolor="white", edgecolor="#9097a0", hatch="|||", label="crossing"),
        Patch(facecolor=ISLAND, edgecolor=ISLAND_EDGE, label="island"),
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
    figure.colorbar(
        ScalarMappable(HEIGHT_SCALE_M, HEIGHT_COLOURS), cax=bar, orientation="horizontal"
    )
    bar.set_xlabel("building height in m", fontsize=10)


def draw_notes(figure: Figure, world: World) -> None:
    """List the arms, how much was guessed, and the World's notes."""
    guessed = sum(lane.width_m.source != "tagged" for lane in world.lanes)
    heights = [b.height_m.source for b in world.buildings]
    lines = [
        f"arm {arm.id}: {arm.name or 'unnamed'}, {arm.lanes_in} in, {arm.lanes_out} out"
        for arm in world.junctions[0].arms[:8]
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
