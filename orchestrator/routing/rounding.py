"""Lines with rounded corners: the geometry under driving paths, with arc lengths carried along."""

from __future__ import annotations

import math

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.polyline import arc_lengths, interpolated, left_of, tangents, unit
from foretwin.geometry.steering import DRIVEN_CURVATURE_PM
from foretwin.geometry.turn_curves import turn_curves

FINE_M = 0.5
"""Spacing of lines while they are worked on."""
SIMPLIFY_M = 0.5
ARC_ROOM_M = 15.0
WIDENING_M = 3.0
WIDENING_STEPS = 8
TIGHT_M = 9.0
"""At junctions in towns turns are driven wider where there is room: see `driving_path.py`.

A World's connections turn as its kerbs do, some at 4.5 m. Driven as they are, futures slow down too
much for them: their mean error up to 1 s is 0.143 m, not 0.136 (path_against_lanes, in the tests).
"""
ONE_TURN_M = 6.0
"""Tight pieces so near to one another are one turn."""
STRAIGHT_M = 0.05
"""What leaves a straight piece by no more belongs to it, such as a node between two fine points.

In arcs through a bend's nodes the nominal future's mean error up to 2 s on the freeway of comma2k19
is 0.203 m, not 0.237, and on the Berlin drive it stays (`python -m tests.trust.nominal`); how far
corners may be cut, 0.25 to 2 m, makes no difference there.
"""
BEND_RAD = math.radians(20.0)
"""One that turns more at a node is a corner."""
BEND_WITHIN_M = 1.0
"""A bend leaves the map's line by no more: what lines of maps are wrong by, and less than lanes
have beside a car."""
BEND_SMOOTHING_M = 6.0
"""Standard deviation of the smoothing that makes one bend of a map's corners."""
TURN_WITHIN_M, TURNED_RAD = 30.0, math.radians(45.0)
"""What turns more within so many metres is a turn at a junction, and stays as sharp as it is."""
TURN_ROOM_M = 12.0
"""A wider turn begins and ends so far from the tight one at most."""
TURN_ROUND_M, TURN_ROUND_ASIDE_M = 15.0, 7.0
"""A car that turns back in its road leaves its line so far before, and by so much to either side:
a turning circle of 12 m. Chosen."""


def clip(line: Array, s: Array, window: tuple[float, float]) -> tuple[Array, Array]:
    """Cut a polyline to a window of s, with new vertices at the cuts."""
    low, high = max(window[0], s[0]), min(window[1], s[-1])
    inside = (s > low) & (s < high)
    ends = np.array([low, high])
    end_xy = interpolated(ends, s, line)
    return (
        np.concatenate([end_xy[:1], line[inside], end_xy[1:]]),
        np.concatenate([ends[:1], s[inside], ends[1:]]),
    )


def evenly_spaced(line: Array, s: Array) -> tuple[Array, Array]:
    """Return a polyline and its s resampled at even spacing."""
    arc = arc_lengths(line)
    even = np.linspace(0.0, arc[-1], max(3, round(arc[-1] / FINE_M) + 1))
    return interpolated(even, arc, line), np.interp(even, arc, s)


def turns(line: Array) -> Array:
    """Return the turn in radians at each inner vertex, positive to the left."""
    legs = np.diff(line, axis=0)
    return np.asarray(wrap_angle(np.diff(np.arctan2(legs[:, 1], legs[:, 0]))))


def without_straight(line: Array, s: Array) -> list[int]:
    """Return the indices without vertices near a corner where the line goes all but straight on.

    A side road that joins there must not shorten the leg that the corner's arc may use.
    """
    turn = np.abs(turns(line))
    corners = s[1:-1][turn > math.radians(35.0)]
    near = (np.abs(s[1:-1, None] - corners[None, :]) < ARC_ROOM_M).any(axis=1)
    keep = np.concatenate([[True], ~(near & (turn < math.radians(3.0))), [True]])
    return [int(index) for index in np.flatnonzero(keep)]


def turned_round(line: Array, s: Array, at_m: float, *, left: float) -> tuple[Array, Array]:
    """Return a line that goes back along itself from `at_m`, swung out there as a car turns round.

    To its other side first and then to the left, or to the right with `left` -1.
    """
    near = [at_m - TURN_ROUND_M, at_m, at_m + TURN_ROUND_M]
    begin, tip, end = interpolated(np.array(near), s, line)
    aside = left * TURN_ROUND_ASIDE_M * left_of(unit(tip - begin))
    before, after = s < near[0], s > near[2]
    swung = [begin, tip - aside, tip + aside, end]
    places = [near[0], at_m - TURN_ROUND_ASIDE_M, at_m + TURN_ROUND_ASIDE_M, near[2]]
    return (
        np.concatenate([line[before], swung, line[after]]),
        np.concatenate([s[before], np.clip(places, s[0], s[-1]), s[after]]),
    )


