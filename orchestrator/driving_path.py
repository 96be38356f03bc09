"""The line a car is expected to drive along its route: in its lane, with rounded turns.

A future keeps the car's own lateral offset from this line, so its shape (heading and curvature)
matters more than its place across the road.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from contracts.arrays import Array
from orchestrator.route import Route, turn_angle
from world_gen.road_graph import DirectedEdge, RoadGraph

LANE_WIDTH_M = 3.0
KERB_TURN_RADIUS_M = 10.5
FAR_TURN_RADIUS_M = 9.5
"""Of the driven lane, in turns towards the near kerb and across the other side of the road.

Town driving on the Berlin drive (two turns, and one); smaller where the roads leave less room.
"""
BEND_RADIUS_M = 60.0
"""Of bends below `TURN_RAD`, where the road itself turns."""
TURN_RAD = math.radians(35.0)
SIMPLIFY_M = 0.5
SMOOTHING_M = 3.0
"""Standard deviation of the smoothing along the path."""
LANE_CHANGE_M = 8.0
"""Standard deviation of the same for the change from one lane offset to the next."""
PREPARE_TURN_M = 60.0
INSIDE_SHARE = 0.4
WIDENING_STEPS = 8
MAX_CURVATURE_PM = 0.18
"""A turning circle of 11 m, as of an ordinary car."""
SPACING_M = 1.0
_FINE_M = 0.5
_MARGIN_M = 60.0


class PathGeometry(NamedTuple):
    """A path in the graph's frame: points (N, 2) about 1 m apart.

    `speed_limit_mps` (N,) at each point; `s_m` (N,) is the route's position beside it.
    """

    xy_m: Array
    speed_limit_mps: Array
    s_m: Array


def driving_path(graph: RoadGraph, route: Route, *, s_from_m: float, s_to_m: float) -> PathGeometry:
    """Return the lane-centre path of `route` between two positions.

    It ends where the route ends. Raises ValueError where the stretch is empty or off the route.
    """
    begin, end = max(s_from_m, route.origin_m), min(s_to_m, route.end_m)
    if end - begin < 2.0 * SPACING_M:
        raise ValueError(
            f"no path from {s_from_m:.1f} m to {s_to_m:.1f} m: the route runs from "
            f"{route.origin_m:.1f} m to {route.end_m:.1f} m"
        )
    first, last = route.index_at(begin - _MARGIN_M), route.index_at(end + _MARGIN_M)
    line = route.line(first, last)
    step = np.hypot(*np.diff(line, axis=0).T)
    line = line[np.concatenate([[True], step > 0.05])]
    s = float(route.start_m[first]) + _cumulative(line)
    # Lengths of edges and of this line differ by rounding alone; stretch so that places agree.
    s = np.interp(s, [s[0], s[-1]], [float(route.start_m[first]), float(route.start_m[last + 1])])
    line, s = _clip(line, s, (begin - _MARGIN_M, end + _MARGIN_M))
    keep = _simplified(line)
    line, s = line[keep], s[keep]
    lanes = _LaneOffsets(graph, route, first, last)
    centre, place = _even(*_fillet(line, s, _turn_radii(graph, line, lanes.at(s))))
    centre = _smoothed(centre, SMOOTHING_M)
    offset = _held_in_curves(lanes.smooth_at(place), centre)
    xy = _drivable(_smoothed(centre + offset[:, None] * _normals(centre), 0.5 * SMOOTHING_M))
    return _resampled(route, xy, place, begin, end)


def _cumulative(line: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def _clip(line: Array, s: Array, window: tuple[float, float]) -> tuple[Array, Array]:
    """Cut a polyline to a window of s, with new vertices at the cuts."""
    low, high = max(window[0], s[0]), min(window[1], s[-1])
    inside = (s > low) & (s < high)
    ends = np.array([low, high])
    end_xy = np.stack([np.interp(ends, s, line[:, 0]), np.interp(ends, s, line[:, 1])], axis=-1)
    return (
        np.concatenate([end_xy[:1], line[inside], end_xy[1:]]),
        np.concatenate([ends[:1], s[inside], ends[1:]]),
    )


def _even(line: Array, s: Array) -> tuple[Array, Array]:
    """Return a polyline and its s resampled at even spacing."""
    arc = _cumulative(line)
    even = np.linspace(0.0, arc[-1], max(3, round(arc[-1] / _FINE_M) + 1))
    points = np.stack([np.interp(even, arc, line[:, k]) for k in (0, 1)], axis=-1)
    return points, np.interp(even, arc, s)


def _smoothed(points: Array, deviation_m: float) -> Array:
    """Smooth evenly spaced points; mirrored through themselves, the ends stay where they are."""
    pad = min(len(points) - 1, math.ceil(4.0 * deviation_m / _FINE_M))
    before = 2.0 * points[0] - points[pad:0:-1]
    after = 2.0 * points[-1] - points[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, points, after])
    smooth = gaussian_filter1d(padded, deviation_m / _FINE_M, axis=0)
    return np.asarray(smooth[pad : pad + len(points)])


def _simplified(line: Array) -> list[int]:
    """Return the indices that Douglas and Peucker (1973) keep within `SIMPLIFY_M`."""
    keep = np.zeros(len(line), dtype=bool)
    keep[[0, -1]] = True
    stack = [(0, len(line) - 1)]
    while stack:
        low, high = stack.pop()
        if high - low < 2:
            continue
        chord = line[high] - line[low]
        inner = line[low + 1 : high] - line[low]
        length = float(np.hypot(chord[0], chord[1]))
        if length < 1e-6:
            away = np.hypot(inner[:, 0], inner[:, 1])
        else:
            share = np.clip((inner @ chord) / length**2, 0.0, 1.0)
            off = inner - share[:, None] * chord
            away = np.hypot(off[:, 0], off[:, 1])
        worst = int(away.argmax())
        if away[worst] > SIMPLIFY_M:
            middle = low + 1 + worst
            keep[middle] = True
            stack += [(low, middle), (middle, high)]
    return [int(index) for index in np.flatnonzero(keep)]


def _turns(line: Array) -> Array:
    """Return the turn in radians at each inner vertex, positive to the left."""
    legs = np.diff(line, axis=0)
    turn = np.diff(np.arctan2(legs[:, 1], legs[:, 0]))
    return np.asarray((turn + np.pi) % (2.0 * np.pi) - np.pi)


def _turn_radii(graph: RoadGraph, line: Array, offset: Array) -> Array:
    """Return the radius of the road's line at each inner vertex, from that of the driven lane."""
    turn = _turns(line)
    to_kerb = turn > 0.0 if graph.driving_side == "left" else turn < 0.0
    lane_radius = np.where(to_kerb, KERB_TURN_RADIUS_M, FAR_TURN_RADIUS_M)
    radius = np.maximum(lane_radius + np.sign(turn) * offset[1:-1], 5.0)
    return np.asarray(np.where(np.abs(turn) < TURN_RAD, BEND_RADIUS_M, radius))


