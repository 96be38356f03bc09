"""Stop lines across the lanes that enter junctions, and the signals that stand at them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from contracts.world import LineControl, Signal, StopLine
from world_gen.approaches import Approach
from world_gen.clusters import Surroundings, heading_out
from world_gen.lanes import LaneDraft, LaneSet
from world_gen.polyline import direction_at, left_of, length, points_at
from world_gen.road_graph import DirectedEdge

LINE_SETBACK_M = 0.3
SIGNAL_HEIGHT_M = 3.0
SIGNAL_BESIDE_M = 0.6
GROUP_AXIS_RAD = math.radians(30.0)
"""Approaches whose axes differ by less are taken to be green together."""


def stop_lines(
    found: Sequence[Approach], around: Surroundings, lanes: LaneSet
) -> tuple[StopLine, ...]:
    """Return one line for each lane that enters a whole junction, whatever controls it."""
    lines = []
    for approach in found:
        for lane in entering(approach, around, lanes):
            at = _line_at(approach, lane, around)
            lines.append(_line_across(lane, at, approach))
    return tuple(lines)


def entering(approach: Approach, around: Surroundings, lanes: LaneSet) -> list[LaneDraft]:
    """Return the lanes of an approach from the left."""
    toward = approach.toward
    return lanes.incoming(toward, around.section(toward).driven(reverse=toward.reverse))


def _line_at(approach: Approach, lane: LaneDraft, around: Surroundings) -> float:
    total = length(lane.centerline)
    trim = around.trims_m.get((approach.toward.edge.index, not approach.toward.reverse), 0.0)
    back = LINE_SETBACK_M
    if approach.line_m is not None:
        back = max(back, approach.line_m - trim)
    return max(total - back, min(0.5, 0.5 * total))


def _line_across(lane: LaneDraft, at_m: float, approach: Approach) -> StopLine:
    centre = points_at(lane.centerline, at_m)
    left = left_of(direction_at(lane.centerline, at_m)) * (lane.width_m.value / 2)
    ends = np.asarray([centre + left, centre - left], dtype=np.float64).round(3)
    return StopLine(
        id=f"{lane.id}:stop",
        lane_id=lane.id,
        ends=ends,
        control=approach.control,
    )


def line_controls(lines: tuple[StopLine, ...]) -> dict[str, LineControl]:
    """Return the control of each lane that has a stop line."""
    known: dict[str, LineControl] = {
        "signal": "signal", "stop": "stop", "give_way": "give_way", "none": "none",
    }  # fmt: skip
    return {line.lane_id: known[line.control.value] for line in lines}


def signals(
    found: Sequence[Approach],
    lines: tuple[StopLine, ...],
    around: Surroundings,
    lanes: LaneSet,
) -> tuple[Signal, ...]:
    """Return one signal head for each controlled approach, beside its stop line.

    Approaches that face each other share a group, since they are green together.
    """
    line_of = {line.lane_id: line for line in lines}
    axes: dict[str, list[float]] = {}
    heads = []
    for approach in found:
        mine = entering(approach, around, lanes)
        junction = approach.cluster.junction
        name = junction.summary.id if junction is not None else ""
        groups = axes.setdefault(name, [])
        if approach.control.value != "signal" or not mine:
            continue
        outward = DirectedEdge(approach.toward.edge, not approach.toward.reverse)
        out = heading_out(outward)
        axis = math.atan2(out[1], out[0]) % math.pi
        group = next((i for i, a in enumerate(groups) if _axis_gap(a, axis) < GROUP_AXIS_RAD), None)
        if group is None:
            groups.append(axis)
            group = len(groups) - 1
        kerb_side = mine[-1] if around.driving_side == "right" else mine[0]
        ends = line_of[kerb_side.id].ends
        kerb, middle = (ends[1], ends[0]) if around.driving_side == "right" else (ends[0], ends[1])
        beside = (
            kerb + (kerb - middle) / max(float(np.hypot(*(kerb - middle))), 1e-6) * SIGNAL_BESIDE_M
        )
        heads.append(
            Signal(
                id=f"{kerb_side.id}:signal",
                osm_node=next(iter(approach.signal_nodes), None),
                group_id=f"{name}:g{group}",
                lane_ids=tuple(lane.id for lane in mine),
                position=np.round(np.array([beside[0], beside[1], SIGNAL_HEIGHT_M]), 3),
                yaw_rad=round(math.atan2(out[1], out[0]), 4),
                source="inferred" if not approach.signal_nodes else "tagged",
            )
        )
    return tuple(heads)


def _axis_gap(a: float, b: float) -> float:
    gap = abs(a - b) % math.pi
    return min(gap, math.pi - gap)
