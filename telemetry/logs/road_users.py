"""Other road users of a log: the course of each one, whatever the log looks like.

What a log does not say of somebody's heading and speed is taken from how the positions go on, both
ways in time: such courses are for offline use.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind, RoadUsers
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local_yaw,
    local_from_geo,
    wrap_angle,
)
from foretwin.telemetry.estimator.position_gate import MAX_SPEED_MPS
from foretwin.telemetry.logs.log import TIME_DOUBLED, VALUE_NOT_FINITE, fault_of_position

LONGEST_GAP_S = 1.0
"""Who is not seen for longer is taken to be away until seen again."""
_NOISE_M = 0.5
"""Of positions: two samples may follow each other at once."""
SEEN_ONCE = "seen once"
_HALF_WINDOW_S = 0.25
_MOVING_MPS = 0.5

Stamps = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class Detection(NamedTuple):
    """One road user at one instant: its box centre, yaw from true east; NaN where not recorded.

    `axis_rad` is the direction of its box where it is not said which end is the front.
    """

    user_id: str
    kind: RoadUserKind
    lat_deg: float
    lon_deg: float
    yaw_rad: float = np.nan
    axis_rad: float = np.nan
    speed_mps: float = np.nan
    length_m: float = np.nan
    width_m: float = np.nan


@dataclass(frozen=True, kw_only=True)
class RoadUserTrack:
    """One road user's samples (N,) in the order of their stamps; yaw from true east.

    After a sample of `gone_after` it is away until the next. `size_m`, length and width, is the
    median of what was recorded, None where nothing was.
    """

    user_id: str
    kind: RoadUserKind
    size_m: tuple[float, float] | None
    stamps_ns: Stamps
    lat_deg: Array
    lon_deg: Array
    yaw_rad: Array
    speed_mps: Array
    gone_after: Flags


@dataclass(frozen=True, kw_only=True)
class RoadUserLog:
    """The road users of one log, by the order in which they appear.

    `stamps_ns` (M,) are the instants at which it says who is there; `skipped` counts samples that
    are of no use by reason.
    """

    stamps_ns: Stamps
    tracks: tuple[RoadUserTrack, ...]
    skipped: Counter[str] = field(default_factory=Counter)


def log_of_detections(
    instants: Iterable[tuple[int, Sequence[Detection]]],
    *,
    longest_gap_s: float = LONGEST_GAP_S,
) -> RoadUserLog:
    """Return the courses of everybody in (stamp, detections), in whatever order these come."""
    skipped: Counter[str] = Counter()
    seen: dict[str, list[tuple[int, Detection]]] = {}
    stamps = set()
    for stamp_ns, detections in sorted(instants, key=lambda instant: instant[0]):
        stamps.add(stamp_ns)
        for one in detections:
            fault = fault_of_position(one.lat_deg, one.lon_deg)
            if fault is None and np.isinf(one[4:]).any():
                fault = VALUE_NOT_FINITE
            mine = seen.setdefault(one.user_id, [])
            if fault is None and mine and mine[-1][0] == stamp_ns:
                fault = TIME_DOUBLED
            if fault is None:
                mine.append((stamp_ns, one))
            else:
                skipped[fault] += 1
    found = (_track(mine, longest_gap_s, skipped) for mine in seen.values())
    return RoadUserLog(
        stamps_ns=np.array(sorted(stamps), dtype=np.int64),
        tracks=tuple(track for track in found if track is not None),
        skipped=skipped,
    )


def detections_of(message: RoadUsers) -> tuple[int, list[Detection]]:
    """Return what a car said of those who are really around it: virtual ones count for nothing."""
    return message.stamp_ns, [
        Detection(
            user.user_id,
            user.kind,
            user.position.lat_deg,
            user.position.lon_deg,
            yaw_rad=user.yaw_rad,
            speed_mps=user.speed_mps,
            length_m=user.length_m,
            width_m=user.width_m,
        )
        for user in message.users
        if not user.virtual
    ]


def _track(
    samples: list[tuple[int, Detection]], longest_gap_s: float, skipped: Counter[str]
) -> RoadUserTrack | None:
    """Return one road user's course, None where nothing is left of it."""
    stamps = np.array([stamp for stamp, _ in samples], dtype=np.int64)
    columns = np.array([one[2:] for _, one in samples], dtype=np.float64).reshape(-1, 7)
    if not len(stamps):
        return None
    frame = LocalFrame(GeoPoint(columns[0, 0], columns[0, 1]))
    xy = np.asarray(local_from_geo(frame, columns[:, 0], columns[:, 1]))
    time_s = (stamps - stamps[0]) * 1e-9
    breaks = _breaks(time_s, xy, longest_gap_s)
    # Who is there for an instant alone is never met.
    kept = ~(breaks[:-1] & breaks[1:])
    skipped[SEEN_ONCE] += int((~kept).sum())
    if not kept.any():
        return None
    stamps, columns, xy, time_s = stamps[kept], columns[kept], xy[kept], time_s[kept]
    gone_after = breaks[1:][kept]
    lat, lon, yaw, axis, speed, length, width = columns.T
    velocity = np.concatenate(
        [
            _velocity(time_s[piece], xy[piece])
            for piece in np.split(np.arange(len(stamps)), np.flatnonzero(gone_after)[:-1] + 1)
        ]
    )
    moved_mps = np.hypot(velocity[:, 0], velocity[:, 1])
    course = _course(velocity, moved_mps)
    if course is not None:
        course = np.asarray(geo_from_local_yaw(frame, course, xy))
        ahead = np.cos(axis - course) >= 0.0
        axis = np.where(np.isnan(axis), course, np.where(ahead, axis, axis + np.pi))
    yaw = np.where(np.isnan(yaw), np.nan_to_num(axis), yaw)
    return RoadUserTrack(
        user_id=samples[0][1].user_id,
        kind=Counter(one.kind for _, one in samples).most_common(1)[0][0],
        size_m=_size_m(length, width),
        stamps_ns=stamps,
        lat_deg=lat,
        lon_deg=lon,
        yaw_rad=wrap_angle(yaw),
        speed_mps=np.where(np.isnan(speed), moved_mps, speed),
        gone_after=gone_after,
    )


