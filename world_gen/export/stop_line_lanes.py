"""Across which lanes stop lines lie, where lanes begin behind theirs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import shapely

from foretwin.contracts.signals import Signal
from foretwin.contracts.world import Lane, StopLine, World
from foretwin.geometry.polyline import unit

BEHIND_M = 1.0
"""A line that lies so far behind where its lane begins is not across it."""


class StopLineLanes:
    """Tells where the stop lines of a World lie, and at which of them its lights hang."""

    def __init__(self, world: World) -> None:
        self._lanes = {lane.id: lane for lane in world.lanes}
        self._before: dict[str, list[Lane]] = defaultdict(list)
        for lane in world.lanes:
            for name in lane.successor_ids:
                self._before[name].append(lane)
        self._of_lane: dict[str, list[StopLine]] = defaultdict(list)
        for line in world.stop_lines:
            if line.connection_id is None:
                self._of_lane[line.lane_id].append(line)

    def across(self, line: StopLine) -> str:
        """Return the lane or connection that a line lies across.

        That is its own, or the only one that goes on in that where it begins behind the line.
        """
        before = self._before[line.lane_id]
        if line.connection_id or len(before) != 1:
            return line.across_id
        path = self._lanes[line.lane_id].centerline
        start, middle = path[0], line.ends.mean(axis=0)
        behind_m = float((start - middle) @ unit(path[1] - start))
        nearest_m = shapely.LineString(path).project(shapely.Point(middle))
        return before[0].id if behind_m > BEHIND_M and nearest_m == 0.0 else line.lane_id

    def of_head(self, head: Signal, lane_id: str) -> str:
        """Return the lane at whose stop line a light hangs that one of its lanes obeys."""
        lines = self._of_lane.get(lane_id)
        return self.across(nearest(head, lines)) if lines else lane_id


def nearest(head: Signal, lines: Sequence[StopLine]) -> StopLine:
    """Return the line at which a light hangs, of those of one lane."""
    lit = [line for line in lines if line.control.value == "signal"] or lines
    place = shapely.Point(head.position[:2])
    return min(lit, key=lambda line: shapely.distance(place, middle_of(line)))


def middle_of(line: StopLine) -> shapely.Point:
    """Return the middle of a line."""
    return shapely.Point(line.ends.mean(axis=0))
