"""Futures as rows: the fan of paths, the worst of them, the error against reality."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import rerun as rr

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.siblings import SiblingFuture
from foretwin.contracts.side_by_side import Disagreement
from foretwin.contracts.simulation import (
    AMBER_FROM,
    GREEN_TO,
    HORIZONS_S,
    RED_FROM,
    Comparison,
    PlanComparison,
    RoundView,
)
from foretwin.viewer.colours import CRITICAL, NOMINAL, ROAD_USER, SAFE, TWIN, WATCH, Colour
from foretwin.viewer.danger import ROUND_FOR_S, dangers_of, instant_of
from foretwin.viewer.log_drive import PLAN
from foretwin.viewer.rows import Row, document, in_markdown, place_text, point_at, raised, static

BASELINES: dict[str, tuple[Colour, str]] = {
    "nominal": (TWIN, "nominal future"),
    "constant_velocity": ((255, 176, 66), "constant velocity"),
    "constant_turn_rate": ((190, 190, 120), "constant turn rate"),
}
"""Colour and name of each prediction that is compared with the real drive."""

THREATS_SHOWN = 3
"""Threats with a label; more would hide the junction."""
FUTURE_POINTS = 33
"""Points drawn of each future; more only makes the file larger."""
WORST_SHOWN = 12


def static_rows() -> list[Row]:
    """Return names and colours of the comparison's curves."""
    rows = [
        static(
            f"comparison/ade_m/{horizon_s:g}/{name}",
            rr.SeriesLines(colors=colour, names=label, widths=2.0 if name == "nominal" else 1.2),
        )
        for horizon_s in HORIZONS_S
        for name, (colour, label) in BASELINES.items()
    ]
    for name, colour, label in (
        ("ade_m", PLAN, "plan to nominal, mean"),
        ("path_offset_m", (255, 176, 66), "plan to lane centre, left +"),
    ):
        rows.append(static(f"comparison/plan/{name}", rr.SeriesLines(colors=colour, names=label)))
    rows += [
        static(f"siblings/apart_m/{which}", rr.SeriesLines(colors=colour, names=f"{which} future"))
        for which, colour in (("nominal", TWIN), ("worst", CRITICAL))
    ]
    return rows


def criticality_places(criticality: Array | Array32) -> Array:
    """Return where (S,) criticalities stand by their logarithm: green 0, amber 0.5, red 1."""
    known = np.nan_to_num(np.asarray(criticality, dtype=np.float64), nan=1.0)
    place = np.log(np.maximum(known, GREEN_TO) / GREEN_TO) / np.log(RED_FROM / GREEN_TO)
    return np.asarray(np.clip(place, 0.0, 1.0))


def criticality_colours(criticality: Array | Array32) -> npt.NDArray[np.uint8]:
    """Return (S, 3) colours from green over amber to red for (S,) criticalities."""
    ramp = np.array([SAFE, WATCH, CRITICAL], dtype=np.float64)
    place = criticality_places(criticality) * 2
    low = np.minimum(place.astype(np.intp), 1)
    share = (place - low)[:, None]
    return np.asarray(ramp[low] * (1.0 - share) + ramp[low + 1] * share, dtype=np.uint8)


def rows_of_round(view: RoundView, drive_ns: int) -> list[Row]:
    """Return the futures as one entity, their ends, and the table of the worst.

    Of a late round only that it was late: its futures would be taken for those from now on.
    """
    if view.late:
        text = f"the last round was complete after {view.latency_ms:.0f} ms: too late to be shown"
        return [*no_futures(drive_ns), Row("scenarios/table", drive_ns, document(text))]
    table = Row("scenarios/table", drive_ns, document(scenario_table(view)))
    return [*_futures(view, drive_ns), table]


class RoundLog:
    """Turns rounds into rows, and takes one away that is too old, as where rounds are missed.

    By `mono_s`, where there is a clock, as long must have passed: states may overtake rounds in a
    burst, or where the viewer lags.
    """

    def __init__(self, mono_s: Callable[[], float] | None = None) -> None:
        self._mono_s = mono_s
        self._shown_ns: int | None = None
        self._came_s = 0.0

    def rows(self, view: RoundView, drive_ns: int) -> list[Row]:
        """Return the rows of a round."""
        self._shown_ns = None if view.late else drive_ns
        self._came_s = 0.0 if self._mono_s is None else self._mono_s()
        return rows_of_round(view, drive_ns)

    def old(self, drive_ns: int) -> list[Row]:
        """Return what takes the round away whose state is so long ago."""
        if self._shown_ns is None or drive_ns - self._shown_ns <= ROUND_FOR_S * 1e9:
            return []
        if self._mono_s is not None and self._mono_s() - self._came_s <= ROUND_FOR_S:
            return []
        text = Row("scenarios/table", drive_ns, document(f"no round for {ROUND_FOR_S:.0f} s"))
        return [*self.none(drive_ns), text]

    def none(self, drive_ns: int) -> list[Row]:
        """Return what takes the round away."""
        self._shown_ns = None
        return no_futures(drive_ns)


def no_futures(drive_ns: int) -> list[Row]:
    """Return the row that takes the last round's futures away."""
    return [Row("world/futures", drive_ns, rr.Clear(recursive=True))]


