"""What occurred in a run, for reports: one call, frozen rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from foretwin.orchestrator.occurred.drive_read import DriveRead, read_run
from foretwin.orchestrator.occurred.model_validity import ModelGap, model_gaps
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.recorded_messages import CarRecorded
from foretwin.orchestrator.record.run_state import RESULTS
from foretwin.sim_worker.analysis.occurred.odd import (
    DrivenSpan,
    OddExposure,
    driven_in,
    odd_of,
)
from foretwin.sim_worker.analysis.occurred.recognise import recognise
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from foretwin.sim_worker.analysis.occurred.scene import courses_of
from foretwin.sim_worker.analysis.occurred.triggering import (
    TriggeringCondition,
    triggering_conditions,
)


class Occurred(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that was recognised in one drive, by when it began."""

    scenarios: tuple[OccurredScenario, ...]
    sees_others: bool
    """Whether the car told of road users at all: else nothing is known of any."""
    odd: tuple[OddExposure, ...] = ()
    triggering: tuple[TriggeringCondition, ...] = ()
    model: tuple[ModelGap, ...] = ()
    """Of each scenario's time, in the order of `scenarios`: how far the model was from the car."""
    by_software: DrivenSpan | None = None
    """How much of the drive the driving software drove; None where nobody says that it did."""
    notes: tuple[str, ...] = ()
    """What could not be looked at, in words."""


def occurred_in(run: Path | str, *, recorded: CarRecorded | None = None) -> Occurred:
    """Return what occurred in a run's drive; `recorded` where that was read before.

    Raises FileNotFoundError for a folder that is none of a run, UserError for a run that goes on
    or holds no motion.
    """
    run = Path(run)
    gaps, segments = (kept_rows(run / RESULTS, name) for name in ("gaps", "driven_segments"))
    return occurred_of(read_run(run, recorded), gaps=gaps, segments=segments)


def occurred_of(
    drive: DriveRead, *, gaps: list[dict[str, Any]], segments: Sequence[dict[str, Any]] = ()
) -> Occurred:
    """Return what occurred in a drive that was read; `gaps` and `segments` (who drove when) are
    rows of the run's tables."""
    by_software = [
        (one["from_stamp_ns"], one["to_stamp_ns"])
        for one in segments
        if one["control_mode"] == "autonomous"
    ]
    sees_others = bool(len(drive.told_ns))
    roads = Roads(drive.worlds, drive.frame)
    found = recognise(drive.ego, drive.detected, roads, vehicle=drive.vehicle)
    notes = []
    if not sees_others:
        notes.append("the car told of no road users: only its own manoeuvres are known")
    if not drive.worlds:
        notes.append("the run holds no Worlds: junctions and lanes are not known")
    return Occurred(
        scenarios=found,
        sees_others=sees_others,
        odd=odd_of(
            drive.ego,
            courses_of(drive.detected, drive.ego),
            roads,
            found,
            where=drive.states[0].position,
            utc=drive.info.time_base == "utc",
            sees_others=sees_others,
        ),
        triggering=triggering_conditions(drive.states, drive.ego, drive.told_ns),
        model=model_gaps(found, gaps),
        by_software=driven_in(drive.ego, by_software) if by_software else None,
        notes=tuple(notes),
    )
