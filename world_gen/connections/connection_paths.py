"""The paths of connections: as wide as the place allows, along its inner roads where these lead."""

from __future__ import annotations

import math

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.back_turns import back_turns, with_bows
from foretwin.geometry.polyline import (
    cross,
    offset,
    turn_rad,
    units,
    without_repeats,
)
from foretwin.geometry.polyline_batch import Polylines
from foretwin.geometry.splines import through_corners
from foretwin.geometry.steering import LEAST_GRID_RADIUS_M
from foretwin.geometry.turn_curves import turn_curves
from foretwin.world_gen.connections.inner_lanes import paths_along_inner_lanes
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings

_LONG_PATH_M = 25.0
_MAX_DETOUR_M = 9.0
_GUIDED_RADIUS_M = 12.0
_LONGEST_CHORD_M = 8.0
"""Lanes with longer pieces at an end are straight there."""
_LANE_BENDS_PM = 0.02, 0.12
"""Lanes that bend less are all but straight; what bends more is a kink of the map."""
_BACK_RAD = math.radians(165.0)
"""Who turns farther may swing out first."""
_ON_THE_SPOT_M = 0.75
"""No car turns so tightly, be it in several moves."""


def draw_paths(connections: list[ConnectionDraft], around: Surroundings, notes: list[str]) -> None:
    """Lay the path of every connection, and name those that the map makes tighter than 4 m.

    Connections between lanes that nearly touch, and that no wheel could turn between, are taken
    out of the list and named.
    """
    if not connections:
        return
    begins = np.array([c.start.centerline[-1] for c in connections])
    ends = np.array([c.end.centerline[0] for c in connections])
    headings = units(begins - np.array([c.start.centerline[-2] for c in connections]))
    end_headings = units(np.array([c.end.centerline[1] for c in connections]) - ends)
    bends = _bends([c.start.centerline[-3:] for c in connections])
    end_bends = _bends([c.end.centerline[:3] for c in connections])
    turns = turn_curves(begins, headings, ends, end_headings, bend_pm=bends, end_bend_pm=end_bends)
    paths = turns.lines.split()
    back = np.abs(turn_rad(headings, end_headings)) > _BACK_RAD
    # A bow takes room beside the road: who does not mean to turn back gets it but in need.
    meant = np.array([c.turn == "u_turn" for c in connections])
    on_the_spot = (turns.radius_m > 0.0) & (turns.radius_m < _ON_THE_SPOT_M)
    back &= np.where(meant, turns.radius_m < LEAST_GRID_RADIUS_M, on_the_spot)
    tight = np.nonzero(back)[0]
    drawn: dict[int, Array] = {}
    if len(tight):
        poses = (begins, headings, ends, end_headings)
        bows = back_turns(*(a[tight] for a in poses)).split()
        wider = _tightest_m(bows) > turns.radius_m[tight]
        drawn |= {i: bow for i, bow, ok in zip(tight.tolist(), bows, wider, strict=True) if ok}
    drawn |= paths_along_inner_lanes(connections, around)
    long = [i for i, c in enumerate(connections) if i not in drawn and _inner_m(c) > _LONG_PATH_M]
    guided = [
        through_corners(
            _along_path(begins[i], headings[i], ends[i], end_headings[i], connections[i], around),
            radius_m=_GUIDED_RADIUS_M,
        )
        for i in long
    ]
    far = shapely.hausdorff_distance(_line_strings([paths[i] for i in long]), _line_strings(guided))
    drawn |= {i: p for i, p, m in zip(long, guided, far.tolist(), strict=True) if m > _MAX_DETOUR_M}
    for i, c in enumerate(connections):
        c.centerline = drawn.get(i, paths[i])
    fits = [i in drawn or radius_m > 0.0 for i, radius_m in enumerate(turns.radius_m.tolist())]
    if not all(fits):
        _leave_out([c for c, ok in zip(connections, fits, strict=True) if not ok], notes)
        connections[:] = [c for c, ok in zip(connections, fits, strict=True) if ok]
    tightest_m = _tightest_m([c.centerline for c in connections]).tolist()
    for c, radius_m in zip(connections, tightest_m, strict=True):
        if radius_m < LEAST_GRID_RADIUS_M:
            notes.append(
                f"way {c.start.edge.way_id}: room for a radius of {radius_m:.1f} m alone "
                f"into way {c.end.edge.way_id} ({c.turn})"
            )


