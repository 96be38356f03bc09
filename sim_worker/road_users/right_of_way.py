"""Where paths of road users meet stop lines and each other, and which one waits there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.drive import SignalColour
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.world import Connection, World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths, direction_at, points_at
from foretwin.sim_worker.planner_interface import SharedGround

_ON_PATH_M, _ON_PATH_RAD = 1.5, 0.6
_GREEN_KEEPS = ("turn_across", "u_turn", "merge_order")
"""Rules that hold between two movements that may both have green."""
_GO: tuple[SignalColour, ...] = ("green", "dark", "unknown")


class Taken(NamedTuple):
    """A connection that a path takes, and the path's arc length where it begins."""

    connection: Connection
    from_arc_m: float


class SharedStretch(NamedTuple):
    """A conflict area on both its connections, arc lengths along either: waiting one first."""

    wait_in_m: float
    wait_out_m: float
    go_in_m: float
    go_out_m: float


class JunctionRules:
    """The rules of one World, ready for any paths through it."""

    def __init__(self, world: World | None) -> None:
        self._world = world
        self._connections = () if world is None else world.connections
        lines = [connection.centerline for connection in self._connections]
        self._probes = np.array([_probe(line) for line in lines]).reshape(-1, 3, 3)
        self._stretches: dict[tuple[str, str], SharedStretch] = {}
        if world is not None:
            self._stretches = _stretches(world, lit=False)

    def grounds(self) -> dict[tuple[str, str], tuple[SharedStretch, bool]]:
        """Return all ground that two connections share, by their ids, and whether the first waits
        for the second by rule, and not by lights alone."""
        if self._world is None:
            return {}
        every = _stretches(self._world, lit=True)
        return {pair: (stretch, pair in self._stretches) for pair, stretch in every.items()}

    def taken(self, path: FrenetPath) -> tuple[Taken, ...]:
        """Return the connections that `path` follows, in its order."""
        if not len(self._probes):
            return ()
        place = path.locate(self._probes[..., :2].reshape(-1, 2))
        heading = path.yaw_at(place.arc_m)
        turned = wrap_angle(self._probes[..., 2].ravel() - heading)
        fits = (np.abs(place.offset_m) < _ON_PATH_M) & (np.abs(turned) < _ON_PATH_RAD)
        arcs = place.arc_m.reshape(-1, 3)
        on = fits.reshape(-1, 3).all(axis=1) & (np.diff(arcs, axis=1) > 0.0).all(axis=1)
        found = [Taken(self._connections[i], float(arcs[i, 0])) for i in np.flatnonzero(on)]
        return tuple(sorted(found, key=lambda taken: taken.from_arc_m))

    def between(self, taken: Sequence[tuple[Taken, ...]]) -> PathRules:
        """Return the rules among P paths, given what each of them takes."""
        count = len(taken)
        meetings = np.full((count, count, 4), np.nan)
        for p, mine in enumerate(taken):
            for one in mine:
                for q, others in enumerate(taken):
                    for other in others:
                        self._add(meetings[p, q], one, other)
        return PathRules(meetings, *_signals(taken))

    def ground(self, taken: Sequence[Taken], path: FrenetPath) -> SharedGround | None:
        """Return what other movements cross or join of a path, in its order; None for nothing."""
        lines = {connection.id: connection.centerline for connection in self._connections}
        rows = []
        for one in taken:
            for (wait, go), stretch in self._stretches.items():
                mine, theirs = (stretch.wait_in_m, stretch.wait_out_m), stretch[2:]
                other, waits = go, wait == one.connection.id
                if not waits:
                    mine, theirs, other = theirs, mine, wait
                if waits or go == one.connection.id:
                    x, y = direction_at(lines[other], sum(theirs) / 2.0)
                    yaw = float(np.arctan2(y, x))
                    rows.append((one.from_arc_m + mine[0], one.from_arc_m + mine[1], waits, yaw))
        if not rows:
            return None
        enter, leave, waits_there, their_yaw = np.array(sorted(rows)).T
        middle = path.point_at((enter + leave) / 2.0)
        return SharedGround(enter, leave, middle, waits_there > 0.5, their_yaw)

    def _add(self, into: Array, one: Taken, other: Taken) -> None:
        stretch = self._stretches.get((one.connection.id, other.connection.id))
        if stretch is None:
            return
        found = (
            one.from_arc_m + stretch.wait_in_m,
            one.from_arc_m + stretch.wait_out_m,
            other.from_arc_m + stretch.go_in_m,
            other.from_arc_m + stretch.go_out_m,
        )
        if not into[0] <= found[0]:
            into[:] = found