def _fillet(line: Array, s: Array, radius: Array) -> tuple[Array, Array]:
    """Replace corners by arcs of `radius` (N - 2,), or less where the legs are too short for it."""
    legs = np.diff(line, axis=0)
    length = np.hypot(legs[:, 0], legs[:, 1])
    heading = np.arctan2(legs[:, 1], legs[:, 0])
    turn = _turns(line)
    tangent_share = np.tan(np.minimum(np.abs(turn), 3.0) / 2.0)
    wanted = radius * tangent_share
    # Two corners share the leg between them in proportion to what they want.
    total = np.maximum(np.concatenate([[0.0], wanted]) + np.concatenate([wanted, [0.0]]), 1e-9)
    fits = np.minimum(1.0, 0.98 * length / total)
    tangent = wanted * np.minimum(fits[:-1], fits[1:])
    points, places = [line[:1]], [s[:1]]
    for corner in range(len(turn)):
        vertex, reach_m = line[corner + 1], tangent[corner]
        if abs(turn[corner]) < 1e-4 or reach_m < 1e-3:
            points.append(vertex[None])
            places.append(s[corner + 1 : corner + 2])
            continue
        start = vertex - reach_m * legs[corner] / length[corner]
        count = max(3, math.ceil(abs(turn[corner]) / 0.08))
        angles = np.linspace(0.0, turn[corner], count)
        arc_radius = reach_m / tangent_share[corner]
        side = math.copysign(1.0, turn[corner])
        normal = heading[corner] + side * math.pi / 2.0
        centre = start + arc_radius * np.array([math.cos(normal), math.sin(normal)])
        spokes = angles + normal + math.pi
        points.append(centre + arc_radius * np.stack([np.cos(spokes), np.sin(spokes)], axis=-1))
        places.append(np.linspace(s[corner + 1] - reach_m, s[corner + 1] + reach_m, count))
    return np.concatenate([*points, line[-1:]]), np.concatenate([*places, s[-1:]])


