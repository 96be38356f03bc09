"""The commands of `foretwin tracks`: what the user's own passes are, and where they stay."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.contracts.tracks import DrivenTrack, track_id
from foretwin.geometry.polyline import length
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.track_store import TrackStore, store_folder

_STEP_M = 1.0
_LEAST_M = 50.0
_ROUGH_M = 3.0
"""Positions rougher than this tell no lane from the next: a lane's width (RASt 06: 3.00 m)."""


def list_tracks(*, store: str | None) -> CommandResult:
    """Return what the store holds: id, metres, when it was added, from what."""
    found = TrackStore(store_folder(store))
    tracks = [found.load(name) for name in found.ids()]
    rows = [
        {
            "id": track.id,
            "length_m": round(_length_m(track), 1),
            "added_utc": track.added_utc,
            "name": track.name,
        }
        for track in tracks
    ]
    lines = [f"{r['id']}  {r['length_m']:8.0f} m  {r['added_utc']}  {r['name']}" for r in rows]
    lines.append(f"{found.folder}: {len(tracks)} tracks")
    return CommandResult({"store": found.folder, "tracks": rows}, "\n".join(lines))


def add_track(
    log: Path,
    *,
    store: str | None,
    name: str | None = None,
    std_m: float | None = None,
    declaration: Path | None = None,
) -> CommandResult:
    """Put where a recorded drive went into the store."""
    track = track_of_log(log, name=name or log.name, std_m=std_m, declaration=declaration)
    kept = TrackStore(store_folder(store))
    new = kept.add(track)
    length_m = _length_m(track)
    said = f"{length_m:.0f} m of {log}" if new else f"{log} is there already"
    body = {"store": kept.folder, "id": track.id, "length_m": round(length_m, 1), "new": new}
    return CommandResult(body, f"{kept.folder}: track {track.id}, {said}")


def delete_tracks(names: list[str], *, everything: bool, store: str | None) -> CommandResult:
    """Remove tracks by id, or all."""
    if bool(names) == everything:
        raise UserError("tracks delete: name tracks by id, or give --all")
    found = TrackStore(store_folder(store))
    doomed = found.ids() if everything else names
    for track in doomed:
        found.delete(track)
    left = len(found.ids())
    return CommandResult(
        {"store": found.folder, "deleted": doomed, "left": left},
        f"{found.folder}: {len(doomed)} tracks deleted, {left} left",
    )


def track_of_log(
    log: Path, *, name: str, std_m: float | None = None, declaration: Path | None = None
) -> DrivenTrack:
    """Return where a recorded drive went, as the estimator saw it without the help of a map.

    `std_m` is how well its places are known where the log does not say. Raises UserError where it
    went nowhere, or its positions are too rough to tell lanes.
    """
    from foretwin.telemetry.estimator.estimator import StateEstimator
    from foretwin.telemetry.logs.opening import open_log

    opened = open_log(log, declaration=declaration)
    estimator = StateEstimator(opened.info)
    kept: list[VehicleState] = []
    frame, last = None, None
    for channel, message in opened.samples():
        state = estimator.handle(channel, message)
        if state is None or not state.yaw_valid:
            continue
        position = state.position
        frame = frame or LocalFrame(GeoPoint(position.lat_deg, position.lon_deg))
        here = local_from_geo(frame, position.lat_deg, position.lon_deg)
        if last is None or np.hypot(*(here - last)) >= _STEP_M:
            kept.append(state)
            last = here
    if len(kept) < _LEAST_M / _STEP_M:
        raise UserError(f"{log}: drives less than {_LEAST_M:g} m with a known heading; no track")
    told = [s.position_std_m for s in kept if s.position_std_m is not None]
    rough_m = float(np.median(told)) if told and std_m is None else std_m or 0.0
    if not 0.0 <= rough_m <= _ROUGH_M:
        raise UserError(
            f"{log}: positions are known to {rough_m:.1f} m alone; "
            f"{_ROUGH_M:g} m or better tell one lane from the next"
        )
    lat_deg = np.array([s.position.lat_deg for s in kept])
    lon_deg = np.array([s.position.lon_deg for s in kept])
    stamp_ns = np.array([s.stamp_ns for s in kept], dtype=np.int64)
    return DrivenTrack(
        id=track_id(lat_deg, lon_deg, stamp_ns),
        name=name,
        added_utc=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        stamp_ns=stamp_ns,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        speed_mps=np.array([s.speed_mps for s in kept]),
        position_std_m=round(rough_m, 3),
    )


def _length_m(track: DrivenTrack) -> float:
    frame = LocalFrame(GeoPoint(float(track.lat_deg[0]), float(track.lon_deg[0])))
    return length(local_from_geo(frame, track.lat_deg, track.lon_deg))