def _breaks(time_s: Array, xy: Array, longest_gap_s: float) -> Flags:
    """Return (N + 1,) before which samples, and after the last, a course does not go on."""
    steps_s, steps_m = np.diff(time_s), np.hypot(*np.diff(xy, axis=0).T)
    within = (steps_s > longest_gap_s) | (steps_m > MAX_SPEED_MPS * steps_s + _NOISE_M)
    return np.concatenate([[True], within, [True]])


def _velocity(time_s: Array, xy: Array) -> Array:
    """Return (N, 2) velocities of two positions or more, over half a second where there are any."""
    place = np.arange(len(time_s))
    first = np.searchsorted(time_s, time_s - _HALF_WINDOW_S)
    last = np.searchsorted(time_s, time_s + _HALF_WINDOW_S, side="right") - 1
    first = np.minimum(first, np.maximum(place - 1, 0))
    last = np.maximum(last, np.minimum(place + 1, len(time_s) - 1))
    return np.asarray((xy[last] - xy[first]) / (time_s[last] - time_s[first])[:, None])


def _course(velocity: Array, moved_mps: Array) -> Array | None:
    """Return (N,) directions of motion, held over stops; None for one that never moves."""
    moving = moved_mps > _MOVING_MPS
    if not moving.any():
        return None
    course = np.arctan2(velocity[moving, 1], velocity[moving, 0])
    return np.asarray(course[np.maximum(np.cumsum(moving) - 1, 0)])


def _size_m(length_m: Array, width_m: Array) -> tuple[float, float] | None:
    known = (length_m > 0.0) & (width_m > 0.0)
    if not known.any():
        return None
    return float(np.median(length_m[known])), float(np.median(width_m[known]))
