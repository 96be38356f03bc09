"""The layout: junction, chase and map on the left, gaps and comparisons on the right."""

from __future__ import annotations

from typing import Literal, get_args

import rerun as rr
import rerun.blueprint as rrb

from foretwin.contracts import drive
from foretwin.viewer.rows import TIMELINE

MainView = Literal["Intersection", "Chase", "Map"]
DetailView = Literal["Comparison", "Scenarios", "Reality", "Parameters"]
DETAIL_VIEWS: tuple[str, ...] = get_args(DetailView)
MAIN_VIEWS: tuple[str, ...] = get_args(MainView)
GAP_VIEWS = {
    "pos_m": "Position gap, m",
    "yaw_deg": "Heading gap, deg",
    "speed_mps": "Speed gap, m/s",
}
PARAMETER_VIEWS = {
    "steering_ratio": "Steering ratio",
    "drive_gain": "Drive gain",
    "brake_gain": "Brake gain",
}
BACKGROUND = (16, 18, 24)


def drive_blueprint(
    *, main: MainView = "Intersection", detail: DetailView = "Comparison"
) -> rrb.Blueprint:
    """Return the layout with `main` on top on the left and `detail` below the gap plots.

    The intersection view looks at the entity /world/focus, which lies between the car and the
    junction at every instant, so it follows the drive also when a recording is scrubbed.
    """
    last_30_s = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-30.0),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    all_along = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    intersection = _space("Intersection", "/world/focus", eye_m=(-19.0, -26.0, 88.0))
    chase = _space("Chase", "/world/ego/real", eye_m=(-17.0, 0.0, 9.0), target_m=(7.0, 0.0, 0.0))
    # Rerun's own map view fetches tiles from the internet, which tells where the car is: seen from
    # straight above, the World needs none. /geo is recorded for those who add a map view.
    overview = _space("Map", "/world/focus", "/map/**", eye_m=(0.0, 0.0, 330.0), up=(0.0, 1.0, 0.0))
    gaps = [
        _plot(f"/gap/{quantity}", name, last_30_s, legend=quantity == "pos_m")
        for quantity, name in GAP_VIEWS.items()
    ]
    comparison, short = (
        rrb.Horizontal(
            *(
                _plot(f"/comparison/ade_m/{s}", f"ADE at {s} s, m", last_30_s, legend=s == first)
                for s in (first, 2 * first)
            ),
            name=name,
        )
        for name, first in (("Comparison", 4), ("Short horizons", 1))
    )
    reality = rrb.Vertical(
        rrb.Horizontal(
            _plot("/reality/across_m", "Across after 2 s, m", all_along, legend=True),
            _plot("/reality/yaw_deg", "Heading after 2 s, deg", all_along, legend=False),
        ),
        rrb.TextDocumentView(origin="/reality/verdict", name="Verdict"),
        name="Reality",
    )
    parameters = rrb.Vertical(
        rrb.Horizontal(
            *(
                _plot(f"/parameters/{name}", title, all_along, legend=False)
                for name, title in PARAMETER_VIEWS.items()
            )
        ),
        rrb.TextDocumentView(origin="/parameters/table", name="Table"),
        name="Parameters",
    )
    details = ("Comparison", "Short", "Plan", "Scenarios", "Correction", "Reality", "Parameters")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.TextDocumentView(origin="/status", name="Status", titlebar=False),
                rrb.Tabs(intersection, chase, overview, active_tab=main),
                rrb.Tabs(
                    rrb.StateTimelineView(origin="/workers/state", name="Workers"),
                    rrb.TextLogView(origin="/events", name="Events"),
                    rrb.TimeSeriesView(
                        origin="/workers/rtf", name="Real-time factor", time_ranges=last_30_s
                    ),
                    rrb.TimeSeriesView(origin="/workers/memory_mb", name="Memory, MB"),
                    active_tab="Workers",
                ),
                row_shares=[0.32, 6.0, 1.7],
            ),
            rrb.Vertical(
                *gaps,
                rrb.Tabs(
                    comparison,
                    short,
                    _plot("/comparison/plan", "Plan", last_30_s, legend=True),
                    rrb.TextDocumentView(origin="/scenarios/table", name="Scenarios"),
                    _plot("/correction", "Correction, m/s²", last_30_s, legend=True),
                    reality,
                    parameters,
                    _plot("/estimate", "How sure", last_30_s, legend=True),
                    active_tab=details.index(detail),
                ),
                row_shares=[1.0, 1.0, 1.0, 1.6],
            ),
            column_shares=[3.0, 2.0],
        ),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _space(
    name: str,
    origin: str,
    *more: str,
    eye_m: drive.Vector3,
    target_m: drive.Vector3 = (0.0, 0.0, 0.0),
    up: drive.Vector3 = (0.0, 0.0, 1.0),
) -> rrb.Spatial3DView:
    """Return a view of the World and of what else is named, seen from a place about `origin`."""
    return rrb.Spatial3DView(
        origin=origin,
        contents=["/world/**", *more],
        name=name,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye_m, look_target=target_m, eye_up=up
        ),
        background=BACKGROUND,
        line_grid=False,
    )


def _plot(
    origin: str, name: str, time_ranges: rrb.VisibleTimeRange, *, legend: bool
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        time_ranges=time_ranges,
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend(rr.blueprint.Corner2D.LeftTop, visible=legend),
    )
