"""The paths of connections: as wide as the place allows, along its inner roads where these lead."""

from __future__ import annotations

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.bends import rounded_through
from foretwin.geometry.polyline import cross, offset, turn_rad, without_repeats
from foretwin.geometry.polyline_batch import Polylines
from foretwin.geometry.steering import LEAST_RADIUS_M
from foretwin.geometry.turn_curves import turn_curves
from foretwin.world_gen.connections.inner_lanes import paths_along_inner_lanes
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings

_LONG_PATH_M = 25.0
_MAX_DETOUR_M = 9.0
_GUIDED_RADIUS_M = 12.0
_GRID_SHARE = 0.95
_LONGEST_CHORD_M, _SHARPEST_LANE_PM = 8.0, 0.12
"""Lanes with longer pieces at an end are straight there; what bends more is a kink of the map."""


def draw_paths(connections: list[ConnectionDraft], around: Surroundings, notes: list[str]) -> None:
    """Lay the path of every connection, and name those that the map makes tighter than 4 m.

    Connections between lanes that nearly touch, and that no wheel could turn between, are taken
    out of the list and named.
    """
    if not connections:
        return
    begins = np.array([c.start.centerline[-1] for c in connections])
    ends = np.array([c.end.centerline[0] for c in connections])
    headings = _units(begins - np.array([c.start.centerline[-2] for c in connections]))
    end_headings = _units(np.array([c.end.centerline[1] for c in connections]) - ends)
    bends = _bends([c.start.centerline[-3:] for c in connections])
    end_bends = _bends([c.end.centerline[:3] for c in connections])
    turns = turn_curves(begins, headings, ends, end_headings, bend_pm=bends, end_bend_pm=end_bends)
    for c, path in zip(connections, turns.lines.split(), strict=True):
        c.centerline = path
    fits = turns.radius_m > 0.0
    if not fits.all():
        _leave_out([c for c, ok in zip(connections, fits, strict=True) if not ok], notes)
        connections[:] = [c for c, ok in zip(connections, fits, strict=True) if ok]
        begins, ends = begins[fits], ends[fits]
        headings, end_headings = headings[fits], end_headings[fits]
    inside = paths_along_inner_lanes(connections, around)
    for i, path in inside.items():
        connections[i].centerline = path
    long = [i for i, c in enumerate(connections) if i not in inside and _inner_m(c) > _LONG_PATH_M]
    poses = list(zip(begins, headings, ends, end_headings, connections, strict=True))
    guided = _guided([_along_path(*poses[i], around) for i in long])
    straight = [connections[i].centerline for i in long]
    far = shapely.hausdorff_distance(_line_strings(straight), _line_strings(guided))
    for i, path, detour_m in zip(long, guided, far.tolist(), strict=True):
        if detour_m > _MAX_DETOUR_M:
            connections[i].centerline = path
    # Points on the millimetre grid bend a little more than the arcs that they stand for.
    least = _GRID_SHARE * LEAST_RADIUS_M
    tightest_m = _tightest_m([c.centerline for c in connections]).tolist()
    for c, radius_m in zip(connections, tightest_m, strict=True):
        if radius_m < least:
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
        curved = (length.max(axis=1) < _LONGEST_CHORD_M) & (np.abs(np.abs(bend) - 0.07) < 0.05)
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


def _units(vectors: Array) -> Array:
    norm = np.hypot(vectors[:, 0], vectors[:, 1])
    return np.asarray(vectors / np.maximum(norm, 1e-9)[:, None])


def _line_strings(lines: list[Array]) -> np.ndarray:
    return np.array([shapely.LineString(line) for line in lines], dtype=object)


def _guided(lines: list[Array]) -> list[Array]:
    """Return lines with their corners rounded, on the millimetre grid but for their ends."""
    if not lines:
        return []
    nothing = np.full((len(lines), 2), np.nan)
    wide = np.full(len(lines), _GUIDED_RADIUS_M)
    rounded = rounded_through(Polylines.of(lines), wide, nothing, nothing).lines.split()
    return [
        np.concatenate([line[:1], np.round(path[1:-1], 3), line[-1:]])
        for line, path in zip(lines, rounded, strict=True)
    ]


def _along_path(
    begin: Array,
    heading: Array,
    finish: Array,
    end_heading: Array,
    connection: ConnectionDraft,
    around: Surroundings,
) -> Array:
    """Return a path that follows the inner edges on the driver's side of them."""
    points = [begin, begin + 2.0 * heading]
    for part in connection.movement.inside:
        lanes = around.lanes_along(part).driven
        middle = lanes[len(lanes) // 2].left_m if lanes else 0.0
        line = offset(without_repeats(part.xy_m), -middle if part.reverse else middle)
        keep = line[1:-1] if len(line) > 3 else (line[:1] + line[-1:]) / 2.0
        points.extend(
            p
            for p in keep
            if (p - points[-1]) @ (p - begin) > 0.0 and np.hypot(*(p - points[-1])) > 3.0
        )
    points.extend([finish - 2.0 * end_heading, finish])
    return without_repeats(np.array(points))
