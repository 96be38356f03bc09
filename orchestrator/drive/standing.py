"""What of a live drive an orchestrator hands to the one after it, should it die.

What a table holds is read from there.
"""

from __future__ import annotations

import logging
import pickle
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.roles import Correction, Role
from foretwin.contracts.runner import TaskCount
from foretwin.contracts.running import FirstOf
from foretwin.orchestrator.agreement.known_windows import kept_windows
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.live_loop import RoundGrid
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.processes import ORCHESTRATOR
from foretwin.orchestrator.drive.side_by_side_handler import BesideStanding
from foretwin.orchestrator.forecast.calibration import Calibration
from foretwin.orchestrator.forecast.motion_history import MotionHistory
from foretwin.orchestrator.other_vehicles.encounter_handler import EncounterCount
from foretwin.orchestrator.record.bookkeeping import TelemetryCount
from foretwin.orchestrator.record.kept_parts import read_removed
from foretwin.orchestrator.record.ledger import RoundTally
from foretwin.orchestrator.record.recovered_record import counted_in_tables
from foretwin.orchestrator.record.visited import visited_junctions
from foretwin.orchestrator.routing.route_follower import PlaceOnRoute
from foretwin.orchestrator.runner.sickness import Sickness
from foretwin.orchestrator.runtime_configuration.handler import Change
from foretwin.orchestrator.tuning.findings import FindingsStanding
from foretwin.orchestrator.tuning.parameter_versions import ParametersStanding
from foretwin.telemetry.estimator.estimator import StateEstimator

log = logging.getLogger(ORCHESTRATOR)


@dataclass(frozen=True, kw_only=True)
class RoundsStanding:
    """Rounds and jobs so far; the number of the next one was given to none."""

    next_round_id: int
    tally: RoundTally
    jobs: TaskCount
    requeued: int
    late: int
    sickness: Sickness
    failed_jobs: int
    off_lanes_rounds: int
    not_placed: Counter[str]
    failed: Counter[str]
    remarked: Counter[str]
    siblings_dropped: Counter[str]


@dataclass(frozen=True, kw_only=True)
class HeardStanding:
    """What came from outside so far."""

    samples: TelemetryCount
    skipped: int
    estimator: StateEstimator | None
    history: MotionHistory | None
    calibration: Calibration | None
    refusals: Refusals
    refusals_told: set[tuple[bool, str, str]]
    strangers: int
    mailbox_dropped: int


@dataclass(frozen=True, kw_only=True)
class DriveStanding:
    """Where a drive stands; `exit_word` is empty while it goes on."""

    exit_word: str
    grid: RoundGrid | None
    info: VehicleInfo
    place: PlaceOnRoute
    rounds: RoundsStanding
    heard: bytes
    """A HeardStanding, of this moment or of one a little before."""
    roles: dict[str, Role]
    correction: Correction
    parameters: ParametersStanding
    findings: FindingsStanding
    beside: BesideStanding
    mirror_independent: bool | None
    touches: int
    encounters: EncounterCount
    free_twin: tuple[int, int]
    """Samples that were compared, and those beyond a limit."""
    changes: FirstOf[Change]
    dropped_rows: int
    troubles: list[str]
    given_up: set[str]


def heard_of(conductor: Conductor) -> bytes:
    """Return what a drive has heard, for `standing_of`: the estimator is by far the most of it."""
    intake, progress = conductor.intake, conductor.rounds.progress
    return pickle.dumps(
        HeardStanding(
            samples=intake.counts,
            skipped=intake.refused,
            estimator=intake.estimator,
            history=None if progress is None else progress.history,
            calibration=None if progress is None else progress.calibration,
            refusals=conductor.refusals.counted,
            refusals_told=conductor.refusals.told,
            strangers=conductor.strangers.count,
            mailbox_dropped=conductor.mailbox.dropped,
        )
    )


def standing_of(
    conductor: Conductor,
    watch: ProcessWatch,
    *,
    grid: RoundGrid | None,
    heard: bytes,
    exit_word: str = "",
) -> bytes:
    """Return where a drive stands; empty before the vehicle has said what it is."""
    intake, rounds = conductor.intake, conductor.rounds
    if intake.info is None:
        return b""
    dispatch = rounds.dispatcher.dispatch
    return pickle.dumps(
        DriveStanding(
            exit_word=exit_word,
            grid=grid,
            info=intake.info,
            place=conductor.mission.way.place,
            rounds=RoundsStanding(
                next_round_id=rounds.next_round_id,
                tally=rounds.tally,
                jobs=dispatch.count,
                requeued=dispatch.requeued,
                late=dispatch.late,
                sickness=dispatch.sickness,
                failed_jobs=rounds.failed_jobs,
                off_lanes_rounds=rounds.futures.off_lanes_rounds,
                not_placed=rounds.futures.not_placed,
                failed=rounds.futures.failed,
                remarked=rounds.futures.remarked,
                siblings_dropped=rounds.siblings.count.dropped,
            ),
            heard=heard,
            roles=conductor.roles.roles,
            correction=conductor.roles.correction,
            parameters=conductor.tuning.parameters.standing,
            findings=conductor.tuning.findings.standing,
            beside=conductor.ads.standing,
            mirror_independent=conductor.mirror.independent,
            touches=conductor.mirror.touches,
            encounters=conductor.beside.encounters.count,
            free_twin=(conductor.mirror.compared, conductor.mirror.beyond),
            changes=conductor.changes.made,
            dropped_rows=conductor.tables.dropped,
            troubles=watch.troubles,
            given_up=watch.given_up,
        )
    )


