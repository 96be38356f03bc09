"""What a path must obey in a World: the stop lines it crosses and the movements it waits for."""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Conflict, Connection, LineControl, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths

_CONTROLS: dict[str, LineControl] = {name: name for name in get_args(LineControl)}
_ON_PATH_M = 1.2
"""A connection whose middle stays this near to the path is the one that it takes."""
_SAMPLES = 9
_APPROACH_M = 120.0
"""How far back a way with priority is followed."""


class LineAhead(NamedTuple):
    """A stop line on the path: `ends_m` (2, 2), and the group that governs it, None without.

    `red_after_stop` says that the path turns where red lets who has stopped go on.
    """

    line_id: str
    ends_m: Array
    control: LineControl
    group_id: str | None
    red_after_stop: bool = False


class PriorityConflict(NamedTuple):
    """A movement that the path waits for. Distances are along the path's connection from `point_m`.

    `own_way` (2,) is the path's direction there, `own_from_m` and `own_until_m` where the shared
    ground begins and ends; `way` the priority movement as a path, with its entry lane in front,
    on which the shared ground begins at `way_from_m`.
    """

    own_id: str
    other_id: str
    point_m: Array
    own_way: Array
    own_from_m: float
    own_until_m: float
    way: FrenetPath
    way_from_m: float
    other_group_id: str | None


class RouteRules:
    """Stop lines and priorities along one path through a World. `connections` (ids) it takes."""

    def __init__(self, world: World, path: FrenetPath) -> None:
        self.world = world
        taken = connections_taken(world, path)
        self.connections = tuple(c.id for c in taken)
        # Of a lane's line the light of the connection counts; a sign on the way has none.
        entered = {c.from_lane_id: (c.signal_group_id, c.red_after_stop is True) for c in taken}
        entered |= {c.id: (None, False) for c in taken}
        self.lines = tuple(
            LineAhead(
                line.id,
                np.asarray(line.ends),
                _CONTROLS.get(line.control.value, "none"),
                *entered[line.across_id],
            )
            for line in world.stop_lines
            if line.across_id in entered
        )
        by_id = {c.id: c for c in world.connections}
        own = {c.id for c in taken}
        self.conflicts = tuple(
            _priority(world, conflict, by_id)
            for conflict in world.conflicts
            if conflict.yields_id in own
        )


def connections_taken(world: World, path: FrenetPath) -> list[Connection]:
    """Return the connections that a path runs along, in its order; of those that share a lane's
    end the one that fits best."""
    best: dict[str, tuple[tuple[float, float], float, Connection]] = {}
    for connection in world.connections:
        line = np.asarray(connection.centerline)
        points = line[np.linspace(0, len(line) - 1, min(_SAMPLES, len(line))).astype(int)]
        place = path.locate(points)
        inside = (place.arc_m > -0.5) & (place.arc_m < path.length_m + 0.5)
        aside = np.abs(place.offset_m[inside])
        if inside.sum() < 2 or aside.max() > _ON_PATH_M or (np.diff(place.arc_m) < 0.0).any():
            continue
        fit = (float(inside.sum()), -float(aside.mean()))
        lane = connection.from_lane_id
        if lane not in best or fit > best[lane][0]:
            best[lane] = (fit, float(place.arc_m[0]), connection)
    return [found[2] for found in sorted(best.values(), key=lambda found: found[1])]


def _priority(world: World, conflict: Conflict, by_id: dict[str, Connection]) -> PriorityConflict:
    own = by_id[conflict.yields_id]
    first = conflict.first_id == conflict.yields_id
    other = by_id[conflict.second_id if first else conflict.first_id]
    entry = next(lane.centerline for lane in world.lanes if lane.id == other.from_lane_id)
    way = FrenetPath(np.concatenate([_last(np.asarray(entry), _APPROACH_M), other.centerline]))
    point = np.asarray(conflict.point)
    own_way = direction_near(np.asarray(own.centerline), point)
    along = (np.asarray(conflict.area) - point) @ own_way
    arcs = way.locate(np.vstack([point, conflict.area])).arc_m
    merging = conflict.kind == "merging"
    return PriorityConflict(
        own_id=own.id,
        other_id=other.id,
        point_m=point,
        own_way=own_way,
        own_from_m=float(along.min()),
        # Merging ways share the lane from there on: that both have passed the point must do.
        own_until_m=0.0 if merging else float(along.max()),
        way=way,
        way_from_m=float(arcs[0] if merging else arcs[1:].min()),
        other_group_id=other.signal_group_id,
    )


def direction_near(line: Array, point: Array) -> Array:
    """Return the unit direction (2,) of a line (N, 2) where it comes nearest to `point`."""
    steps = np.diff(line, axis=0)
    middle = line[:-1] + steps / 2.0
    nearest = np.hypot(*(middle - point).T).argmin()
    step = steps[nearest]
    return np.asarray(step / max(float(np.hypot(*step)), 1e-9))


def _last(line: Array, length_m: float) -> Array:
    """Return the points of a line (N, 2) within `length_m` before its end."""
    return line[arc_lengths(line[::-1])[::-1] <= length_m]
