"""Every view that a layout can hold, by its name."""

from __future__ import annotations

from collections.abc import Callable

import rerun as rr
import rerun.blueprint as rrb

from foretwin.contracts import drive
from foretwin.contracts.layout import ViewName
from foretwin.viewer.legend import LEGEND_BOUNDS
from foretwin.viewer.rows import TIMELINE

BACKGROUND = (16, 18, 24)
"""Of what is seen in three dimensions, in a light theme as well: roads are drawn for it."""
FOLLOWED_S = 30.0


def view_of(name: ViewName) -> rrb.View | rrb.Container:
    """Return the view of that name."""
    return _VIEWS[name]()


def title_of(name: ViewName) -> str:
    """Return what stands on a view's tab."""
    return _TITLES.get(name, name.replace("_", " ").capitalize())


_TITLES: dict[ViewName, str] = {
    "worker_speed": "Real-time factor",
    "worker_memory": "Memory, MB",
    "position_gap": "Position gap, m",
    "heading_gap": "Heading gap, deg",
    "speed_gap": "Speed gap, m/s",
    "correction": "Correction, m/s²",
    "engines": "Engines apart, m",
    "across_after_2_s": "Across after 2 s, m",
    "along_after_2_s": "Along after 2 s, m",
    "heading_after_2_s": "Heading after 2 s, deg",
    "steering_offset": "Steering offset, rad",
    "steering_delay": "Steering delay, s",
}


def _followed() -> rrb.VisibleTimeRange:
    return rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-FOLLOWED_S),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )


def _all_along() -> rrb.VisibleTimeRange:
    return rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )


def _intersection() -> rrb.View:
    # /world/focus lies between the car and the junction at every instant, so the view follows the
    # drive also when a recording is scrubbed.
    return _space("intersection", "/world/focus", eye_m=(-19.0, -26.0, 88.0))


def _chase() -> rrb.View:
    target_m = (7.0, 0.0, 0.0)
    return _space("chase", "/world/ego/real", eye_m=(-17.0, 0.0, 9.0), target_m=target_m)


def _map() -> rrb.View:
    # Rerun's own map view fetches tiles from the internet, which tells where the car is: seen from
    # straight above, the roads need none. /geo is recorded for those who add a map view.
    up = (0.0, 1.0, 0.0)
    return _space("map", "/world/focus", "/map/**", eye_m=(0.0, 0.0, 600.0), up=up)


def _legend() -> rrb.View:
    return rrb.Spatial2DView(
        origin="/legend",
        name=title_of("legend"),
        background=BACKGROUND,
        visual_bounds=LEGEND_BOUNDS,
    )


def _text(name: ViewName, origin: str, *, titlebar: bool = True) -> Callable[[], rrb.View]:
    return lambda: rrb.TextDocumentView(origin=origin, name=title_of(name), titlebar=titlebar)


def _lot() -> rrb.Container:
    return rrb.Vertical(
        rrb.TextDocumentView(origin="/lot/gate", name="Gate"),
        _plot("/lot/room_m", "To the fence, m", legend=True),
        row_shares=[1, 3],
        name=title_of("lot"),
    )


def _forecast(name: ViewName, first_s: int) -> Callable[[], rrb.Container]:
    return lambda: rrb.Horizontal(
        *(
            _plot(f"/comparison/ade_m/{s}", f"ADE at {s} s, m", legend=s == first_s)
            for s in (first_s, 2 * first_s)
        ),
        name=title_of(name),
    )


def _curve(
    name: ViewName, origin: str, *, legend: bool, all_along: bool = False
) -> Callable[[], rrb.View]:
    return lambda: _plot(origin, title_of(name), legend=legend, all_along=all_along)


_VIEWS: dict[ViewName, Callable[[], rrb.View | rrb.Container]] = {
    "intersection": _intersection,
    "chase": _chase,
    "map": _map,
    "status": _text("status", "/status", titlebar=False),
    "legend": _legend,
    "futures": _text("futures", "/scenarios/table"),
    "verdict": _text("verdict", "/reality/verdict"),
    "parameters": _text("parameters", "/parameters/table"),
    "events": lambda: rrb.TextLogView(origin="/events", name=title_of("events")),
    "workers": lambda: rrb.StateTimelineView(origin="/workers/state", name=title_of("workers")),
    "worker_speed": _curve("worker_speed", "/workers/rtf", legend=True),
    "worker_memory": _curve("worker_memory", "/workers/memory_mb", legend=True, all_along=True),
    "how_sure": _curve("how_sure", "/estimate", legend=True),
    "position_gap": _curve("position_gap", "/gap/pos_m", legend=True),
    "heading_gap": _curve("heading_gap", "/gap/yaw_deg", legend=False),
    "speed_gap": _curve("speed_gap", "/gap/speed_mps", legend=False),
    "correction": _curve("correction", "/correction", legend=True),
    "across_after_2_s": _curve(
        "across_after_2_s", "/reality/across_m", legend=True, all_along=True
    ),
    "along_after_2_s": _curve("along_after_2_s", "/reality/along_m", legend=False, all_along=True),
    "heading_after_2_s": _curve(
        "heading_after_2_s", "/reality/yaw_deg", legend=False, all_along=True
    ),
    "forecast": _forecast("forecast", 4),
    "short_forecast": _forecast("short_forecast", 1),
    "lot": _lot,
    "engines": _curve("engines", "/siblings/apart_m", legend=True),
    "plan": _curve("plan", "/comparison/plan", legend=True),
    "steering_ratio": _curve(
        "steering_ratio", "/parameters/steering_ratio", legend=True, all_along=True
    ),
    "steering_offset": _curve(
        "steering_offset", "/parameters/steering_offset_rad", legend=False, all_along=True
    ),
    "steering_delay": _curve(
        "steering_delay", "/parameters/steering_delay_s", legend=False, all_along=True
    ),
    "drive_gain": _curve("drive_gain", "/parameters/drive_gain", legend=True, all_along=True),
    "brake_gain": _curve("brake_gain", "/parameters/brake_gain", legend=False, all_along=True),
}


def _space(
    name: ViewName,
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
        name=title_of(name),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye_m, look_target=target_m, eye_up=up
        ),
        background=BACKGROUND,
        line_grid=False,
    )


def _plot(origin: str, name: str, *, legend: bool, all_along: bool = False) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        time_ranges=_all_along() if all_along else _followed(),
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend(rr.blueprint.Corner2D.LeftTop, visible=legend),
    )
