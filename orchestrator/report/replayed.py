"""Futures of a run's round played again, so that they can be drawn: tables keep only their hashes.

What is drawn is what was foreseen then: a future that comes to another hash is left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.played_again import Prepared, play_again, prepared_for
from foretwin.orchestrator.record.recorded_jobs import recorded_future

_POINT_EVERY_S = 0.5


class SeenFuture(NamedTuple):
    """A future as it was simulated: its row, and its way (M, 2) in its World's frame.

    `met_xy_m` (M, 2) is the way of the road user that came nearest, `touch_m` (2,) where they
    touched; None where nobody was there.
    """

    row: Mapping[str, Any]
    xy_m: Array
    met_xy_m: Array | None
    touch_m: Array | None


class ReplayedRound(NamedTuple):
    """The futures of a round that came to their recorded hashes, and why others are missing."""

    futures: tuple[SeenFuture, ...]
    missing: str
    vehicle: VehicleParameters | None


def replayed(folder: Path, rows: Sequence[Mapping[str, Any]]) -> ReplayedRound:
    """Play the jobs of futures again, each once; `rows` are rows of the table of futures."""
    seen: list[SeenFuture] = []
    missing, vehicle = "", None
    ground: Prepared | None = None
    wanted = [row for row in rows if row["valid"] and row["trajectory_sha256"]]
    differ = 0
    for job_sha256 in dict.fromkeys(row["job_sha256"] for row in wanted):
        mine = [row for row in wanted if row["job_sha256"] == job_sha256]
        try:
            recorded = recorded_future(folder, mine[0]["future_id"])
            ground = ground or prepared_for(recorded)
            result, hashes = play_again(recorded, on=ground)
        except (UserError, OSError, SchemaMismatch, ValueError) as error:
            missing = " ".join(str(error).split())
            continue
        vehicle = recorded.vehicle
        time_s = result.trajectory.time_s
        every = max(1, round(_POINT_EVERY_S / float(time_s[1] - time_s[0])))
        for row in mine:
            if hashes.get(row["index"]) != row["trajectory_sha256"]:
                differ += 1
                continue
            place = result.future_indices.index(row["index"])
            states = result.trajectory.states[place].astype(np.float64)
            poses = result.road_users.poses[place].astype(np.float64)
            met, touch = _met(states, poses, time_s, row)
            seen.append(
                SeenFuture(row, states[::every, :2], None if met is None else met[::every], touch)
            )
    if ground is not None:
        ground.stage.close()
    if differ and not missing:
        missing = f"{differ} of them come to another hash here and are not drawn"
    return ReplayedRound(tuple(seen), missing, vehicle)


def _met(
    states: Array, poses: Array, time_s: Array, row: Mapping[str, Any]
) -> tuple[Array | None, Array | None]:
    """Return the way (N, 2) of who came nearest, and where both touched."""
    there = np.flatnonzero(np.isfinite(poses[0, :, 0]))
    if not len(there):
        return None, None
    away_m = np.hypot(*np.moveaxis(poses[:, there, :2] - states[:, None, :2], -1, 0))
    nearest = there[int(np.nanmin(away_m, axis=0).argmin())]
    way = poses[:, nearest, :2]
    if row["collided"] and row["collision_with"] == "road_user":
        instant = min(int(np.searchsorted(time_s, row["collision_time_s"])), len(states) - 1)
        return way, (way[instant] + states[instant, :2]) / 2.0
    return way, None
