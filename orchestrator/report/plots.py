"""The plots of a report, by bokeh: they zoom, tell values, and print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models.annotations import BoxAnnotation, Span
from bokeh.models.tools import HoverTool
from bokeh.plotting import figure

from foretwin.contracts.arrays import Array, Flags
from foretwin.orchestrator.report.driven_track import CarTrack
from foretwin.orchestrator.report.gap_rows import HumanRow
from foretwin.sim_worker.analysis.gap.errors import ALL_MANOEUVRES, GapRow

COLOURS = ("#1f5fd0", "#c2185b", "#00857a", "#b26a00", "#8a3fb0", "#6d4c41", "#4c5560")
"""Of series, told apart by who sees colours differently too, by their lightness."""
_INK, _SOFT, _LINE = "#1c2530", "#5b6673", "#d9dee4"
_MOST_POINTS = 2000
_LABEL_WIDE = 0.03
"""Of the width of a plot: what a number takes beside a line."""


def plot(x_label: str, y_label: str, *, height: int = 260, **more: Any) -> Any:
    """Return an empty plot in the report's look."""
    drawn = figure(
        height=height,
        sizing_mode="stretch_width",
        x_axis_label=x_label,
        y_axis_label=y_label,
        tools="pan,box_zoom,wheel_zoom,reset,save",
        active_scroll=None,
        output_backend="svg",
        **more,
    )
    drawn.toolbar.logo = None
    drawn.toolbar.autohide = True
    drawn.outline_line_color = None
    drawn.grid.grid_line_color = _LINE
    for axis in drawn.axis:
        axis.axis_line_color = axis.major_tick_line_color = _SOFT
        axis.minor_tick_line_color = None
        axis.axis_label_text_color = axis.major_label_text_color = _SOFT
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "13px"
    return drawn


def _with_legend(drawn: Any) -> Any:
    drawn.legend.click_policy = "hide"
    drawn.legend.border_line_color = None
    drawn.legend.background_fill_alpha = 0.85
    drawn.legend.label_text_font_size = "13px"
    drawn.legend.label_text_color = _INK
    drawn.legend.spacing = 0
    return drawn


