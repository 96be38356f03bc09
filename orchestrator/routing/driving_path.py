"""The line a car is expected to drive along its route: in its lane, with rounded turns.

Lanes are those of the roads' cross-sections, or of a World where the caller leads the line there.

A future keeps the car's own lateral offset from this line, so its shape (heading and curvature)
matters more than its place across the road.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import msgspec
import numpy as np
from scipy.ndimage import gaussian_filter1d

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide
from foretwin.geometry.polyline import apart, arc_lengths, interpolated
from foretwin.orchestrator.routing.rounding import (
    FINE_M,
    clip,
    curvature_pm,
    drivable,
    evenly_spaced,
    fillet,
    normals,
    simplified,
    smoothed,
    turned_round,
    turns,
    with_driven_bends,
    with_driven_turns,
    with_whole_bends,
    without_straight,
)
from foretwin.orchestrator.routing.route import Route, turn_angle
from foretwin.world_gen.lanes.cross_section import cross_section

KERB_TURN_RADIUS_M = 10.5
FAR_TURN_RADIUS_M = 9.5
"""Of the driven lane, in turns towards the near kerb and across the other side of the road.

Town driving on the Berlin drive (two turns, and one); smaller where the roads leave less room.
"""
BEND_RADIUS_M = 60.0
"""Of bends below `TURN_RAD`, where the road itself turns."""
TURN_RAD = math.radians(35.0)
SMOOTHING_M = 3.0
"""Standard deviation of the smoothing along the path."""
LANE_CHANGE_M = 8.0
"""Standard deviation of the same for the change from one lane offset to the next."""
PREPARE_TURN_M = 60.0
INSIDE_SHARE = 0.4
SPACING_M = 1.0
_MARGIN_M = 60.0


class PathGeometry(NamedTuple):
    """A path in the graph's frame: points (N, 2) about 1 m apart.

    `speed_limit_mps` (N,) at each point; `s_m` (N,) is the route's position beside it.
    """

    xy_m: Array
    speed_limit_mps: Array
    s_m: Array


def driving_path(
    route: Route,
    *,
    s_from_m: float,
    s_to_m: float,
    onto_lanes: Callable[[Array, Array], Array] | None = None,
) -> PathGeometry:
    """Return the lane-centre path of `route` between two positions.

    `onto_lanes` moves points (N, 2), with the route's s (N,) beside them, to lanes known better
    than from their roads. The path ends where the route ends. Raises ValueError where the stretch
    is empty or off the route.
    """
    begin, end = max(s_from_m, route.origin_m), min(s_to_m, route.end_m)
    if end - begin < 2.0 * SPACING_M:
        raise ValueError(
            f"no path from {s_from_m:.1f} m to {s_to_m:.1f} m: the route runs from "
            f"{route.origin_m:.1f} m to {route.end_m:.1f} m"
        )
    first, last = route.index_at(begin - _MARGIN_M), route.index_at(end + _MARGIN_M)
    line, s = clip(*_centre_line(route, first, last), (begin - _MARGIN_M, end + _MARGIN_M))
    radii_m = turn_radii(route.edges[first].edge.driving_side)
    lanes = _LaneOffsets(route, first, last)
    centre, place = evenly_spaced(*fillet(line, s, _turn_radii(radii_m, line, lanes.at(s))))
    centre = smoothed(centre, SMOOTHING_M)
    offset = _held_in_curves(lanes.smooth_at(place), centre)
    xy = drivable(smoothed(centre + offset[:, None] * normals(centre), 0.5 * SMOOTHING_M))
    if onto_lanes is not None:
        xy, place = evenly_spaced(*with_driven_bends(onto_lanes(xy, place), place))
        xy, place = with_driven_turns(with_whole_bends(xy), place, radii_m)
        xy = drivable(smoothed(xy, 0.5 * SMOOTHING_M))
    return _resampled(route, xy, place, begin, end)


def turn_radii(driving_side: DrivingSide) -> tuple[float, float]:
    """Return the radii in metres of the driven lane in turns to the left and to the right."""
    radii = KERB_TURN_RADIUS_M, FAR_TURN_RADIUS_M
    return radii if driving_side == "left" else radii[::-1]


def _turn_radii(radii_m: tuple[float, float], line: Array, offset: Array) -> Array:
    """Return the radius of the road's line at each inner vertex, from that of the driven lane."""
    turn = turns(line)
    lane_radius = np.where(turn > 0.0, *radii_m)
    radius = np.maximum(lane_radius + np.sign(turn) * offset[1:-1], 5.0)
    return np.asarray(np.where(np.abs(turn) < TURN_RAD, BEND_RADIUS_M, radius))


