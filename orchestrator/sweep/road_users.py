"""Who was around a recorded car: the road users of a log, at a start of a sweep and from it on."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    local_from_geo,
    local_from_geo_yaw,
)
from foretwin.contracts.futures import RecordedRoadUser, SeenRoadUser
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.rounds.seen_users import WITHIN_M, near_car
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.telemetry.logs import open_road_users
from foretwin.telemetry.logs.road_users import RoadUserLog, RoadUserTrack

RoadUserMode = Literal["replayed", "predicted", "none"]


class Others(NamedTuple):
    """Those around a recorded car: as they then moved, or as a live round foresees them."""

    replayed: tuple[RecordedRoadUser, ...] = ()
    predicted: tuple[SeenRoadUser, ...] = ()


NO_OTHERS = Others()


def others_at(
    log: RoadUserLog,
    mode: RoadUserMode,
    state: VehicleState,
    frame: LocalFrame,
    *,
    horizon_s: float,
    way_xy_m: Array,
) -> Others:
    """Return who is around a car in a state from which it goes along a way (N, 2)."""
    if mode == "replayed":
        return Others(
            replayed=replayed_from(
                log, state.stamp_ns, horizon_s=horizon_s, frame=frame, way_xy_m=way_xy_m
            )
        )
    if mode == "none":
        return NO_OTHERS
    return Others(predicted=near_car(seen_at(log, state.stamp_ns), state, frame))


def named_log(
    path: Path,
    states: Sequence[VehicleState],
    vehicle: VehicleParameters,
    leave_out: Sequence[str],
    longest_gap_s: float,
) -> RoadUserLog:
    """Return the road users of a log that somebody made beside a drive with these states.

    Raises UserError where their times do not overlap, or where one of them is the car itself.
    """
    found = among(open_road_users(path, longest_gap_s=longest_gap_s), leave_out, str(path))
    log_s, drive_s = (
        tuple(stamp / 1e9 for stamp in span)
        for span in (
            (int(found.stamps_ns[0]), int(found.stamps_ns[-1])),
            (states[0].stamp_ns, states[-1].stamp_ns),
        )
    )
    if log_s[1] < drive_s[0] or log_s[0] > drive_s[1]:
        raise UserError(
            f"recorded.road_user_log {path}: from {log_s[0]:.1f} to {log_s[1]:.1f} s, but the "
            f"drive from {drive_s[0]:.1f} to {drive_s[1]:.1f} s: they need one clock"
        )
    course = _course(states)
    same = [f'"{t.user_id}"' for t in found.tracks if _is_the_car(t, course, vehicle)]
    if same:
        raise UserError(
            f"recorded.road_user_log {path}: the car itself is in it: leave_out = "
            f"[{', '.join(same)}] leaves it out"
        )
    return found


def among(log: RoadUserLog, leave_out: Sequence[str], what: str) -> RoadUserLog:
    """Return a log without some of its road users; UserError for one that is not in it."""
    known = [track.user_id for track in log.tracks]
    for name in leave_out:
        if name not in known:
            raise UserError(
                f"recorded.leave_out {name!r}: no such road user in {what}; there are "
                f"{', '.join(known) or 'none'}"
            )
    kept = tuple(track for track in log.tracks if track.user_id not in leave_out)
    return dataclasses.replace(log, tracks=kept)


class _Course(NamedTuple):
    """Where base_link was: positions (N, 2) and yaws (N,) without jumps, in the drive's frame."""

    frame: LocalFrame
    stamps_ns: npt.NDArray[np.int64]
    xy_m: Array
    yaw_rad: Array


def _course(states: Sequence[VehicleState]) -> _Course:
    frame = LocalFrame(states[0].position)
    lat, lon, yaw = np.array(
        [(s.position.lat_deg, s.position.lon_deg, s.yaw_rad) for s in states], dtype=np.float64
    ).T
    return _Course(
        frame,
        np.array([state.stamp_ns for state in states], dtype=np.int64),
        np.asarray(local_from_geo(frame, lat, lon)),
        np.unwrap(local_from_geo_yaw(frame, yaw, lat, lon)),
    )


