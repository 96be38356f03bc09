"""Simulation against reality of a run that was killed before it could judge its windows."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.agreement.known_windows import ThinnedWindows, kept_windows
from foretwin.orchestrator.agreement.verdict_rows import judged_row
from foretwin.orchestrator.agreement.windows import judge_all
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.recorded_jobs import kept_vehicle
from foretwin.orchestrator.record.run_state import RESULTS
from foretwin.sim_worker.analysis.agreement.tally import tally
from foretwin.sim_worker.world_file import load_world


class RecoveredAgreement(NamedTuple):
    """The `agreement` of run.json, and the rows of its table."""

    record: dict[str, Any]
    rows: list[dict[str, Any]]


def recovered_agreement(run: Path) -> RecoveredAgreement | None:
    """Judge the windows in a run's tables as its end would have done.

    None where there are none, or where Worlds, vehicle or rounds that they name are gone.
    """
    known = kept_windows(run / RESULTS)
    rounds = kept_rows(run / RESULTS, "rounds", "stamp_ns", "drive_time_s")
    thinned = ThinnedWindows()
    for window in known.windows:
        thinned.take(window)
    if not (thinned.kept and rounds):
        return None
    worlds = {}
    for world_id in thinned.world_ids:
        with contextlib.suppress(OSError, SchemaMismatch):
            worlds[world_id] = load_world(run / "worlds", world_id)
    start_ns = rounds[0]["stamp_ns"] - round(1e9 * rounds[0]["drive_time_s"])
    try:
        judged = judge_all(thinned.kept, worlds, kept_vehicle(run, known.vehicle))
    except (OSError, SchemaMismatch, UserError):
        return None
    if not judged:
        return None
    rows = [judged_row(one, start_stamp_ns=start_ns) for one in judged]
    return RecoveredAgreement(tally(judged, start_stamp_ns=start_ns), rows)