class _LaneOffsets:
    """How far left of the road's line the driven lane lies along a stretch of route."""

    def __init__(self, graph: RoadGraph, route: Route, first: int, last: int) -> None:
        self._offset = np.array([_lane_offset(graph, route, n) for n in range(first, last + 1)])
        self._start_m = route.start_m[first : last + 1]

    def at(self, s: Array) -> Array:
        """Return offsets (N,) at positions (N,), with steps where one edge follows another."""
        edge = np.searchsorted(self._start_m, s, side="right") - 1
        return np.asarray(self._offset[np.clip(edge, 0, len(self._offset) - 1)])

    def smooth_at(self, s: Array) -> Array:
        """Return the same at evenly spaced positions, changing gradually."""
        return np.asarray(gaussian_filter1d(self.at(s), LANE_CHANGE_M / _FINE_M, mode="nearest"))


def _drivable(points: Array) -> Array:
    """Widen turns that no car could steer, as far as that helps.

    It does where short edges left no room for an arc; in the hairpin of an island drawn as a V
    it does not, and the line stays as it was drawn.
    """
    best, least = points, float(np.abs(_curvature(points)).max())
    for _ in range(WIDENING_STEPS):
        tight = np.abs(_curvature(points)) > MAX_CURVATURE_PM
        if not tight.any():
            break
        near = gaussian_filter1d(tight.astype(np.float64), 8.0 / _FINE_M, mode="nearest")
        share = np.minimum(1.0, 2.0 * near / float(near.max()))[:, None]
        # Many small steps rather than one wide one, so that the rest stays where it is.
        points = points + share * (_smoothed(points, SMOOTHING_M) - points)
        tightest = float(np.abs(_curvature(points)).max())
        if tightest >= least:
            break
        best, least = points, tightest
    return best


def _curvature(points: Array) -> Array:
    """Return the curvature (N,) in 1/m of a path of evenly spaced points, positive to the left."""
    tangent = np.gradient(points, axis=0)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    return np.asarray(np.gradient(heading) / np.maximum(np.hypot(*tangent.T), 1e-3))


def _held_in_curves(offset: Array, centre: Array) -> Array:
    """Keep the lane from lying further inside a curve than a share of the curve's radius."""
    curvature = _curvature(centre)
    room = INSIDE_SHARE / np.maximum(np.abs(curvature), 1e-6)
    inside = np.sign(curvature) * offset
    return np.asarray(np.where(inside > room, np.sign(curvature) * room, offset))


def _lane_offset(graph: RoadGraph, route: Route, number: int) -> float:
    """Return the driven lane's offset from the way's line, positive to the left.

    The way is drawn in the middle of its carriageway. The lane is the middle one (of two, that
    nearer to the kerb), before a turn the one on the turn's side.
    """
    directed = route.edges[number]
    against = DirectedEdge(directed.edge, not directed.reverse)
    own = max(1, round(directed.lanes.value))
    other = max(1, round(against.lanes.value)) if against.allowed else 0
    left_hand = graph.driving_side == "left"
    turn = _next_turn(route, number)
    kerb_turn = turn if left_hand else -turn
    if kerb_turn > 0.0:
        lane = 0
    elif kerb_turn < 0.0:
        lane = own - 1
    else:
        lane = (own - 1) // 2
    from_kerb = LANE_WIDTH_M * (lane + 0.5)
    right_of_line = LANE_WIDTH_M * (own + other) / 2.0 - from_kerb
    return right_of_line if left_hand else -right_of_line


def _next_turn(route: Route, number: int) -> float:
    """Return the turn in radians within the next metres of an edge's end, 0 without any."""
    length_m = 0.0
    for after in range(number + 1, len(route.edges)):
        before = route.edges[max(0, after - 4) : after]
        turn = turn_angle(before, route.edges[after])
        if abs(turn) > TURN_RAD:
            return turn
        length_m += route.edges[after].edge.length_m
        if length_m > PREPARE_TURN_M:
            break
    return 0.0


def _normals(points: Array) -> Array:
    """Return unit normals (N, 2) to the left of a path."""
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    return np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)


def _resampled(route: Route, xy: Array, place: Array, begin: float, end: float) -> PathGeometry:
    arc = _cumulative(xy)
    low, high = np.interp([begin, end], place, arc)
    even = np.linspace(low, high, max(2, round((high - low) / SPACING_M) + 1))
    points = np.stack([np.interp(even, arc, xy[:, k]) for k in (0, 1)], axis=-1)
    s = np.interp(even, arc, place)
    limits = np.array([directed.edge.speed_limit_mps.value for directed in route.edges])
    edge = np.clip(np.searchsorted(route.start_m, s, side="right") - 1, 0, len(route.edges) - 1)
    return PathGeometry(points, limits[edge], s)
