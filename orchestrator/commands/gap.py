"""`foretwin gap`: the reality gap of a recorded drive as a table, plots and a verdict."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import GnssFix, VehicleInfo, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.gap import GapAlarm, GapSample, Verdict
from foretwin.contracts.new_folder import named_in_errors, new_files, trouble_with_folder
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.commands.compare import compare_logs, scale_object
from foretwin.orchestrator.commands.compare_text import after_lines
from foretwin.orchestrator.commands.gap_text import (
    WIDTH,
    DrivenBy,
    moved_lines,
    not_held_lines,
    table_lines,
    turning_lines,
    turning_object,
    verdict_lines,
    why_undecided,
)
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.drive.telemetry_watch import estimate_line, estimate_object
from foretwin.orchestrator.record.run_state import check_finished
from foretwin.sim_worker.analysis.gap.clock_offsets import (
    ClockOffset,
    apart_from_commands,
    moved_s,
    on_one_clock,
)
from foretwin.sim_worker.analysis.gap.errors import GapLimits, GapMeter, GapRow, gap_table
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.gap.measured_motion import LONGEST_GAP_S, motion_on_grid
from foretwin.sim_worker.analysis.gap.measured_turning import NotHeld, TurningGap, turning_gap
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector, without_manual_commands
from foretwin.sim_worker.analysis.motion_record import MotionRecorder
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import estimator_of
from foretwin.telemetry.estimator.reported_state import StateConsistency
from foretwin.telemetry.logs.log import Log, Sample
from foretwin.telemetry.logs.opening import open_log

_SECOND_NS = 1_000_000_000


class GapReport(NamedTuple):
    """What a recorded drive says of the gap."""

    info: VehicleInfo
    samples: list[GapSample]
    rows: list[GapRow]
    alarms: list[GapAlarm]
    verdicts: list[Verdict]
    undecided: str
    """What departs, where nobody is accused."""
    turning: TurningGap | NotHeld
    """The model driven by measured steering and speed, or why these are not enough."""
    driven_by: DrivenBy
    moved_s: dict[str, float]
    """By how much samples of which channels were stamped late, and are judged earlier."""
    refused: dict[str, int]
    """Samples that the reader refused, by reason."""
    estimate: StateConsistency
    """How far the states that all of it rests on can be trusted."""


def gap_of(log: Log, vehicle: VehicleParameters, *, name: str, progress: bool = False) -> GapReport:
    """Replay a drive through the estimator, the model and the detector.

    `name` is what errors call the drive; with `progress` a bar runs over its seconds. Raises
    UserError for a drive without a position or without motion.
    """
    messages = list(log.samples())
    first = next((m for _, m in messages if isinstance(m, GnssFix)), None)
    if first is None:
        raise UserError(f"{name}: no position in the drive, so there is no motion to compare with")
    stamps = [message.stamp_ns for _, message in messages]  # type: ignore[attr-defined]
    seconds = (stamps[-1] - stamps[0]) // _SECOND_NS
    if not progress:
        return _measured(log, messages, vehicle, LocalFrame(first.position), name, lambda _: None)
    with progress_bar(seconds, "seconds") as (advance, _):
        return _measured(log, messages, vehicle, LocalFrame(first.position), name, advance)


def _why_no_run(states: list[VehicleState]) -> str:
    """Return why no run of the model can begin at any of a drive's states."""
    # Sources of one rhythm come in turn: what counts is the gap that half of the time lies in.
    gaps_s = np.sort(np.diff([state.stamp_ns for state in states])) * 1e-9
    half = int(np.searchsorted(np.cumsum(gaps_s), gaps_s.sum() / 2.0))
    apart_s = float(gaps_s[half]) if len(gaps_s) else 0.0
    if apart_s > LONGEST_GAP_S:
        return (
            f"its samples come {apart_s:.1f} s apart, and the motion between is known for"
            f" {LONGEST_GAP_S:g} s"
        )
    return "the heading is never known for a second"


