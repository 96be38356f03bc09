"""Stop lines across the lanes that enter junctions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contracts.provenance import Choice
from contracts.world import LineControl, StopLine
from world_gen.approaches import Approach
from world_gen.clusters import Surroundings
from world_gen.lanes import LaneDraft, LaneSet
from world_gen.polyline import left_of
from world_gen.polyline_batch import Polylines

LINE_SETBACK_M = 0.3


def stop_lines(
    found: Sequence[Approach], around: Surroundings, lanes: LaneSet
) -> tuple[StopLine, ...]:
    """Return one line for each lane that enters a whole junction, whatever controls it.

    All lanes of a road stop at one line: where the map has the sign or light, before a crossing
    that waiting cars would block, else where lanes end.
    """
    mine = [
        (lane, _line_back_m(approach, around), approach.control)
        for approach in found
        for lane in entering(approach, around, lanes)
    ]
    return lines_across(
        [lane for lane, _, _ in mine], [back_m for _, back_m, _ in mine],
        [control for _, _, control in mine],
    )  # fmt: skip


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


def lines_across(
    lanes: Sequence[LaneDraft],
    back_m: Sequence[float],
    controls: Sequence[Choice],
    name: str = "stop",
) -> tuple[StopLine, ...]:
    """Return a line across each lane, so many metres before its end but within the lane."""
    paths = Polylines.of([lane.centerline for lane in lanes])
    total = paths.length_m
    at_m = np.maximum(total - np.array(back_m), np.minimum(0.5, 0.5 * total))
    half_m = np.array([lane.width_m.value for lane in lanes]) / 2.0
    # A key that grows along each lane and from lane to lane finds all segments in one search.
    room = np.concatenate([[0.0], np.cumsum(total + 1.0)])
    i = np.searchsorted(paths.arc_m + room[paths.line], at_m + room[:-1], side="right") - 1
    i = np.clip(i, paths.first[:-1], paths.first[1:] - 2)
    ahead = paths.steps[0][i] / np.maximum(paths.steps[1][i], 1e-9)[:, None]
    centre = paths.xy_m[i] + ahead * (at_m - paths.arc_m[i])[:, None]
    left = left_of(ahead) * half_m[:, None]
    ends = np.stack([centre + left, centre - left], axis=1).round(3)
    return tuple(
        StopLine(id=f"{lane.id}:{name}", lane_id=lane.id, ends=mine, control=control)
        for lane, mine, control in zip(lanes, ends, controls, strict=True)
    )


def line_controls(lines: Sequence[StopLine]) -> dict[str, LineControl]:
    """Return the control of each lane that has a stop line."""
    known: dict[str, LineControl] = {
        "signal": "signal", "stop": "stop", "give_way": "give_way", "none": "none",
    }  # fmt: skip
    return {line.lane_id: known[line.control.value] for line in lines}