def fillet(line: Array, s: Array, radius: Array) -> tuple[Array, Array]:
    """Replace corners by arcs of `radius` (N - 2,), or less where the legs are too short for it."""
    legs = np.diff(line, axis=0)
    length = np.hypot(legs[:, 0], legs[:, 1])
    heading = np.arctan2(legs[:, 1], legs[:, 0])
    turn = turns(line)
    tangent_share = np.tan(np.minimum(np.abs(turn), 3.0) / 2.0)
    wanted = radius * tangent_share
    # Two corners share the leg between them in proportion to what they want.
    total = np.maximum(np.concatenate([[0.0], wanted]) + np.concatenate([wanted, [0.0]]), 1e-9)
    fits = np.minimum(1.0, 0.98 * length / total)
    tangent = wanted * np.minimum(fits[:-1], fits[1:])
    round_off = (np.abs(turn) >= 1e-4) & (tangent >= 1e-3)
    corner = np.flatnonzero(round_off)
    turn, reach_m, at_m = turn[corner], tangent[corner], s[corner + 1]
    start = line[corner + 1] - reach_m[:, None] * legs[corner] / length[corner, None]
    count = np.maximum(3, np.ceil(np.abs(turn) / 0.08)).astype(int)
    arc_radius = reach_m / tangent_share[corner]
    normal = heading[corner] + np.copysign(1.0, turn) * math.pi / 2.0
    aside = np.array([(math.cos(angle), math.sin(angle)) for angle in normal.tolist()])
    centre = start + arc_radius[:, None] * aside.reshape(-1, 2)
    # All points of all arcs: of which one each is, and its number there.
    arc = np.repeat(np.arange(len(corner)), count)
    number = np.arange(len(arc)) - np.repeat(np.cumsum(count) - count, count)

    def evenly(begin: Array, end: Array) -> Array:
        step = (end - begin) / (count - 1)
        return np.where(number == count[arc] - 1, end[arc], number * step[arc] + begin[arc])

    spokes = evenly(np.zeros(len(corner)), turn) + normal[arc] + math.pi
    spread = np.stack([np.cos(spokes), np.sin(spokes)], axis=-1)
    times = np.ones(len(round_off), dtype=int)
    times[corner] = count
    points, places = np.repeat(line[1:-1], times, axis=0), np.repeat(s[1:-1], times)
    of_arcs = np.repeat(round_off, times)
    points[of_arcs] = centre[arc] + arc_radius[arc, None] * spread
    places[of_arcs] = evenly(at_m - reach_m, at_m + reach_m)
    # Where the line swings out it is longer than its s, and two arcs may lie on the same of that.
    rising = np.maximum.accumulate(np.concatenate([s[:1], places, s[-1:]]))
    return np.concatenate([line[:1], points, line[-1:]]), rising


def smoothed(points: Array, deviation_m: float) -> Array:
    """Smooth evenly spaced points; mirrored through themselves, the ends stay where they are."""
    pad = min(len(points) - 1, math.ceil(4.0 * deviation_m / FINE_M))
    before = 2.0 * points[0] - points[pad:0:-1]
    after = 2.0 * points[-1] - points[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, points, after])
    smooth = gaussian_filter1d(padded, deviation_m / FINE_M, axis=0)
    return np.asarray(smooth[pad : pad + len(points)])


def simplified(line: Array) -> list[int]:
    """Return the indices that Douglas and Peucker (1973) keep within `SIMPLIFY_M`."""
    numbered = shapely.linestrings(np.column_stack([line, np.arange(len(line))]))
    kept = shapely.simplify(numbered, SIMPLIFY_M, preserve_topology=False)
    indices: list[int] = shapely.get_coordinates(kept, include_z=True)[:, 2].astype(int).tolist()
    return indices


def curvature_pm(points: Array) -> Array:
    """Return the curvature (N,) in 1/m of a path of evenly spaced points, positive to the left."""
    tangent = np.gradient(points, axis=0)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    return np.asarray(np.gradient(heading) / np.maximum(np.hypot(*tangent.T), 1e-3))


def normals(points: Array) -> Array:
    """Return unit normals (N, 2) to the left of a path."""
    return left_of(tangents(points))


