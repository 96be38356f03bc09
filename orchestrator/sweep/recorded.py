"""Starts of a sweep from where a real car was, and who was around it: a recorded run."""

from __future__ import annotations

import bisect
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pyarrow as pa

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUsers, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.placement import RecordedStart
from foretwin.contracts.segments import DRIVE_FILE, first_left
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.polyline import kept_apart, length
from foretwin.orchestrator.record.run_state import check_finished
from foretwin.orchestrator.record.table_parts import parts_of_table, read_parts
from foretwin.orchestrator.sweep.road_users import RoadUserMode, among, named_log
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.road_users import (
    LONGEST_GAP_S,
    RoadUserLog,
    detections_of,
    log_of_detections,
)

WORLDS = "worlds"
_ROUNDS = Path("results/rounds.parquet")
_BEFORE_S, _AHEAD_S = 4.0, 30.0
"""The path is what the car drove from so long before a start to so long after it."""
_STEP_M, _LEAST_M = 1.0, 20.0


class Recorded(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Start where a real car was: the folder of a run of `foretwin drive`, and how often."""

    run: str
    """Folder of a run of `foretwin drive`."""
    every_s: float = 2.0
    """A start every so many seconds of it."""
    road_users: RoadUserMode = "replayed"
    """Whether others are where they were recorded, go on as a live round predicts, or are not."""
    road_user_log: str | None = None
    """Of others, in place of what the car itself detected, by the same clock."""
    leave_out: tuple[str, ...] = ()
    """Ids of road users who are not to be there: the car itself, in a log of somebody else's."""
    longest_gap_s: float = LONGEST_GAP_S
    """Who is not seen for longer is away until seen again."""


class RecordedStarts(NamedTuple):
    """Where a sweep starts, and who was around then; None where nobody is to be."""

    starts: tuple[RecordedStart, ...]
    road_users: RoadUserLog | None


def read_drive(recorded: Recorded, vehicle: VehicleParameters) -> RecordedStarts:
    """Return starts from a run's folder, one round of every `every_s` seconds, and road users.

    Rounds after which the car hardly moved on are left out. Raises FileNotFoundError for a folder
    that is none of a run, and UserError where nothing can be started from, or a log of road users
    does not go with the drive.
    """
    run = Path(recorded.run)
    check_finished(run)
    drive = first_left(run / DRIVE_FILE)
    rounds = parts_of_table(run / _ROUNDS) or [run / _ROUNDS]
    for part in (rounds[0], drive, run / WORLDS):
        if not part.exists():
            raise FileNotFoundError(f"recorded.run {run}: no {part.relative_to(run)} in it")
    states, said = _states(drive, vehicle, longest_gap_s=recorded.longest_gap_s)
    starts = _starts(run, states, every_s=recorded.every_s)
    if recorded.road_users == "none":
        return RecordedStarts(starts, None)
    if recorded.road_user_log is not None:
        path = Path(recorded.road_user_log)
        said = named_log(path, states, vehicle, recorded.leave_out, recorded.longest_gap_s)
    else:
        said = among(said, recorded.leave_out, "the car's detections")
    return RecordedStarts(starts, said if said.tracks else None)


def _starts(run: Path, states: list[VehicleState], *, every_s: float) -> tuple[RecordedStart, ...]:
    stamps = [state.stamp_ns for state in states]
    starts: list[RecordedStart] = []
    next_s = -np.inf
    for row in _rounds(run / _ROUNDS):
        place = bisect.bisect_right(stamps, row["stamp_ns"]) - 1
        if row["drive_time_s"] < next_s or place < 0:
            continue
        line = _line(states, stamps, place)
        if line is None:
            continue
        next_s = row["drive_time_s"] + every_s
        lat_deg, lon_deg = (tuple(column) for column in line.T.tolist())
        same = ("round_id", "drive_time_s", "world_id", "cruise_speed_mps")
        starts.append(
            RecordedStart(
                **{name: row[name] for name in same},
                junction_id=row["intersection_id"],
                state=states[place],
                lat_deg=lat_deg,
                lon_deg=lon_deg,
            )
        )
    if not starts:
        raise UserError(f"recorded.run {run}: no round from which the car drove on")
    return tuple(starts)


def _rounds(file: Path) -> list[dict[str, Any]]:
    try:
        rows: list[dict[str, Any]] = read_parts(file).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise UserError(f"recorded.run: {file} cannot be read: {error}") from error
    return sorted(rows, key=lambda row: (row["stamp_ns"], row["round_id"]))


def _states(
    file: Path, vehicle: VehicleParameters, *, longest_gap_s: float
) -> tuple[list[VehicleState], RoadUserLog]:
    """Return the states that the drive had, estimated from what was recorded as it was then, and
    who was detected."""
    recorded = open_log(file)
    # Its arithmetic is compiled, and a sweep over no drive loads no compiler.
    from foretwin.telemetry.estimator.estimator import estimator_of

    estimator = estimator_of(recorded.info, vehicle)
    states, seen = [], []
    for channel, message in recorded.samples():
        if isinstance(message, RoadUsers):
            seen.append(detections_of(message))
        state = estimator.handle(channel, message)
        if state is not None:
            states.append(state)
    return states, log_of_detections(seen, longest_gap_s=longest_gap_s)


def _line(states: list[VehicleState], stamps: list[int], place: int) -> Array | None:
    """Return (N, 2) degrees along the way driven around a start, None where that is too short."""
    now_ns = stamps[place]
    first = bisect.bisect_left(stamps, now_ns - int(_BEFORE_S * 1e9))
    last = bisect.bisect_right(stamps, now_ns + int(_AHEAD_S * 1e9))
    degrees = np.array(
        [(s.position.lat_deg, s.position.lon_deg) for s in states[first:last]], dtype=np.float64
    )
    here = LocalFrame(states[place].position)
    xy = np.asarray(local_from_geo(here, degrees[:, 0], degrees[:, 1]))
    kept = kept_apart(xy, least_m=_STEP_M)
    onward = xy[[place - first, *kept[kept > place - first]]]
    return degrees[kept] if length(onward) >= _LEAST_M else None