def read_standing(data: bytes) -> DriveStanding | None:
    """Return what an orchestrator of this drive left, None where it had not begun."""
    if not data:
        return None
    standing: DriveStanding = pickle.loads(data)  # written by a fork of this very process
    return standing


def heard_in(standing: DriveStanding) -> HeardStanding:
    """Return what an orchestrator had heard of this drive."""
    heard: HeardStanding = pickle.loads(standing.heard)  # written as the rest
    return heard


def go_on(
    conductor: Conductor,
    watch: ProcessWatch,
    standing: DriveStanding,
    results: Path,
    *,
    crashed: bool,
) -> None:
    """Let a conductor that has heard nothing yet go on where another one stood.

    After one that `crashed` by an error of ours the state is estimated anew: it may be the cause.
    """
    conductor.take_info(standing.info)
    _go_on_with_rounds(conductor, standing.rounds, results)
    conductor.mission.visits.go_on(visited_junctions(results))
    conductor.mission.way.go_on(standing.place)
    heard, intake = heard_in(standing), conductor.intake
    intake.counts, intake.refused = heard.samples, heard.skipped
    if heard.estimator is not None and not crashed:
        intake.go_on(heard.estimator)
        if conductor.rounds.progress and heard.history and heard.calibration:
            conductor.rounds.progress.go_on(heard.history, heard.calibration)
    conductor.refusals.counted = heard.refusals
    conductor.refusals.told = heard.refusals_told
    conductor.strangers.count = heard.strangers
    conductor.mailbox.dropped = heard.mailbox_dropped
    conductor.roles.roles, conductor.roles.correction = standing.roles, standing.correction
    conductor.changes.made = standing.changes
    parameters = standing.parameters
    conductor.tuning.parameters.go_on(parameters)
    if parameters.version:
        conductor.rounds.use_vehicle(parameters.in_force.vehicle, parameters.version)
        intake.use_vehicle(parameters.in_force.vehicle)
    conductor.tuning.findings.go_on(standing.findings)
    conductor.ads.go_on(standing.beside)
    conductor.mirror.independent = standing.mirror_independent
    conductor.mirror.touches = standing.touches
    conductor.beside.encounters.count = standing.encounters
    conductor.mirror.compared, conductor.mirror.beyond = standing.free_twin
    conductor.tables.lost_before = standing.dropped_rows
    watch.troubles[:] = standing.troubles
    watch.given_up |= standing.given_up
    for process_id in sorted(standing.given_up):
        conductor.rounds.never_again(process_id)


def _go_on_with_rounds(conductor: Conductor, standing: RoundsStanding, results: Path) -> None:
    """Count on: what was open, or in no table yet, when the one before died, is lost."""
    rounds, counts = conductor.rounds, counted_in_tables(results)
    rounds.futures, rounds.comparisons, rounds.plans = counts[:3]
    rounds.forecast_count = counts.forecasts
    rounds.siblings.count = counts.siblings
    rounds.siblings.count.dropped = standing.siblings_dropped
    rounds.futures.off_lanes_rounds = standing.off_lanes_rounds
    rounds.futures.not_placed = standing.not_placed
    rounds.futures.failed, rounds.futures.remarked = standing.failed, standing.remarked
    rounds.windows.go_on(kept_windows(results).windows, conductor.worlds.world)
    rounds.next_round_id = max(standing.next_round_id, counts.last_round_id + 1)
    rounds.failed_jobs = standing.failed_jobs
    tally = rounds.tally = standing.tally
    told = tally.run
    if not read_removed(results.parent):  # else no table has all of them any more
        tally.run = rounds.futures.rounds
    unwritten = max(0, told - tally.run)
    cut_off = tally.due - tally.ended
    tally.cut_off += max(0, cut_off)
    dispatch = rounds.dispatcher.dispatch
    dispatch.requeued, dispatch.late = standing.requeued, standing.late
    dispatch.sickness, dispatch.count = standing.sickness, standing.jobs
    jobs = dispatch.count
    open_jobs = jobs.given - jobs.results - jobs.refused - jobs.lost
    jobs.lost += max(0, open_jobs)
    log.info(
        "goes on at round %d: %d rounds are cut off, %d of them complete and not yet written; %d "
        "jobs are lost", rounds.next_round_id, cut_off, unwritten, open_jobs,
    )  # fmt: skip