def _futures(view: RoundView, drive_ns: int) -> list[Row]:
    count, points = view.xy_m.shape[:2]
    if count == 0 or points < 2:
        return no_futures(drive_ns)
    others = _road_users(view, drive_ns)
    chosen = np.unique(np.linspace(0, points - 1, min(points, FUTURE_POINTS)).round().astype(int))
    # Rounded to 1/64 m, paths compress to a third.
    paths = np.round(view.xy_m[:, chosen].astype(np.float64) * 64.0) / 64.0
    usable = np.isfinite(paths).all(axis=(1, 2))
    colours = criticality_colours(view.criticality)
    places = criticality_places(view.criticality)
    radii = 0.07 + 0.06 * places
    heights = 0.25 + 0.15 * places
    if 0 <= view.nominal_index < count:
        colours[view.nominal_index] = NOMINAL
        radii[view.nominal_index] = 0.24
        heights[view.nominal_index] = 0.5
    strips = np.concatenate(
        [paths, np.broadcast_to(heights[:, None, None], (*paths.shape[:2], 1))], axis=2
    )[usable].astype(np.float32)
    colours, radii = colours[usable], radii[usable]
    lines = rr.LineStrips3D(list(strips), colors=colours, radii=radii)
    # Many futures share one path and differ in speed alone: their ends tell them apart.
    end_radii = np.where(radii > 0.2, 0.7, 0.45)
    ends = rr.Points3D(strips[:, -1], colors=colours, radii=end_radii)
    return [
        Row("world/futures", drive_ns, lines),
        Row("world/futures/ends", drive_ns, ends),
        *others,
    ]


def _road_users(view: RoundView, drive_ns: int) -> list[Row]:
    """Return whom the worst futures meet, and where they touch, with the scenarios' names."""
    tracks = view.user_xy_m[np.isfinite(view.user_xy_m).all(axis=(1, 2))]
    lines = [raised(track, 0.35) for track in tracks]
    touches = rr.Points3D(
        raised(view.touch_xy_m, 0.8),
        colors=[CRITICAL],
        radii=[0.6],
        labels=list(view.touch_names),
        show_labels=False,
    )
    users = rr.LineStrips3D(lines, colors=[ROAD_USER], radii=[0.06])
    return [
        Row("world/futures/road_users", drive_ns, users),
        Row("world/futures/touches", drive_ns, touches),
        Row("world/futures/threats", drive_ns, _threats(view)),
    ]


def _threats(view: RoundView) -> rr.Points3D:
    """Return where the gravest dangers are met: who comes from where, how likely, in how long."""
    shown = [one for one in dangers_of(view) if one.level != "calm"][:THREATS_SHOWN]
    places = [view.xy_m[one.future, instant_of(view, one.in_s)] for one in shown]
    return rr.Points3D(
        raised(np.array(places, dtype=np.float64).reshape(-1, 2), 1.2),
        colors=criticality_colours(np.array([one.criticality for one in shown])),
        radii=[0.5],
        labels=[f"{one.what} · {one.odds} · {one.in_s:.1f} s" for one in shown],
        show_labels=True,
    )


def scenario_table(view: RoundView) -> str:
    """Return Markdown: what the round holds, and its worst futures, worst first."""
    clearance = (
        "no other road user"
        if view.min_clearance_m is None
        else f"least clearance {view.min_clearance_m:.1f} m"
    )
    place = in_markdown(place_text(view.place, view.intersection_id))
    lines = [
        f"**{place}** · {len(view.names)} futures · "
        f"{view.collided} collide · {clearance} · {view.latency_ms:.0f} ms",
        "",
        "| what happens | likely | critical | |",
        "|:--|--:|--:|:--|",
    ]
    criticality = np.nan_to_num(np.asarray(view.criticality, dtype=np.float64), nan=1.0)
    worst = np.argsort(-criticality, kind="stable")[:WORST_SHOWN]
    for index in worst:
        value = float(criticality[index])
        verdict = "grave" if value >= RED_FROM else "watch" if value >= AMBER_FROM else ""
        name = view.names[index] if index < len(view.names) else str(index)
        likely = float(view.likelihood[index])
        lines.append(f"| {in_markdown(name)} | {likely:.2g} | {value:.1g} | {verdict} |")
    return "\n".join(lines)


def rows_of_comparison(comparison: Comparison, drive_ns: int) -> list[Row]:
    """Return the mean displacement error of the nominal future and of both baselines."""
    base = f"comparison/ade_m/{comparison.horizon_s:g}"
    errors = {name: getattr(comparison, name) for name in BASELINES}
    return [
        Row(f"{base}/{name}", drive_ns, rr.Scalars(error.ade_m)) for name, error in errors.items()
    ]


def rows_of_sibling(one: SiblingFuture, drive_ns: int) -> list[Row]:
    """Return how far two engines are apart in a future, at the last instant that both have."""
    told = [m for m in (one.apart_1_s_m, one.apart_2_s_m, one.apart_4_s_m) if m is not None]
    return [Row(f"siblings/apart_m/{one.which}", drive_ns, rr.Scalars(m)) for m in told[-1:]]


def rows_of_plan_comparison(comparison: PlanComparison, drive_ns: int) -> list[Row]:
    """Return how far the car's plan lies from the nominal future and from the lane's centre."""
    return [
        Row("comparison/plan/ade_m", drive_ns, rr.Scalars(comparison.difference.ade_m)),
        Row("comparison/plan/path_offset_m", drive_ns, rr.Scalars(comparison.path_offset_m)),
    ]


def rows_of_disagreement(one: Disagreement, drive_ns: int, frame: LocalFrame) -> list[Row]:
    """Return a mark where human and ADS begin to disagree; its label says about what."""
    if one.over:
        return []
    place = local_from_geo(frame, one.position.lat_deg, one.position.lon_deg)
    mark = rr.Points3D(
        [point_at(place, 2.0)],
        colors=[CRITICAL],
        radii=rr.Radius.ui_points(7),
        labels=[one.kind.replace("_", " ")],
    )
    # A place of its own for each: marks stay on the map.
    return [Row(f"world/disagreements/{one.aspect}_{one.stamp_ns}", drive_ns, mark)]