def _measured(
    log: Log,
    messages: list[Sample],
    vehicle: VehicleParameters,
    frame: LocalFrame,
    name: str,
    advance: Callable[[str], None],
) -> GapReport:
    estimator = estimator_of(log.info, vehicle)
    detector = FaultDetector(log.info, vehicle, frame=frame)
    recorder = MotionRecorder(frame=frame, keep_s=1e6, depth=len(messages) + 1)
    for channel, message in messages:
        recorder.handle(channel, message)
    record = without_manual_commands(recorder.record())
    found = turning_gap(record, vehicle)
    turning = found if isinstance(found, TurningGap) else None
    by_hand = turning is not None and not np.isfinite(record.command_accel_mps2).any()
    clocks: dict[str, ClockOffset | None] = {}
    if turning is not None:
        steering, speed = turning.steering_clock, turning.speed_clock
        clocks = {"steering": steering, "speed": speed}
        if not by_hand:  # how late steering is may be the model's fault: that is judged below
            clocks = apart_from_commands(steering, speed=speed, gnss=turning.position_clock)
    # States and pairs of signals that are compared must not be of different times.
    messages = on_one_clock(messages, clocks) if clocks else messages
    states: list[VehicleState] = []
    verdicts: list[Verdict] = []
    next_ns: int | None = None
    for channel, message in messages:
        stamp_ns: int = message.stamp_ns  # type: ignore[attr-defined]
        next_ns = stamp_ns + _SECOND_NS if next_ns is None else next_ns
        while stamp_ns >= next_ns:
            next_ns += _SECOND_NS
            advance(Path(name).name)
        verdict = detector.handle(channel, message)
        if verdict is not None:
            verdicts.append(verdict)
        state = estimator.handle(channel, message)
        if state is not None:
            states.append(state)
    motion = motion_on_grid(states, record.stamp_ns, frame=frame)
    meter = GapMeter(FreeRunner(vehicle), vehicle_id=log.info.vehicle_id)
    samples = meter.samples(record, motion, measured=None if turning is None else turning.drive)
    if not samples:
        raise UserError(f"{name}: {_why_no_run(states)}, so no run can begin")
    limits = GapLimits()
    alarms = [alarm for sample in samples for alarm in limits.handle(sample)]
    refused = {reason: count for reason, count in log.skipped.items() if count}
    driven_by: DrivenBy = "estimated commands"
    if samples[0].independent:
        driven_by = "measured steering and speed" if by_hand else "commands"
    return GapReport(
        info=log.info,
        samples=samples,
        rows=gap_table(samples),
        alarms=alarms,
        verdicts=verdicts,
        undecided=turning.departure if turning is not None and by_hand else detector.undecided,
        turning=found,
        driven_by=driven_by,
        moved_s=moved_s(clocks),
        refused=refused,
        estimate=estimator.consistency,
    )


def report_gap(
    recording: Path,
    *,
    vehicle: str | None,
    out: Path | None,
    declaration: Path | None = None,
    against: Path | None = None,
) -> CommandResult:
    """Return the gap of a recorded drive; with `out` also write its plots there.

    `against` is another drive of the same road: how far people differ on it stands beside.
    """
    parameters = load_vehicle(vehicle)
    if out is not None and (trouble := trouble_with_folder(out)) is not None:
        raise UserError(f"--out {out}: {trouble}")
    check_finished(recording if recording.is_dir() else recording.parent)
    people = None if against is None else compare_logs(recording, against, declaration=declaration)
    log = open_log(recording, declaration=declaration)
    report = gap_of(log, parameters, name=str(recording), progress=True)
    plots: list[Path] = []
    if out is not None:
        from foretwin.orchestrator.commands.gap_plots import write_plots

        with named_in_errors(f"--out {out}"), new_files(out):
            plots = write_plots(
                report.samples, report.verdicts, out, start_ns=report.info.start_stamp_ns
            )
    body, lines = as_object(report), []
    if people is not None:
        body |= {"against": scale_object(people)}
        title = f"two drives of this road, this one and {against}: what a gap is measured against"
        lines = [title, *after_lines(people.difference), ""]
    return CommandResult(
        body, "\n".join([*lines, *_lines(report), *(f"wrote {plot}" for plot in plots)])
    )


def as_object(report: GapReport) -> dict[str, Any]:
    """Return the report as JSON has it: rows, verdicts with evidence, alarms, refused samples.

    `reason` says why nobody is accused, null where somebody is.
    """
    turning = report.turning
    return {
        "vehicle_id": report.info.vehicle_id,
        "independent": all(row.independent for row in report.rows),
        "driven_by": report.driven_by,
        "rows": [row._asdict() for row in report.rows],
        "reason": why_undecided(report.verdicts, report.undecided, driven_by=report.driven_by),
        "turning": None if isinstance(turning, NotHeld) else turning_object(turning),
        "moved_s": report.moved_s,
        "turning_not_held": turning.why if isinstance(turning, NotHeld) else None,
        "verdicts": [msgspec.to_builtins(verdict) for verdict in report.verdicts],
        "alarms": [msgspec.to_builtins(alarm) for alarm in report.alarms],
        "refused": report.refused,
        "estimate": estimate_object(report.estimate),
    }


def _lines(report: GapReport) -> list[str]:
    lines = list(table_lines(report.rows))
    if report.refused:
        left = ", ".join(f"{count} {reason}" for reason, count in sorted(report.refused.items()))
        lines.append(f"refused: {left}")
    lines += textwrap.wrap(estimate_line(report.estimate), WIDTH, subsequent_indent="  ")
    if isinstance(report.turning, TurningGap):
        lines += turning_lines(report.turning)
    elif report.driven_by == "estimated commands":
        lines += [*not_held_lines(report.turning), ""]
    lines += moved_lines(report.moved_s)
    reason = why_undecided(report.verdicts, report.undecided, driven_by=report.driven_by)
    start_ns = report.info.start_stamp_ns
    return lines + list(verdict_lines(report.verdicts, report.alarms, reason, start_ns=start_ns))