def _is_the_car(track: RoadUserTrack, course: _Course, vehicle: VehicleParameters) -> bool:
    """Tell whether somebody overlaps with the car for most of the time, as nobody else can."""
    frame, stamps = course.frame, course.stamps_ns
    inside = (track.stamps_ns >= stamps[0]) & (track.stamps_ns <= stamps[-1])
    if not inside.any():
        return False
    at, since = track.stamps_ns[inside] - stamps[0], stamps - stamps[0]
    x, y, yaw = (np.interp(at, since, v) for v in (*course.xy_m.T, course.yaw_rad))
    xy = np.asarray(local_from_geo(frame, track.lat_deg[inside], track.lon_deg[inside]))
    dx, dy = xy[:, 0] - x, xy[:, 1] - y
    ahead = np.cos(yaw) * dx + np.sin(yaw) * dy - box_centre_from_base_m(vehicle)
    left = np.cos(yaw) * dy - np.sin(yaw) * dx
    length, width = _size_m(track)
    overlaps = np.abs(ahead) < 0.5 * (length + vehicle.length_m.value)
    overlaps &= np.abs(left) < 0.5 * (width + vehicle.width_m.value)
    return bool(overlaps.mean() > 0.5)


def _size_m(track: RoadUserTrack) -> tuple[float, float]:
    traits = KINDS[track.kind]
    return track.size_m or (traits.length_m, traits.width_m)


def seen_at(log: RoadUserLog, stamp_ns: int) -> RoadUsers | None:
    """Return what was last said of everybody at a time, as a car would have said it."""
    last = int(np.searchsorted(log.stamps_ns, stamp_ns, side="right")) - 1
    if last < 0:
        return None
    said_ns = int(log.stamps_ns[last])
    users = []
    for track in log.tracks:
        sample = int(np.searchsorted(track.stamps_ns, said_ns))
        if sample == len(track.stamps_ns) or track.stamps_ns[sample] != said_ns:
            continue
        length, width = _size_m(track)
        users.append(
            RoadUser(
                user_id=track.user_id,
                kind=track.kind,
                position=GeoPoint(float(track.lat_deg[sample]), float(track.lon_deg[sample])),
                yaw_rad=float(track.yaw_rad[sample]),
                speed_mps=float(track.speed_mps[sample]),
                length_m=length,
                width_m=width,
            )
        )
    return RoadUsers(stamp_ns=said_ns, users=tuple(users))


def replayed_from(
    log: RoadUserLog, stamp_ns: int, *, horizon_s: float, frame: LocalFrame, way_xy_m: Array
) -> tuple[RecordedRoadUser, ...]:
    """Return the courses of those who come near a way (N, 2) within a horizon from a time on."""
    until_ns = stamp_ns + round(horizon_s * 1e9)
    found = []
    for track in log.tracks:
        samples = _samples_between(track, stamp_ns, until_ns)
        if samples is None:
            continue
        lat, lon = track.lat_deg[samples], track.lon_deg[samples]
        xy = np.asarray(local_from_geo(frame, lat, lon))
        away = np.hypot(*(xy[:, None] - way_xy_m[None]).transpose(2, 0, 1))
        if away.min() > WITHIN_M:
            continue
        yaw = local_from_geo_yaw(frame, track.yaw_rad[samples], lat, lon)
        # The contract has one array type; flags stay numpy booleans in it.
        gone_after: Any = track.gone_after[samples]
        found.append(
            RecordedRoadUser(
                user_id=track.user_id,
                kind=track.kind,
                size_m=track.size_m,
                time_s=np.asarray((track.stamps_ns[samples] - stamp_ns) * 1e-9, np.float64),
                poses=np.column_stack([xy, yaw]),
                speed_mps=track.speed_mps[samples],
                gone_after=gone_after,
            )
        )
    return tuple(found)


def _samples_between(track: RoadUserTrack, from_ns: int, until_ns: int) -> slice | None:
    """Return the samples that say where a road user is in a span of time, None for nowhere."""
    stamps, gone = track.stamps_ns, track.gone_after
    first = max(int(np.searchsorted(stamps, from_ns, side="right")) - 1, 0)
    if stamps[first] < from_ns and gone[first]:
        first += 1
    last = min(int(np.searchsorted(stamps, until_ns)), len(stamps) - 1)
    if last > first and stamps[last] > until_ns and gone[last - 1]:
        last -= 1
    if first > last or stamps[first] > until_ns:
        return None
    return slice(first, last + 1)


def digest_of(log: RoadUserLog) -> str:
    """Return the SHA-256 of all that a log says of road users."""
    digest = hashlib.sha256(log.stamps_ns.tobytes())
    for track in log.tracks:
        digest.update(repr((track.user_id, track.kind, track.size_m)).encode())
        where = track.stamps_ns, track.lat_deg, track.lon_deg, track.yaw_rad
        for column in (*where, track.speed_mps, track.gone_after):
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()