def _thinned(*columns: Array) -> tuple[Array, ...]:
    step = max(1, len(columns[0]) // _MOST_POINTS)
    return tuple(np.asarray(column)[::step] for column in columns)


def drive_plot(track: CarTrack, arrivals: Sequence[tuple[int, float]]) -> Any:
    """Return the speed over drive time, with a line where the car was at each junction."""
    drawn = plot("drive time, s", "speed, km/h", height=230)
    time_s, speed = _thinned(track.time_s, track.speed_mps * 3.6)
    drawn.line(np.round(time_s, 2), np.round(speed, 2), color=COLOURS[0], line_width=2)
    lasts_s, fastest = float(np.ptp(track.time_s)), float(np.abs(speed).max(initial=1.0))
    level, before_s = 0, -np.inf
    for number, at_s in sorted(arrivals, key=lambda one: one[1]):
        # Numbers of junctions that follow each other closely stand above each other.
        level = level + 1 if at_s - before_s < _LABEL_WIDE * lasts_s else 0
        before_s = at_s
        drawn.add_layout(
            Span(location=at_s, dimension="height", line_color=_SOFT, line_dash="dotted")
        )
        drawn.text(
            x=[at_s],
            y=[0.12 * fastest * level],
            text=[f" {number}"],
            text_color=_SOFT,
            text_font_size="13px",
        )
    drawn.add_tools(
        HoverTool(tooltips=[("time", "@x{0.0} s"), ("speed", "@y{0.0} km/h")], mode="vline")
    )
    return drawn


def latency_plot(time_s: Array, latency_ms: Array, late: Flags, period_ms: float | None) -> Any:
    """Return what each round took over drive time, with the period that was due."""
    drawn = plot("drive time, s", "state to result, ms", height=230)
    for which, colour, label in ((~late, COLOURS[0], "in time"), (late, COLOURS[1], "late")):
        if which.any():
            x, y = _thinned(time_s[which], latency_ms[which])
            drawn.scatter(
                np.round(x, 2), np.round(y, 1), color=colour, size=5, alpha=0.75, legend_label=label
            )
    if period_ms is not None:
        drawn.add_layout(
            Span(location=period_ms, dimension="width", line_color=_SOFT, line_dash="dashed")
        )
    drawn.add_tools(HoverTool(tooltips=[("time", "@x{0.0} s"), ("took", "@y{0} ms")]))
    return _with_legend(drawn)


def gap_plot(found: Sequence[GapRow], people: Sequence[HumanRow]) -> Any:
    """Return the gap of place over the horizon, a line for each manoeuvre, and people beside."""
    drawn = plot("model left to itself, s", "gap of place (RMS), m", height=300)
    for place, name in enumerate(dict.fromkeys(one.manoeuvre for one in found)):
        mine = [one for one in found if one.manoeuvre == name]
        look = {
            "color": _INK if name == ALL_MANOEUVRES else COLOURS[place % len(COLOURS)],
            "legend_label": name,
        }
        x = [one.horizon_s for one in mine]
        y = [round(one.rms["position_m"], 3) for one in mine]
        drawn.line(x, y, line_width=3 if name == ALL_MANOEUVRES else 1.6, **look)
        drawn.scatter(x, y, size=7, **look)
    known = [one for one in people if one.along_m is not None and one.across_m is not None]
    if known:
        x = [one.horizon_s for one in known]
        y = [round(float(np.hypot(one.along_m or 0.0, one.across_m or 0.0)), 3) for one in known]
        look = {"color": _SOFT, "legend_label": "two people on this road"}
        drawn.line(x, y, line_dash="dashed", line_width=2, **look)
        drawn.scatter(x, y, marker="diamond", size=9, **look)
    drawn.add_tools(HoverTool(tooltips=[("after", "@x s"), ("gap", "@y m")]))
    drawn.legend.location = "top_left"
    return _with_legend(drawn)


def rank_plot(shares: Sequence[float]) -> Any:
    """Return the rank histogram of forecasts; level is right."""
    drawn = plot("tenth of its forecast", "share of what came, %", height=220)
    edges = np.arange(len(shares) + 1)
    percent = np.round(100.0 * np.asarray(shares), 1)
    drawn.quad(
        left=edges[:-1] + 0.05,
        right=edges[1:] - 0.05,
        bottom=0,
        top=percent,
        color=COLOURS[0],
        alpha=0.8,
    )
    drawn.add_layout(
        Span(
            location=100.0 / max(len(shares), 1),
            dimension="width",
            line_color=_SOFT,
            line_dash="dashed",
        )
    )
    drawn.y_range.start = 0
    drawn.add_tools(HoverTool(tooltips=[("share", "@top %")]))
    return drawn


def calibration_plot(by_horizon: Mapping[str, Mapping[str, float]]) -> Any:
    """Return the share within p10 to p90 by how far ahead; 80 % is right."""
    drawn = plot("ahead, s", "within p10 to p90, %", height=220, y_range=(0, 100))
    x = [float(horizon) for horizon in by_horizon]
    y = [round(100.0 * one["p10_p90_coverage"], 1) for one in by_horizon.values()]
    drawn.add_layout(BoxAnnotation(bottom=75, top=85, fill_color=COLOURS[2], fill_alpha=0.12))
    drawn.line(x, y, color=COLOURS[0], line_width=2)
    drawn.scatter(x, y, color=COLOURS[0], size=7)
    drawn.add_tools(HoverTool(tooltips=[("ahead", "@x s"), ("within", "@y %")]))
    return drawn


def histogram_plot(values: Mapping[str, Array], label: str) -> Any:
    """Return how the values of several spread, as steps over the same bins."""
    drawn = plot(label, "futures", height=240)
    every = np.concatenate([*values.values(), np.zeros(0)])
    if not len(every):
        return drawn
    low, high = float(every.min()), float(every.max())
    edges = np.linspace(low, high if high > low else low + 1.0, 25)
    for place, (name, mine) in enumerate(values.items()):
        counts, _ = np.histogram(mine, edges)
        drawn.step(
            np.round(edges, 4),
            np.r_[counts, counts[-1:]],
            mode="after",
            line_width=2,
            color=COLOURS[place % len(COLOURS)],
            legend_label=name,
        )
    drawn.y_range.start = 0
    return _with_legend(drawn)
