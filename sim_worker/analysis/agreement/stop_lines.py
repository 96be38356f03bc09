"""Stop lines crossed at red, or at a sign without standing: for wherever the line may lie."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.analysis.agreement.judgement import Judgement
from foretwin.sim_worker.analysis.agreement.window import Heard
from foretwin.sim_worker.metrics.rollout import RolloutView
from foretwin.sim_worker.metrics.route_rules import LineAhead
from foretwin.sim_worker.metrics.violations import (
    STOP_WITHIN_M,
    STOPS,
    line_crossings,
    stood_before,
)

_HEARD_FOR_NS = 2_000_000_000


def at_lights(
    view: RolloutView,
    lines: list[tuple[LineAhead, tuple[float, ...]]],
    heard: Mapping[str, Heard],
    stamp_ns: int,
) -> Judgement:
    """Judge (S,) crossings of lines whose groups were heard, each with how far ahead of where they
    seem to be fronts may be at it."""

    def at_red(front: Array, line: LineAhead) -> Flags:
        red = np.zeros(len(front), dtype=bool)
        said = heard.get(line.group_id or "")
        if said is None:
            return red
        for row, at_s in zip(*line_crossings(front, line.ends_m, view.time_s), strict=True):
            at_ns = stamp_ns + round(float(at_s) * 1e9)
            last = int(np.searchsorted(said.stamps_ns, at_ns, side="right")) - 1
            if last < 0 or at_ns - said.stamps_ns[last] > _HEARD_FOR_NS:
                continue
            lets_go = line.red_after_stop and stood_before(
                front[row], view.speed_mps[row], view.time_s, float(at_s)
            )
            red[row] |= said.colours[last] in STOPS and not lets_go
        return red

    return _wherever(view, [one for one in lines if one[0].control == "signal"], at_red)


def at_signs(view: RolloutView, lines: list[tuple[LineAhead, tuple[float, ...]]]) -> Judgement:
    """Judge (S,) crossings of stop signs' lines: whether the car stood before, unless it began near
    one; arguments as of `at_lights`."""

    def without_stop(front: Array, line: LineAhead) -> Flags:
        unstopped = np.zeros(len(front), dtype=bool)
        for row, at_s in zip(*line_crossings(front, line.ends_m, view.time_s), strict=True):
            line_m = float(np.interp(at_s, view.time_s, arc_lengths(front[row])))
            if line_m >= STOP_WITHIN_M:
                unstopped[row] |= not stood_before(
                    front[row], view.speed_mps[row], view.time_s, float(at_s)
                )
        return unstopped

    return _wherever(view, [one for one in lines if one[0].control == "stop"], without_stop)


def _wherever(
    view: RolloutView,
    lines: list[tuple[LineAhead, tuple[float, ...]]],
    broken_at: Callable[[Array, LineAhead], Flags],
) -> Judgement:
    """Return what holds (S,) for all places where fronts may be against each of the lines."""
    passes, fails = (np.full(len(view.valid), value) for value in (True, False))
    forward = np.stack(view.heading, axis=-1)
    for line, ahead_m in lines:
        places = [broken_at(view.front_m + away_m * forward, line) for away_m in ahead_m]
        fails |= np.all(places, axis=0)
        passes &= ~np.any(places, axis=0)
    return Judgement(passes, fails)
