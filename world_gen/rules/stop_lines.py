"""Stop lines across the lanes that enter junctions, and at the signs inside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import cast

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Choice
from foretwin.contracts.world import Crossing, LineControl, StopLine
from foretwin.geometry.polyline import arc_lengths, left_of, length
from foretwin.geometry.polyline_batch import Polylines, segments_at
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.lanes.stopping import LINE_SETBACK_M, clear_of_crossings
from foretwin.world_gen.rules.approaches import Approach
from foretwin.world_gen.rules.signs_inside import SignsInside

LEAST_FROM_BEGIN_M = 0.5
"""No line lies nearer to where its lane begins."""


def stop_lines(
    found: Sequence[Approach],
    around: Surroundings,
    lanes: LaneSet,
    crossings: Sequence[Crossing],
) -> tuple[StopLine, ...]:
    """Return one line for each lane that enters a whole junction, whatever controls it.

    All lanes of a road stop at one line: where the map has the sign or light, else where lanes end,
    and in any case before a crossing that waiting cars would block: a marked one, at lights any.
    """
    every = {c.osm_node for c in crossings}
    marked = {c.osm_node for c in crossings if c.kind.value != "unmarked"}
    before = lanes.before
    stopped = []
    for approach in found:
        mine = entering(approach, around, lanes)
        walked = every if approach.control.value == "signal" else marked
        back_m = _line_back_m(approach, around, mine, before, walked)
        stopped += [(lane, back_m, approach.control) for lane in mine]
    return lines_across(stopped, before)


def entering(approach: Approach, around: Surroundings, lanes: LaneSet) -> list[LaneDraft]:
    """Return the lanes of an approach from the left, one in the middle for turns among them."""
    toward, along = approach.toward, around.lanes_along(approach.toward)
    driven, middle = (lanes.incoming(toward, plans) for plans in (along.driven, along.turning))
    return [*middle, *driven] if around.driving_side == "right" else [*driven, *middle]


def _line_back_m(
    approach: Approach,
    around: Surroundings,
    mine: Sequence[LaneDraft],
    before: Mapping[str, LaneDraft],
    walked: Set[int | None],
) -> float:
    """Return how far before the ends of its lanes an approach's line lies."""
    leg = approach.toward.back
    ends_m = around.trims_m.get(leg.key, 0.0)
    line_m = max(ends_m + LINE_SETBACK_M, approach.line_m or 0.0)
    if mine and not walked.isdisjoint(leg.node_ids):
        along = zip(leg.node_ids, arc_lengths(leg.xy_m).tolist(), strict=False)
        most_m = ends_m + min(most_back_m(lane, before) for lane in mine)
        met_m = (at_m for node, at_m in along if node in walked)
        line_m = clear_of_crossings(line_m, met_m, most_m=most_m)
    return line_m - ends_m


def most_back_m(lane: LaneDraft, before: Mapping[str, LaneDraft]) -> float:
    """Return how far before a lane's end its line can lie, on the lane that it goes on from too."""
    parts = [lane, *([before[lane.id]] if lane.id in before else [])]
    return sum(length(part.centerline) for part in parts) - LEAST_FROM_BEGIN_M


def lines_across(
    stopped: Sequence[tuple[LaneDraft, float, Choice]],
    before: Mapping[str, LaneDraft],
    name: str = "stop",
) -> tuple[StopLine, ...]:
    """Return a line across each lane, so many metres before its end, and with its control.

    Where the lane begins behind that, the line lies across the one that it goes on from
    (`LaneSet.before`); where there is none, within the lane.
    """
    paths = Polylines.of([_way_to(lane, away_m, before) for lane, away_m, _ in stopped])
    total, back_m = paths.length_m, np.array([away_m for _, away_m, _ in stopped])
    at_m = np.maximum(total - back_m, np.minimum(LEAST_FROM_BEGIN_M, 0.5 * total))
    ends = _ends_across(paths, at_m, [lane.width_m.value for lane, _, _ in stopped])
    return tuple(
        StopLine(id=f"{lane.id}:{name}", lane_id=lane.id, ends=mine, control=control)
        for (lane, _, control), mine in zip(stopped, ends, strict=True)
    )


def _way_to(lane: LaneDraft, away_m: float, before: Mapping[str, LaneDraft]) -> Array:
    """Return a lane's line, with that of the lane before it where so much is needed."""
    came_from = before.get(lane.id)
    if came_from is None or away_m <= length(lane.centerline) - LEAST_FROM_BEGIN_M:
        return lane.centerline
    return np.concatenate([came_from.centerline[:-1], lane.centerline])


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
