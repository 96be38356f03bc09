"""`foretwin repeat`: a future of a run or sweep again, from its recorded job: the same bits?"""

from __future__ import annotations

import json
from pathlib import Path

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.contracts.terminal import say
from foretwin.orchestrator.record.recorded_jobs import RecordedFuture, recorded_future
from foretwin.orchestrator.record.run_folder import REPEATED
from foretwin.sim_worker.futures.future_rows import future_rows
from foretwin.sim_worker.futures.run_job import run_alone
from foretwin.sim_worker.planners.registry import in_another_process

DIFFERS = 3
_STANDS_IN = "constant_speed"


def repeat(folder: Path, future_id: str, *, as_json: bool, view: bool) -> int:
    """Play a recorded future again and print whether it came to the same; returns 0, or 3 where
    it did not.

    Its whole job is played, as it was then. Raises FileNotFoundError or UserError, in one line,
    where it cannot be repeated.
    """
    recorded = recorded_future(folder, future_id)
    pictures = folder / REPEATED
    if view and (trouble := trouble_with_folder(pictures)) is not None:
        raise UserError(f"--view {pictures}: {trouble}")
    before = recorded.row.trajectory_sha256
    if before is None:
        reason = recorded.row.failure or recorded.row.left_out or "its row does not say why"
        raise UserError(f"{future_id}: was not played: {reason}")
    result, after = play_again(recorded)
    if as_json:
        hashes = {"recorded_sha256": before, "sha256": after}
        say(json.dumps({"future": future_id, **hashes, "equal": before == after}))
    elif before == after:
        say(f"{future_id}: the same again, sha256 {after}")
    else:
        say(f"{future_id}: differs: recorded sha256 {before}, now {after}")
    if view and after is not None:
        from foretwin.sim_worker.futures.future_picture import write_future_picture

        picture = pictures / f"{future_id}.png"
        index = result.future_indices.index(recorded.row.index)
        write_future_picture(picture, recorded.job, result, index, recorded.world, recorded.vehicle)
        say(picture)
    return 0 if before == after else DIFFERS


def play_again(recorded: RecordedFuture) -> tuple[FuturesResult, str | None]:
    """Return what the job of a future comes to now, and the hash of the future's trajectory, None
    where it is not played now.

    Raises UserError where the future was driven by a planner in another process.
    """
    known = recorded.row
    if in_another_process(known.planner):
        raise UserError(
            f"{known.future_id}: driven by {known.planner!r} in another process, whose answers are "
            "not recorded"
        )
    job = _without_others(recorded.job)
    result = run_alone(job, recorded.world, recorded.vehicle)
    rows = future_rows(job, result, job_sha256=known.job_sha256)
    row = next(row for row in rows if row["index"] == known.index)
    return result, row.get("trajectory_sha256")


def _without_others(job: Job) -> Job:
    """Let futures that other processes drove be driven by foretwin: to the rest it is the same."""
    futures = tuple(
        msgspec.structs.replace(future, planner=_STANDS_IN)
        if in_another_process(future.planner)
        else future
        for future in job.futures
    )
    return msgspec.structs.replace(job, futures=futures)
