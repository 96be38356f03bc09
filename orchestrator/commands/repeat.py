"""`foretwin repeat`: a future of a run or sweep again, from its recorded job: the same bits?"""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import msgspec
import numpy as np

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import EngineName
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.played_again import play_again
from foretwin.orchestrator.record.recorded_jobs import recorded_future, recorded_sibling
from foretwin.orchestrator.record.run_folder import REPEATED
from foretwin.sim_worker.engines.registry import trouble_with_engine
from foretwin.sim_worker.futures.future_rows import motion_sha256

DIFFERS = 3


def elsewhere(folder: Path, future_id: str, physics: str) -> CommandResult:
    """Play a recorded future as it was and on another engine: how far apart are they?

    Its code is 0, or 3 where it was played on that engine in the drive, too, and came to something
    else there. Raises FileNotFoundError or UserError, in one line, where it cannot be played.
    """
    if physics not in (known := get_args(EngineName)):
        raise UserError(f"--physics {physics}: {', '.join(known)}")
    engine = msgspec.convert(physics, EngineName)
    if (trouble := trouble_with_engine(engine)) is not None:
        raise UserError(f"--physics {physics}: {trouble}")
    recorded = recorded_future(folder, future_id)
    here, there = play_again(recorded).result, play_again(recorded, engine=engine).result
    if recorded.row.index not in here.future_indices:
        raise UserError(f"{future_id}: was not played")
    row = here.future_indices.index(recorded.row.index)
    ways = [result.trajectory.states[row, :, :2] for result in (here, there)]
    apart_m = np.hypot(*(ways[0] - ways[1]).T)
    told = recorded_sibling(folder, future_id, engine)
    now = motion_sha256(there, row)
    collided = [bool(result.outcome.collided[row]) for result in (here, there)]
    body = {
        "future": future_id,
        "engines": [recorded.job.engine, engine],
        "apart": {"end_m": float(apart_m[-1]), "most_m": float(apart_m.max())},
        "collided": collided,
        "sibling_sha256": told,
        "sha256": now,
    }
    said = ["collides" if one else "does not collide" for one in collided]
    words = (
        f"{future_id}: {recorded.job.engine} and {engine} end {apart_m[-1]:.2f} m apart, at most "
        f"{apart_m.max():.2f} m; on {recorded.job.engine} it {said[0]}, "
        f"on {engine} it {said[1]}"
    )
    if told is not None:
        sibling = "the same again" if told == now else f"differs: {told}"
        words += f"\nits sibling of the drive: {sibling}"
    return CommandResult(body, words, 0 if told in (None, now) else DIFFERS)


def repeat(folder: Path, future_id: str, *, view: bool) -> CommandResult:
    """Play a recorded future again: did it come to the same? Its code is 0, or 3 where it did not.

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
    result, hashes = play_again(recorded)
    after = hashes[recorded.row.index]
    equal = before == after
    found = {"future": future_id, "recorded_sha256": before, "sha256": after, "equal": equal}
    words = f"{future_id}: differs: recorded sha256 {before}, now {after}"
    if equal:
        words = f"{future_id}: the same again, sha256 {after}"
    if view and after is not None:
        from foretwin.sim_worker.futures.future_picture import write_future_picture

        picture = pictures / f"{future_id}.png"
        index = result.future_indices.index(recorded.row.index)
        write_future_picture(picture, recorded.job, result, index, recorded.world, recorded.vehicle)
        found["picture"] = str(picture)
        words += f"\n{picture}"
    return CommandResult(found, words, 0 if equal else DIFFERS)
