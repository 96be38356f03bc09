"""`foretwin identify`: what a recorded drive says of its vehicle's parameters."""

from __future__ import annotations

import contextlib
import math
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.new_folder import named_in_errors, new_files, trouble_with_folder
from foretwin.contracts.tuning import Identification
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.sim_worker.analysis.gap.sensors_by_positions import accused_sensors, are_precise
from foretwin.sim_worker.analysis.identify.acceptance import (
    accepted,
    doubted,
    is_acceptable,
    vehicle_toml,
)
from foretwin.sim_worker.analysis.identify.picture import draw_estimates, draw_steering
from foretwin.sim_worker.analysis.identify.window import UNDERSTEER_NAME, identify
from foretwin.sim_worker.analysis.motion_record import MotionRecord, MotionRecorder
from foretwin.sim_worker.vehicle.parameters import load_vehicle, scale_of
from foretwin.telemetry.logs import open_log

_ESTIMATES, _STEERING = "estimates.png", "steering.png"
_FINE_S, _COARSE_S = 0.01, 0.02
_LONG_S = 600.0
_MOST_S = 2.0 * 3600.0
_STANDS_MPS = 0.5
_WIDTH = 80
_ROW = "{:<21}{:>9}  {:<20} {:<13}{:>9} {:1}"
_DEGREES = math.degrees(1.0)
SHOWN = {
    "steering_ratio": ("steering ratio", "", 1.0),
    "steering_offset_rad": ("steering offset", "° at the tyre", _DEGREES),
    UNDERSTEER_NAME: ("understeer gradient", "mrad per m/s²", 1e3),
    "wheelbase_m": ("wheelbase", "m", 1.0),
    "steering_delay_s": ("steering delay", "ms", 1e3),
    "steering_lag_s": ("steering lag", "ms", 1e3),
    "drive_gain": ("drive gain", "", 1.0),
    "brake_gain": ("brake gain", "", 1.0),
    "drag_npv2": ("drag", "N/(m/s)²", 1.0),
    "rolling_resistance_n": ("rolling resistance", "N", 1.0),
    "accel_delay_s": ("drive, brake delay", "ms", 1e3),
}
"""Name, unit and scale by which a parameter is shown."""


def identify_log(
    log_file: Path,
    *,
    vehicle_file: str | None,
    out: Path | None,
    declaration: Path | None = None,
) -> CommandResult:
    """Return what the log says; write plots and a vehicle file with what is taken to `out`."""
    if out is not None and (trouble := trouble_with_folder(out)) is not None:
        raise UserError(f"--out {out}: {trouble}")
    vehicle = load_vehicle(vehicle_file)
    record, info, precise_positions = read_drive(log_file, declaration=declaration)
    told = identify(record, vehicle, vehicle_id=info.vehicle_id)
    if precise_positions:
        ahead_m = 0.0 if info.body_from_antenna_m is None else info.body_from_antenna_m[0]
        accused = accused_sensors(record, antenna_ahead_m=ahead_m)
        told = doubted(told, {found.cause: found.text for found in accused})
    written = ["vehicle.toml", "identification.json"]
    if out is not None:
        changed, _ = accepted(told, vehicle, source=f"identified from {log_file.name}")
        body = msgspec.json.encode(told)
        with named_in_errors(f"--out {out}"), new_files(out):
            (out / written[0]).write_text(
                vehicle_toml(changed, scale=scale_of(vehicle_file)), encoding="utf-8"
            )
            (out / written[1]).write_bytes(msgspec.json.format(body, indent=1) + b"\n")
            if draw_estimates(told, out / _ESTIMATES):
                written.append(_ESTIMATES)
            # A drive without steering, yaw rate or speed has no such picture: the table says so.
            with contextlib.suppress(ValueError):
                draw_steering(record, vehicle, out / _STEERING)
                written.append(_STEERING)
    lines = as_lines(told, vehicle)
    if out is not None:
        lines.append(f"{out}: {', '.join(written)}")
    return CommandResult(as_object(told), "\n".join(lines))