def _centre_line(route: Route, first: int, last: int) -> tuple[Array, Array]:
    """Return the roads' line and its s, simplified edge by edge: the same in every window."""
    points, places = [route.edges[first].xy_m[:1]], [route.start_m[first : first + 1]]
    for number in range(first, last + 1):
        line = route.edges[number].xy_m
        arc = arc_lengths(line)
        keep = simplified(line)[1:]
        points.append(line[keep])
        places.append(float(route.start_m[number]) + arc[keep])
    line, s = np.concatenate(points), np.concatenate(places)
    for number in range(first, last):
        if route.edges[number].turns_back(route.edges[number + 1]):
            left = 1.0 if route.edges[number].edge.driving_side == "right" else -1.0
            line, s = turned_round(line, s, float(route.start_m[number + 1]), left=left)
    kept = apart(line, tolerance_m=0.05)
    line, s = line[kept], s[kept]
    bends = without_straight(line, s)
    return line[bends], s[bends]


class _LaneOffsets:
    """How far left of the road's line the driven lane lies along a stretch of route."""

    def __init__(self, route: Route, first: int, last: int) -> None:
        known = route.known_offset_m
        for number in range(first, last + 1):
            if number not in known:
                known[number] = _lane_offset(route, number)
        self._offset = np.array([known[number] for number in range(first, last + 1)])
        self._start_m = route.start_m[first : last + 1]

    def at(self, s: Array) -> Array:
        """Return offsets (N,) at positions (N,), with steps where one edge follows another."""
        edge = np.searchsorted(self._start_m, s, side="right") - 1
        return np.asarray(self._offset[np.clip(edge, 0, len(self._offset) - 1)])

    def smooth_at(self, s: Array) -> Array:
        """Return the same at evenly spaced positions, changing gradually."""
        return np.asarray(gaussian_filter1d(self.at(s), LANE_CHANGE_M / FINE_M, mode="nearest"))


def _held_in_curves(offset: Array, centre: Array) -> Array:
    """Keep the lane from lying further inside a curve than a share of the curve's radius."""
    curvature = curvature_pm(centre)
    room = INSIDE_SHARE / np.maximum(np.abs(curvature), 1e-6)
    inside = np.sign(curvature) * offset
    return np.asarray(np.where(inside > room, np.sign(curvature) * room, offset))


def _lane_offset(route: Route, number: int) -> float:
    """Return the driven lane's offset from the way's line, positive to the left.

    The lane is the middle one (of two, that nearer to the kerb), before a turn the one on the
    turn's side. What is driven as the map forbids (the drive may be older) counts as allowed.
    """
    edge, reverse = route.edges[number]
    used = msgspec.structs.replace(
        edge, forward=edge.forward or not reverse, backward=edge.backward or reverse
    )
    driven = cross_section(used).along(reverse=reverse).driven
    own = [lane for lane in driven if lane.kind == "driving"] or driven
    turn = _next_turn(route, number)
    if turn == 0.0:
        lane = own[(len(own) if edge.driving_side == "right" else len(own) - 1) // 2]
    else:
        lane = own[0 if turn > 0.0 else -1]
    return -lane.left_m if reverse else lane.left_m


def _next_turn(route: Route, number: int) -> float:
    """Return the turn in radians within the next metres of an edge's end, 0 without any."""
    length_m = 0.0
    for after in range(number + 1, len(route.edges)):
        before = route.edges[max(0, after - 4) : after]
        turn = turn_angle(before, route.edges[after])
        if before[-1].turns_back(route.edges[after]):
            turn = math.pi if before[-1].edge.driving_side == "right" else -math.pi
        if abs(turn) > TURN_RAD:
            return turn
        length_m += route.edges[after].edge.length_m
        if length_m > PREPARE_TURN_M:
            break
    return 0.0


def _resampled(route: Route, xy: Array, place: Array, begin: float, end: float) -> PathGeometry:
    arc = arc_lengths(xy)
    low, high = np.interp([begin, end], place, arc)
    even = np.linspace(low, high, max(2, round((high - low) / SPACING_M) + 1))
    points = interpolated(even, arc, xy)
    s = np.interp(even, arc, place)
    edge = np.clip(np.searchsorted(route.start_m, s, side="right") - 1, 0, len(route.edges) - 1)
    return PathGeometry(points, route.speed_limit_mps[edge], s)