def drivable(points: Array) -> Array:
    """Widen turns that are too tight to be driven along, as far as that helps.

    It does where short edges left no room for an arc; in the hairpin of an island drawn as a V
    it does not, and the line stays as it was drawn.
    """
    best, least = points, float(np.abs(curvature_pm(points)).max())
    for _ in range(WIDENING_STEPS):
        tight = np.abs(curvature_pm(points)) > DRIVEN_CURVATURE_PM
        if not tight.any():
            break
        near = gaussian_filter1d(tight.astype(np.float64), 8.0 / FINE_M, mode="nearest")
        share = np.minimum(1.0, 2.0 * near / float(near.max()))[:, None]
        # Many small steps rather than one wide one, so that the rest stays where it is.
        points = points + share * (smoothed(points, WIDENING_M) - points)
        tightest = float(np.abs(curvature_pm(points)).max())
        if tightest >= least:
            break
        best, least = points, tightest
    return best


def with_driven_bends(points: Array, s: Array) -> tuple[Array, Array]:
    """Return a line, drawn as straight pieces through a road's bends, as it is driven: in arcs.

    The line leaves each node by at most `SIMPLIFY_M`. A node where it turns more than `BEND_RAD` is
    a corner and stays one.
    """
    numbered = shapely.linestrings(np.column_stack([points, np.arange(len(points))]))
    kept = shapely.simplify(numbered, STRAIGHT_M, preserve_topology=False)
    corners = shapely.get_coordinates(kept, include_z=True)[:, 2].astype(int)
    line, turn = points[corners], np.abs(turns(points[corners]))
    cut = 1.0 / np.cos(np.minimum(turn, 1.0) / 2.0) - 1.0
    radius = np.where(turn < BEND_RAD, SIMPLIFY_M / np.maximum(cut, 1e-9), 0.0)
    return fillet(line, s[corners], radius)


def with_whole_bends(points: Array) -> Array:
    """Return evenly spaced points (N, 2) with the corners of a road's bend driven as one bend.

    A map has a bend as some corners, and a future would brake for each as if it were the bend. What
    smoothing takes away is smoothed and given back, so that arcs stay where they are: Tukey (1977),
    Exploratory Data Analysis, calls it twicing. Points move by `BEND_WITHIN_M` at most, and not in
    turns at junctions.
    """
    once = smoothed(points, BEND_SMOOTHING_M)
    moved = 2.0 * once - smoothed(once, BEND_SMOOTHING_M) - points
    way, at = tangents(smoothed(points, 1.0)), np.arange(len(points))
    half = round(TURN_WITHIN_M / 2.0 / FINE_M)
    ahead, behind = np.minimum(at + half, at[-1]), np.maximum(at - half, 0)
    turns_off = (way[ahead] * way[behind]).sum(axis=1) < math.cos(TURNED_RAD)
    share = BEND_WITHIN_M / np.maximum(np.hypot(*moved.T), BEND_WITHIN_M)
    room = 2 * round(BEND_SMOOTHING_M / FINE_M) + 1
    least = minimum_filter1d(np.where(turns_off, 0.0, share), room, mode="nearest")
    share = gaussian_filter1d(least, BEND_SMOOTHING_M / 2.0 / FINE_M, mode="nearest")
    return np.asarray(points + share[:, None] * moved)


def with_driven_turns(
    points: Array, s: Array, radius_m: tuple[float, float]
) -> tuple[Array, Array]:
    """Widen turns that are tighter than any car is driven in town, as far as there is room.

    `radius_m` is that of turns to the left and to the right. Takes evenly spaced points and gives
    them: each such turn is an arc between the headings some metres before and behind it.
    """
    bend = curvature_pm(smoothed(points, 1.0))
    tight = np.flatnonzero(np.abs(bend) > 1.0 / TIGHT_M)
    if not len(tight):
        return points, s
    apart = (np.diff(tight) * FINE_M > ONE_TURN_M) | (np.diff(np.sign(bend[tight])) != 0.0)
    turn = np.split(tight, np.flatnonzero(apart) + 1)
    ends = [0, *(place for inner in turn for place in (inner[0], inner[-1])), len(points) - 1]
    tangent = tangents(points)
    for number in reversed(range(len(turn))):  # from behind, so that what is before keeps its place
        before, low, high, after = ends[2 * number : 2 * number + 4]
        room = min(low - before, after - high, round(TURN_ROOM_M / FINE_M))
        first, last = low - np.arange(1, room + 1), high + np.arange(1, room + 1)
        found = turn_curves(points[first], tangent[first], points[last], tangent[last])
        if not found.radius_m.any():
            continue
        wide = found.radius_m >= radius_m[0 if bend[low] > 0.0 else 1]
        best = int(wide.argmax() if wide.any() else found.radius_m.argmax())
        begin, end, line = first[best], last[best], found.lines.split()[best]
        arc = arc_lengths(line)
        places = s[begin] + (s[end] - s[begin]) * arc / arc[-1]
        points = np.concatenate([points[:begin], line, points[end + 1 :]])
        s = np.concatenate([s[:begin], places, s[end + 1 :]])
    return evenly_spaced(points, s)
