"""`foretwin identify`: what a recorded drive says of its vehicle's parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.table import Table

from contracts.drive import GnssFix
from contracts.errors import UserError
from contracts.frames import GeoPoint, LocalFrame
from contracts.tuning import Identification, ParameterEstimate
from sim_worker.identify.acceptance import accepted, is_acceptable, vehicle_toml
from sim_worker.identify.picture import draw_estimates, draw_steering
from sim_worker.identify.window import identify
from sim_worker.motion_record import MotionRecord, MotionRecorder
from sim_worker.vehicle.parameters import load_vehicle
from telemetry.logs import open_log

_FINE_S, _COARSE_S = 0.01, 0.02
_LONG_S = 600.0
_MOST_S = 2.0 * 3600.0


def identify_log(
    log_file: Path, *, vehicle_file: str | None, as_json: bool, out: Path | None
) -> int:
    """Print what the log says; write plots and a vehicle file with what is taken to `out`.

    Returns the exit code, 0.
    """
    vehicle = load_vehicle(vehicle_file)
    record, vehicle_id = read_record(log_file)
    told = identify(record, vehicle, vehicle_id=vehicle_id)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        changed, _ = accepted(told, vehicle, source=f"identified from {log_file.name}")
        (out / "vehicle.toml").write_text(vehicle_toml(changed), encoding="utf-8")
        draw_estimates(told, out / "estimates.png")
        if record.has("wheel_rad") and record.has("yaw_rate_radps") and record.has("speed_mps"):
            draw_steering(record, vehicle, out / "steering.png")
    if as_json:
        body = msgspec.json.encode(as_object(told))
        print(msgspec.json.format(body, indent=1).decode())
    else:
        Console().print(_table(told))
        if out is not None:
            print(f"{out}: vehicle.toml and plots")
    return 0


def read_record(log_file: Path) -> tuple[MotionRecord, str]:
    """Return a log's signals on a grid and its vehicle's id.

    Raises UserError for a log of less than a second or without a sample that identification
    could use, and what `open_log` raises.
    """
    log = open_log(log_file)
    recorder: MotionRecorder | None = None
    waiting: list[tuple[str, Any]] = []
    for channel, message in log.samples():
        if recorder is None:
            waiting.append((channel, message))
            if not isinstance(message, GnssFix):
                continue
            recorder = _recorder(message.position, waiting)
        else:
            recorder.handle(channel, message)
    if recorder is None:
        recorder = _recorder(GeoPoint(0.0, 0.0), waiting)
    if recorder.newest_stamp_ns is None:
        raise UserError(f"{log_file}: holds no speed, yaw rate, steering or command")
    record = recorder.record(period_s=_COARSE_S)
    if len(record.stamp_ns) * _COARSE_S < 1.0:
        raise UserError(f"{log_file}: less than a second of driving")
    if record.time_s[-1] < _LONG_S:
        record = recorder.record(period_s=_FINE_S)
    return record, log.info.vehicle_id


def _recorder(place: GeoPoint, waiting: list[tuple[str, Any]]) -> MotionRecorder:
    recorder = MotionRecorder(frame=LocalFrame(place), keep_s=_MOST_S, depth=2_000_000)
    for channel, message in waiting:
        recorder.handle(channel, message)
    return recorder


def as_object(told: Identification) -> dict[str, Any]:
    """Return `{parameter: {value, low, high, prior, taken, reason}}` and what goes with it."""
    body: dict[str, Any] = {
        found.name: {
            "value": found.value, "low": found.low, "high": found.high, "prior": found.prior,
            "taken": is_acceptable(found), "reason": found.reason,
        }
        for found in told.estimates
    }  # fmt: skip
    body["steering_map"] = [msgspec.to_builtins(entry) for entry in told.steering_map]
    body["duration_s"] = (told.stamp_ns - told.from_stamp_ns) * 1e-9
    body["excited_s"] = told.excited_s
    return body


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _row(found: ParameterEstimate) -> tuple[str, ...]:
    interval = "" if found.low is None else f"{_number(found.low)} … {_number(found.high)}"
    taken = "taken" if is_acceptable(found) else found.reason
    return found.name, _number(found.value), interval, _number(found.prior), taken


def _table(told: Identification) -> Table:
    duration_s = (told.stamp_ns - told.from_stamp_ns) * 1e-9
    table = Table(title=f"{duration_s:.0f} s of {told.vehicle_id}")
    for heading in ("parameter", "value", "95 % interval", "in force", ""):
        table.add_column(heading)
    for found in told.estimates:
        table.add_row(*_row(found))
    for entry in told.steering_map:
        table.add_row(
            f"ratio at {entry.from_mps:g} to {entry.to_mps:g} m/s", _number(entry.ratio),
            f"{_number(entry.low)} … {_number(entry.high)}", "", "",
        )  # fmt: skip
    return table
