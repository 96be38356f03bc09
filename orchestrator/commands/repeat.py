"""`foretwin repeat`: a future of a run or sweep again, from its recorded job: the same bits?"""

from __future__ import annotations

import json
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.new_folder import trouble_with_folder
from foretwin.contracts.terminal import say
from foretwin.orchestrator.record.played_again import play_again
from foretwin.orchestrator.record.recorded_jobs import recorded_future
from foretwin.orchestrator.record.run_folder import REPEATED

DIFFERS = 3


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
    result, hashes = play_again(recorded)
    after = hashes[recorded.row.index]
    if as_json:
        both = {"recorded_sha256": before, "sha256": after}
        say(json.dumps({"future": future_id, **both, "equal": before == after}))
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
