"""Stop lines across the lanes that enter junctions, and at the signs inside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Choice
from foretwin.contracts.world import LineControl, StopLine
from foretwin.geometry.polyline import left_of
from foretwin.geometry.polyline_batch import Polylines, segments_at
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.lanes.stopping import LINE_SETBACK_M
from foretwin.world_gen.rules.approaches import Approach
from foretwin.world_gen.rules.signs_inside import SignsInside


def stop_lines(
    found: Sequence[Approach], around: Surroundings, lanes: LaneSet
) -> tuple[StopLine, ...]:
    """Return one line for each lane that enters a whole junction, whatever controls it.

    All lanes of a road stop at one line: where the map has the sign or light, before a crossing
    that waiting cars would block, else where lanes end.
    """
    return lines_across(
        [
            (lane, _line_back_m(approach, around), approach.control)
            for approach in found
            for lane in entering(approach, around, lanes)
        ]
    )


def entering(approach: Approach, around: Surroundings, lanes: LaneSet) -> list[LaneDraft]:
    """Return the lanes of an approach from the left, one in the middle for turns among them."""
    toward, along = approach.toward, around.lanes_along(approach.toward)
    driven, middle = (lanes.incoming(toward, plans) for plans in (along.driven, along.turning))
    return [*middle, *driven] if around.driving_side == "right" else [*driven, *middle]


def _line_back_m(approach: Approach, around: Surroundings) -> float:
    """Return how far before the ends of its lanes an approach's line lies."""
    if approach.line_m is None:
        return LINE_SETBACK_M
    trim = around.trims_m.get(approach.toward.back.key, 0.0)
    return max(LINE_SETBACK_M, approach.line_m - trim)


def lines_across(
    stopped: Sequence[tuple[LaneDraft, float, Choice]], name: str = "stop"
) -> tuple[StopLine, ...]:
    """Return a line across each lane, so many metres before its end but within the lane, and with
    its control."""
    paths = Polylines.of([lane.centerline for lane, _, _ in stopped])
    total, back_m = paths.length_m, np.array([away_m for _, away_m, _ in stopped])
    at_m = np.maximum(total - back_m, np.minimum(0.5, 0.5 * total))
    ends = _ends_across(paths, at_m, [lane.width_m.value for lane, _, _ in stopped])
    return tuple(
        StopLine(id=f"{lane.id}:{name}", lane_id=lane.id, ends=mine, control=control)
        for (lane, _, control), mine in zip(stopped, ends, strict=True)
    )


def lines_at_signs(
    connections: Sequence[ConnectionDraft], signs: SignsInside
) -> tuple[StopLine, ...]:
    """Return a line across each connection where a sign inside the junction stands."""
    signed = [(c, sign) for c in connections for sign in signs.get(c.id, ()) if sign.on_path]
    ends = _ends_across(
        Polylines.of([c.centerline for c, _ in signed]),
        np.array([sign.at_m for _, sign in signed]),
        [c.width_m.value for c, _ in signed],
    )
    return tuple(
        StopLine(
            id=f"{c.id}:sign{sign.node}",
            lane_id=c.start.id,
            connection_id=c.id,
            ends=mine,
            control=Choice(sign.rule, "tagged"),
        )
        for (c, sign), mine in zip(signed, ends, strict=True)
    )


def _ends_across(paths: Polylines, at_m: Array, width_m: Sequence[float]) -> Array:
    """Return (L, 2, 2) the ends, left and right, of a line across each of L paths at `at_m`."""
    half_m = np.array(width_m) / 2.0
    i = segments_at(paths, np.arange(len(paths)), at_m)
    ahead = paths.steps[0][i] / np.maximum(paths.steps[1][i], 1e-9)[:, None]
    centre = paths.xy_m[i] + ahead * (at_m - paths.arc_m[i])[:, None]
    left = left_of(ahead) * half_m[:, None]
    return np.asarray(np.stack([centre + left, centre - left], axis=1).round(3))


def line_controls(lines: Sequence[StopLine]) -> dict[str, LineControl]:
    """Return the control of each lane that has a stop line."""
    return {line.lane_id: cast(LineControl, line.control.value) for line in lines}