class PathRules(NamedTuple):
    """Rules among P paths.

    `meetings` (P, P, 4): [p, q] holds where p, which waits for q, enters and leaves the ground they
    share, then where q does, as arc lengths on either; NaN where p need not wait for q.
    `stop_arcs_m` (P, K) are stop lines with lights, infinite where there are less than K, and
    `stop_groups` (P, K) the light's place in `groups`.
    """

    meetings: Array
    stop_arcs_m: Array
    stop_groups: Indices
    groups: tuple[str, ...]

    def red(self, colours: Mapping[str, SignalColour]) -> Array:
        """Return (P, K) the arc lengths of stop lines that show no green, else infinite."""
        if not self.groups:
            return self.stop_arcs_m
        stop = np.array([colours.get(group, "dark") not in _GO for group in self.groups])
        return np.where(stop[self.stop_groups], self.stop_arcs_m, np.inf)


def _signals(
    taken: Sequence[tuple[Taken, ...]],
) -> tuple[Array, Indices, tuple[str, ...]]:
    """Return stop lines with lights of P paths: arc lengths, groups' places, groups."""
    lights = [[(one.from_arc_m, one.connection.signal_group_id) for one in mine] for mine in taken]
    kept = [[(arc, group) for arc, group in line if group is not None] for line in lights]
    groups = tuple(sorted({group for line in kept for _, group in line}))
    most = max((len(line) for line in kept), default=0)
    arcs = np.full((len(taken), most), np.inf)
    places = np.zeros((len(taken), most), dtype=np.intp)
    for p, line in enumerate(kept):
        for k, (arc, group) in enumerate(line):
            arcs[p, k], places[p, k] = arc, groups.index(group)
    return arcs, places, groups


def _probe(line: Array) -> Array:
    """Return (3, 3) x, y, heading at the start, the middle and the end of a polyline."""
    steps, arc = np.diff(line, axis=0), arc_lengths(line)
    at = np.array([0.0, 0.5, 1.0]) * arc[-1]
    step = np.minimum(np.searchsorted(arc, at, side="right") - 1, len(steps) - 1)
    return np.column_stack([points_at(line, at), np.arctan2(steps[step, 1], steps[step, 0])])


def _stretches(world: World, *, lit: bool) -> dict[tuple[str, str], SharedStretch]:
    """Return for each pair (who waits, who goes) the ground they share along their paths; with
    `lit` also of those whom lights keep apart."""
    by_id = {connection.id: connection for connection in world.connections}
    waits: list[Connection] = []
    goes: list[Connection] = []
    outlines = []
    for conflict in world.conflicts:
        first, second = by_id[conflict.first_id], by_id[conflict.second_id]
        both = first.signal_group_id is not None and second.signal_group_id is not None
        if both and not lit and conflict.rule not in _GREEN_KEEPS:
            continue
        first_waits = conflict.yields_id == first.id
        waits.append(first if first_waits else second)
        goes.append(second if first_waits else first)
        outlines.append(conflict.area)
    if not outlines:
        return {}
    # Outlines of ground that is long and bent may cross themselves.
    areas = shapely.make_valid(np.array([shapely.Polygon(one) for one in outlines], dtype=object))
    spans = np.hstack([_spans(waits, areas), _spans(goes, areas)])
    return {
        (wait.id, go.id): SharedStretch(*span)
        for wait, go, span in zip(waits, goes, spans.tolist(), strict=True)
    }


def _spans(connections: Sequence[Connection], areas: Array) -> Array:
    """Return (N, 2) between which arc lengths each path runs within its area; all of it if none."""
    strings = np.array([shapely.LineString(one.centerline) for one in connections], dtype=object)
    points, which = shapely.get_coordinates(shapely.intersection(strings, areas), return_index=True)
    arcs = shapely.line_locate_point(strings[which], shapely.points(points))
    low, high = np.full(len(strings), np.inf), np.full(len(strings), -np.inf)
    np.minimum.at(low, which, arcs)
    np.maximum.at(high, which, arcs)
    outside = low > high
    low[outside], high[outside] = 0.0, shapely.length(strings[outside])
    return np.column_stack([low, high])
