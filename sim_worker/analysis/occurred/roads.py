"""The roads of a drive's Worlds in one frame: which way lanes lead, and where junctions are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.frames import (
    LocalFrame,
    geo_from_local,
    local_from_geo,
    wrap_angle,
)
from foretwin.contracts.world import Connection, IntersectionSummary, Lane, Road, World
from foretwin.geometry.polyline import densified, headings_rad

_EVERY_M = 2.0
_NEAREST, _REACH_M, _ALIKE_RAD = 8, 8.0, np.radians(40.0)
_RAD_AS_M = 6.0
_ROUND_M = 12.0
"""Of a junction whose ground is not known."""


class JunctionPlace(NamedTuple):
    """A junction in the drive's frame; `outline_m` (M, 2) of its ground."""

    summary: IntersectionSummary
    outline_m: Array


class LanePiece(NamedTuple):
    """A lane, or a way through a junction, and the road that it belongs to."""

    way: Lane | Connection
    road_class: str
    lanes: int
    """That vehicles drive on, of the road in both directions; 0 where that is not known."""
    in_junction: bool


class Roads:
    """Lanes of several Worlds by place; empty where there is no World."""

    def __init__(self, worlds: Iterable[World], frame: LocalFrame) -> None:
        self.pieces: list[LanePiece] = []
        self.junctions: dict[str, JunctionPlace] = {}
        self.driving_side = "right"
        points, headings, owner = [np.zeros((0, 2))], [np.zeros(0)], [np.zeros(0, dtype=np.intp)]
        for world in worlds:
            self.driving_side = world.intersection.driving_side
            roads = {road.id: road for road in world.roads}
            lanes = {lane.id: lane for lane in world.lanes}
            known: list[Lane | Connection] = [*world.lanes, *world.connections]
            for way in known:
                if len(way.centerline) < 2:
                    continue
                lane = way if isinstance(way, Lane) else lanes.get(way.from_lane_id)
                road = roads.get(lane.road_id) if lane is not None else None
                line = densified(way.centerline, spacing_m=_EVERY_M)
                moved = in_frame(line, world.frame, frame)
                points.append(moved)
                headings.append(headings_rad(moved))
                owner.append(np.full(len(moved), len(self.pieces), dtype=np.intp))
                inside = isinstance(way, Connection) and bool(way.junction_id)
                self.pieces.append(
                    LanePiece(
                        way,
                        "" if road is None else road.road_class,
                        0 if road is None else _driven(road, lanes),
                        inside,
                    )
                )
            for junction in world.junctions:
                place = _place(junction.area, junction.summary, world.frame, frame)
                self.junctions.setdefault(junction.summary.id, place)
        self._xy = np.concatenate(points)
        self._yaw = np.concatenate(headings)
        self._owner = np.concatenate(owner)
        self._tree = cKDTree(self._xy) if len(self._xy) else None

    def piece_at(self, xy_m: Array, yaw_rad: Array) -> Indices:
        """Return which of `pieces` are driven at points (K, 2) with headings (K,), -1 for none."""
        return np.where((row := self._nearest(xy_m, yaw_rad)) < 0, -1, self._owner_of(row))

    def heading_at(self, xy_m: Array, yaw_rad: Array) -> Array:
        """Return which way lanes lead (K,) at points (K, 2), of those that lead about as one heads.

        NaN where there is none. Lanes side by side lead the same way: which one it is, and by how
        much positions are beside the truth, does not matter.
        """
        row = self._nearest(xy_m, yaw_rad)
        known = self._yaw[np.maximum(row, 0)] if len(self._yaw) else np.zeros(len(row))
        return np.where(row < 0, np.nan, known)

    def neighbour(self, piece: int, side: str) -> bool:
        """Whether a lane of `pieces` has another beside it that is driven the same way."""
        way = self.pieces[piece].way if piece >= 0 else None
        if not isinstance(way, Lane):
            return False
        return (way.left_id if side == "left" else way.right_id) is not None

    def _owner_of(self, row: Indices) -> Indices:
        return self._owner[np.maximum(row, 0)] if len(self._owner) else np.full(len(row), -1)

    def _nearest(self, xy_m: Array, yaw_rad: Array) -> Indices:
        found = np.full(len(xy_m), -1, dtype=np.intp)
        known = np.flatnonzero(np.isfinite(xy_m).all(axis=1) & np.isfinite(yaw_rad))
        if self._tree is None or not len(known):
            return found
        most = min(_NEAREST, len(self._xy))
        away, near = self._tree.query(xy_m[known], k=np.arange(1, most + 1))
        turned = np.abs(wrap_angle(self._yaw[near] - yaw_rad[known, None]))
        fits = (away <= _REACH_M) & (turned <= _ALIKE_RAD)
        best = np.where(fits, away + _RAD_AS_M * turned, np.inf).argmin(axis=1)
        row = np.arange(len(known))
        found[known] = np.where(fits[row, best], near[row, best], -1)
        return found


def in_frame(xy_m: Array, given: LocalFrame, wanted: LocalFrame) -> Array:
    """Return points (N, 2) of one frame in another."""
    geo = geo_from_local(given, np.asarray(xy_m))
    return np.asarray(local_from_geo(wanted, geo[:, 0], geo[:, 1]))


def _driven(road: Road, lanes: Mapping[str, Lane]) -> int:
    kinds = (lanes[lane_id].kind for lane_id in road.lane_ids if lane_id in lanes)
    return sum(kind in ("driving", "bus") for kind in kinds)


def _place(
    area: object, summary: IntersectionSummary, given: LocalFrame, wanted: LocalFrame
) -> JunctionPlace:
    outline = getattr(area, "outline", None)
    if outline is not None:
        return JunctionPlace(summary, in_frame(outline, given, wanted))
    centre = np.asarray(local_from_geo(wanted, summary.lat, summary.lon)).reshape(2)
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = centre + _ROUND_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return JunctionPlace(summary, ring)
