"""What occurred in a run, for reports: one call, frozen rows."""

from __future__ import annotations

from pathlib import Path

import msgspec

from foretwin.orchestrator.occurred.drive_read import DriveRead, read_run
from foretwin.sim_worker.analysis.occurred.recognise import recognise
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario


class Occurred(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that was recognised in one drive, by when it began."""

    scenarios: tuple[OccurredScenario, ...]
    sees_others: bool
    """Whether the car told of road users at all: else nothing is known of any."""
    notes: tuple[str, ...] = ()
    """What could not be looked at, in words."""


def occurred_in(run: Path) -> Occurred:
    """Return what occurred in a run's drive.

    Raises FileNotFoundError for a folder that is none of a run, UserError for a run that goes on
    or holds no motion. Some seconds for each minute of a drive: its sensors are estimated again.
    """
    return occurred_of(read_run(run))


def occurred_of(drive: DriveRead) -> Occurred:
    """Return what occurred in a drive that was read."""
    found = recognise(
        drive.ego, drive.detected, drive.worlds, frame=drive.frame, vehicle=drive.vehicle
    )
    notes = []
    if not drive.sees_others:
        notes.append("the car told of no road users: only its own manoeuvres are known")
    if not drive.worlds:
        notes.append("the run holds no Worlds: junctions and lanes are not known")
    return Occurred(scenarios=found, sees_others=drive.sees_others, notes=tuple(notes))