def _bends(lines: list[Array]) -> Array:
    """Return the curvatures of lanes by the three points (3, 2) at an end of each, (L,).

    They are 0 where a lane has two points, and where it ends so far from its bend that it ends
    straight.
    """
    known = [i for i, line in enumerate(lines) if len(line) == 3]
    found = np.zeros(len(lines))
    if known:
        steps = np.diff(np.array([lines[i] for i in known]), axis=1)
        length = np.hypot(steps[..., 0], steps[..., 1])
        bend = turn_rad(steps[:, 0], steps[:, 1]) / np.maximum(length.mean(axis=1), 1e-3)
        curved = (length.max(axis=1) < _LONGEST_CHORD_M) & (np.abs(bend) < _LANE_BENDS_PM[1])
        curved &= np.abs(bend) > _LANE_BENDS_PM[0]
        found[known] = np.where(curved, bend, 0.0)
    return found


def _leave_out(connections: list[ConnectionDraft], notes: list[str]) -> None:
    for c in connections:
        c.start.successors.remove(c.id)
        notes.append(
            f"way {c.start.edge.way_id}: no room at all to turn into way {c.end.edge.way_id} "
            f"({c.turn}); left out"
        )


def _tightest_m(paths: list[Array]) -> Array:
    """Return for each path (N, 2) the least radius of circles through three points in a row."""
    lines = Polylines.of(paths)
    step, length = lines.steps
    # Point by point: from the one before, to the next, and from the one before to the next.
    before, after = np.roll(step, 1, axis=0), step
    both = before + after
    product = np.roll(length, 1) * length * np.hypot(both[:, 0], both[:, 1])
    inside = ~lines.is_last
    inside[lines.first[:-1]] = False
    bent = np.where(inside, 2.0 * np.abs(cross(before, after)) / np.maximum(product, 1e-12), 0.0)
    return np.asarray(1.0 / np.maximum(np.maximum.reduceat(bent, lines.first[:-1]), 1e-9))


def _inner_m(connection: ConnectionDraft) -> float:
    return sum(part.edge.length_m for part in connection.movement.inside)


def _line_strings(lines: list[Array]) -> np.ndarray:
    return np.array([shapely.LineString(line) for line in lines], dtype=object)


def _along_path(
    begin: Array,
    heading: Array,
    finish: Array,
    end_heading: Array,
    connection: ConnectionDraft,
    around: Surroundings,
) -> Array:
    """Return a path that follows the inner edges on the driver's side of them."""
    back = connection.turn == "u_turn"
    points = [begin, begin + 2.0 * heading]
    for part in connection.movement.inside:
        lanes = around.lanes_along(part).driven
        # Of two lanes the one at the kerb.
        from_left = (len(lanes) - (around.driving_side == "left")) // 2
        middle = lanes[from_left].left_m if lanes else 0.0
        line = offset(without_repeats(part.xy_m), -middle if part.reverse else middle)
        keep = line[1:-1] if len(line) > 3 else (line[:1] + line[-1:]) / 2.0
        points.extend(
            p
            for p in keep
            # Who turns back comes nearer to where the turn began.
            if (back or (p - points[-1]) @ (p - begin) > 0.0) and np.hypot(*(p - points[-1])) > 3.0
        )
    points.extend([finish - 2.0 * end_heading, finish])
    line = without_repeats(np.array(points))
    return with_bows(line) if back else line
