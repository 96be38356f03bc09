"""`foretwin gap`: the reality gap of a recorded drive as a table, plots and a verdict."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from contracts.drive import GnssFix, VehicleInfo, VehicleState
from contracts.errors import UserError
from contracts.frames import LocalFrame
from contracts.gap import GapAlarm, GapSample, Verdict
from contracts.vehicle import VehicleParameters
from sim_worker.gap.errors import GapMeter, GapRow, gap_table
from sim_worker.gap.free_run import FreeRunner
from sim_worker.gap.limits import GapLimits
from sim_worker.gap.measured_motion import motion_on_grid
from sim_worker.gap.verdict import Judge, without_manual_commands
from sim_worker.motion_record import MotionRecorder
from sim_worker.vehicle.parameters import load_vehicle
from telemetry.estimator import StateEstimator
from telemetry.logs.log import Log
from telemetry.logs.opening import open_log


class GapReport(NamedTuple):
    """What a recorded drive says of the gap."""

    info: VehicleInfo
    samples: list[GapSample]
    rows: list[GapRow]
    alarms: list[GapAlarm]
    verdicts: list[Verdict]
    refused: dict[str, int]
    """Samples that the reader refused, by reason."""


def gap_of(log: Log, vehicle: VehicleParameters) -> GapReport:
    """Replay a drive through the estimator, the model and the judge.

    Raises UserError for a drive without a position or without motion.
    """
    messages = list(log.samples())
    first = next((m for _, m in messages if isinstance(m, GnssFix)), None)
    if first is None:
        raise UserError(f"{log.info.source or log.info.vehicle_id}: no position in the drive")
    frame = LocalFrame(first.position)
    estimator = StateEstimator(
        log.info,
        wheelbase_m=vehicle.wheelbase_m.value,
        steering_ratio=vehicle.steering_ratio.value,
        steering_offset_rad=vehicle.steering_offset_rad.value,
    )
    judge = Judge(log.info, vehicle, frame=frame)
    recorder = MotionRecorder(frame=frame, keep_s=1e6, depth=len(messages) + 1)
    states: list[VehicleState] = []
    verdicts: list[Verdict] = []
    for channel, message in messages:
        recorder.handle(channel, message)
        verdict = judge.handle(channel, message)
        if verdict is not None:
            verdicts.append(verdict)
        state = estimator.handle(channel, message)
        if state is not None:
            states.append(state)
    record = without_manual_commands(recorder.record())
    motion = motion_on_grid(states, record.stamp_ns, frame=frame)
    meter = GapMeter(FreeRunner(vehicle), vehicle_id=log.info.vehicle_id)
    samples = meter.samples(record, motion)
    if not samples:
        raise UserError(
            f"{log.info.source or log.info.vehicle_id}: the heading is never known for a second"
        )
    limits = GapLimits()
    alarms = [alarm for sample in samples for alarm in limits.handle(sample)]
    refused = {reason: count for reason, count in log.skipped.items() if count}
    return GapReport(log.info, samples, gap_table(samples), alarms, verdicts, refused)


def report_gap(recording: Path, *, vehicle: str | None, as_json: bool, out: Path | None) -> None:
    """Print the gap of a recorded drive; with `out` also write its plots there."""
    report = gap_of(open_log(recording), load_vehicle(vehicle))
    plots: list[Path] = []
    if out is not None:
        from orchestrator.gap_plots import write_plots

        if out.exists() and not out.is_dir():
            raise UserError(f"{out}: is no folder")
        out.mkdir(parents=True, exist_ok=True)
        plots = write_plots(report.samples, out)
    if as_json:
        print(json.dumps(as_object(report), indent=2))
        return
    print("\n".join(_lines(report)))
    for plot in plots:
        print(f"wrote {plot}")


def as_object(report: GapReport) -> dict[str, Any]:
    """Return the report as JSON has it: rows, verdicts with evidence, alarms, refused samples."""
    return {
        "vehicle_id": report.info.vehicle_id,
        "independent": all(row.independent for row in report.rows),
        "rows": [row._asdict() for row in report.rows],
        "verdicts": [msgspec.to_builtins(verdict) for verdict in report.verdicts],
        "alarms": [msgspec.to_builtins(alarm) for alarm in report.alarms],
        "refused": report.refused,
    }


def _lines(report: GapReport) -> list[str]:
    lines = [
        "gap of the model left to itself, RMS (95th percentile)",
        f"{'horizon':>7}  {'manoeuvre':<12} {'runs':>5}  {'along m':>15}  {'across m':>15}  "
        f"{'heading °':>13}  {'yaw rate °/s':>13}  {'speed m/s':>13}  {'accel m/s²':>13}",
    ]
    for row in report.rows:
        cells = []
        for name, scale, width in (
            ("along_m", 1.0, 15), ("across_m", 1.0, 15), ("yaw_rad", 57.29578, 13),
            ("yaw_rate_radps", 57.29578, 13), ("speed_mps", 1.0, 13), ("accel_mps2", 1.0, 13),
        ):  # fmt: skip
            text = f"{scale * row.rms[name]:.2f} ({scale * row.p95[name]:.2f})"
            cells.append(f"{text:>{width}}")
        lines.append(
            f"{row.horizon_s:>5g} s  {row.manoeuvre:<12} {row.runs:>5}  " + "  ".join(cells)
        )
    if not all(row.independent for row in report.rows):
        lines.append("commands were not recorded: estimated from the motion they are compared with")
    start_ns = report.info.start_stamp_ns
    if report.refused:
        left = ", ".join(f"{count} {reason}" for reason, count in sorted(report.refused.items()))
        lines.append(f"refused: {left}")
    raised = sum(alarm.over for alarm in report.alarms)
    lines.append(f"alarms: {raised}")
    if not report.verdicts:
        lines.append("verdict: none: nothing shows that the car or the model departs")
    for verdict in report.verdicts:
        at_s = (verdict.stamp_ns - start_ns) * 1e-9
        who = verdict.culprit if verdict.culprit != "vehicle" else "real vehicle"
        lines.append(
            f"verdict at {at_s:.1f} s: {who}, {verdict.cause} "
            f"(confidence {verdict.confidence:.2f}): {verdict.text}"
        )
        lines += [
            f"  {one.name}: {one.value:.4g} ± {one.std:.2g}, expected {one.expected:.4g}: "
            f"{one.text}"
            for one in verdict.evidence
        ]
    return lines