class RecordedDrive(NamedTuple):
    """A log's signals on a grid, its vehicle, and whether positions may accuse other sensors."""

    record: MotionRecord
    info: VehicleInfo
    precise_positions: bool


def read_drive(log_file: Path, *, declaration: Path | None = None) -> RecordedDrive:
    """Return what a log holds for identification; `declaration` is that of `open_log`.

    Raises UserError for a log of less than a second, of a vehicle that stands or without a sample
    that identification could use, and what `open_log` raises.
    """
    log = open_log(log_file, declaration=declaration)
    recorder: MotionRecorder | None = None
    waiting: list[tuple[str, Any]] = []
    fixes: list[GnssFix] = []
    for channel, message in log.samples():
        if isinstance(message, GnssFix):
            fixes.append(message)
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
    fastest_mps = np.nanmax(np.abs(record.speed_mps), initial=0.0)
    if record.has("speed_mps") and fastest_mps < _STANDS_MPS:
        raise UserError(
            f"{log_file}: the vehicle never goes faster than {fastest_mps:.1f} m/s: "
            "identification needs a drive with bends, gas and brakes"
        )
    if record.time_s[-1] < _LONG_S:
        record = recorder.record(period_s=_FINE_S)
    return RecordedDrive(record, log.info, are_precise(fixes))


def _recorder(place: GeoPoint, waiting: list[tuple[str, Any]]) -> MotionRecorder:
    recorder = MotionRecorder(frame=LocalFrame(place), keep_s=_MOST_S, depth=2_000_000)
    for channel, message in waiting:
        recorder.handle(channel, message)
    return recorder


def as_object(told: Identification) -> dict[str, Any]:
    """Return `{parameter: {value, low, high, reason}}`; value, low and high may be None."""
    names = ("value", "low", "high", "reason")
    return {found.name: {name: getattr(found, name) for name in names} for found in told.estimates}


def as_lines(told: Identification, vehicle: VehicleParameters) -> list[str]:
    """Return the table, at most 80 columns wide: a line a parameter, reasons below them.

    `vehicle` is what was identified against, which the intervals are conditional on.
    """
    duration_s = (told.stamp_ns - told.from_stamp_ns) * 1e-9
    lines = [f"{duration_s:.0f} s of {told.vehicle_id}", ""]
    lines.append(_ROW.format("", "value", "95 % interval", "unit", "file", "").rstrip())
    above = ""
    for found in told.estimates:
        name, unit, scale = SHOWN[found.name]
        interval = "" if found.low is None else _interval(found.low, found.high, scale)
        taken = "*" if is_acceptable(found) else ""
        value, prior = _number(found.value, scale), _number(found.prior, scale)
        lines.append(_ROW.format(name, value, interval, unit, prior, taken).rstrip())
        if found.reason:
            said = "as above" if found.reason == above else found.reason
            lines += textwrap.wrap(said, _WIDTH, initial_indent="    ", subsequent_indent="    ")
        above = found.reason
    if told.steering_map:
        lines += ["", "steering ratio by speed"]
    for entry in told.steering_map:
        speeds = f"{entry.from_mps:g} to {entry.to_mps:g} m/s"
        interval = _interval(entry.low, entry.high, 1.0)
        lines.append(_ROW.format(speeds, _number(entry.ratio, 1.0), interval, "", "", "").rstrip())
    base, mass = vehicle.wheelbase_m, vehicle.mass_kg.value
    given = (
        f"intervals hold given the file's {vehicle.name}: of the steering its wheelbase of "
        f"{base.value:.4g} ± {1.96 * (base.std or 0.0):.2g} m and its tyres, of the resistances "
        f"its mass of {mass:.0f} kg; and given that sensors share one clock"
    )
    return [*lines, "", *textwrap.wrap(given, _WIDTH), "* may be taken: nothing speaks against it"]


def _number(value: float | None, scale: float) -> str:
    # What is nothing but rounding error is shown as 0, and 0 without a sign.
    return "-" if value is None else f"{round(value * scale, 5) + 0.0:.4g}"


def _interval(low: float | None, high: float | None, scale: float) -> str:
    return f"{_number(low, scale)} to {_number(high, scale)}"
