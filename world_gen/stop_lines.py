"""Stop lines across the lanes that enter junctions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contracts.world import Choice, LineControl, StopLine
from world_gen.approaches import Approach
from world_gen.clusters import Surroundings
from world_gen.lanes import LaneDraft, LaneSet
from world_gen.polyline import arc_lengths

LINE_SETBACK_M = 0.3


def stop_lines(
    found: Sequence[Approach], around: Surroundings, lanes: LaneSet
) -> tuple[StopLine, ...]:
    """Return one line for each lane that enters a whole junction, whatever controls it.

    All lanes of a road stop at one line: where the map has the sign or light, before a crossing
    that waiting cars would block, else where lanes end.
    """
    return tuple(
        line_across(lane, _line_back_m(approach, around), approach.control)
        for approach in found
        for lane in entering(approach, around, lanes)
    )


def entering(approach: Approach, around: Surroundings, lanes: LaneSet) -> list[LaneDraft]:
    """Return the lanes of an approach from the left."""
    toward = approach.toward
    return lanes.incoming(toward, around.section(toward).driven(reverse=toward.reverse))


def _line_back_m(approach: Approach, around: Surroundings) -> float:
    """Return how far before the ends of its lanes an approach's line lies."""
    if approach.line_m is None:
        return LINE_SETBACK_M
    trim = around.trims_m.get((approach.toward.edge.index, not approach.toward.reverse), 0.0)
    return max(LINE_SETBACK_M, approach.line_m - trim)


def line_across(lane: LaneDraft, back_m: float, control: Choice, name: str = "stop") -> StopLine:
    """Return the line across a lane, `back_m` metres before its end but within the lane."""
    xy = lane.centerline
    along = arc_lengths(xy)
    total = float(along[-1])
    at_m = max(total - back_m, min(0.5, 0.5 * total))
    i = min(int(np.searchsorted(along, at_m, side="right")), len(xy) - 1) - 1
    step = xy[i + 1] - xy[i]
    step_m = max(float(along[i + 1] - along[i]), 1e-9)
    centre = xy[i] + step * ((at_m - float(along[i])) / step_m)
    left = np.array([-step[1], step[0]]) * (lane.width_m.value / 2.0 / step_m)
    ends = np.asarray([centre + left, centre - left], dtype=np.float64).round(3)
    return StopLine(id=f"{lane.id}:{name}", lane_id=lane.id, ends=ends, control=control)


def line_controls(lines: Sequence[StopLine]) -> dict[str, LineControl]:
    """Return the control of each lane that has a stop line."""
    known: dict[str, LineControl] = {
        "signal": "signal", "stop": "stop", "give_way": "give_way", "none": "none",
    }  # fmt: skip
    return {line.lane_id: known[line.control.value] for line in lines}
