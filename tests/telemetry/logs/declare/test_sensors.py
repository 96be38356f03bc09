"""What was measured, and what a controller wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs.declare import propose
from tests.telemetry.logs.declare.test_propose import drawn_drive, one_table


@pytest.mark.parametrize(
    "wanted", ["steering_cmd", "target_steering", "Lenkwinkel_soll", "control_wheel"]
)
def test_what_was_measured_is_taken_before_what_was_wanted(tmp_path: Path, wanted: str) -> None:
    drive = drawn_drive()
    wheel = drive["steering"].columns["wheel"]
    at_fixes = np.interp(drive["gnss"].stamps_ns, drive["steering"].stamps_ns, wheel)
    noise = np.random.default_rng(3).normal(0.0, 0.02 * np.std(wheel), len(at_fixes))
    path = one_table(tmp_path, **{wanted: at_fixes, "steering": at_fixes + noise})
    proposed = propose(path)
    assert proposed.declaration is not None
    assert proposed.declaration.steering is not None
    taken = proposed.declaration.steering.wheel or proposed.declaration.steering.tire
    assert taken is not None
    assert taken.column == "steering"
    assert "not what then was" not in "\n".join(proposed.unknown)

    tyre = at_fixes / 15.0 * (1.0 + noise / np.std(wheel))
    both = propose(one_table(tmp_path, **{wanted: at_fixes, "tyre": tyre})).declaration
    assert both is not None
    assert both.steering is not None
    assert both.steering.wheel is None
    assert both.steering.tire is not None
    assert both.steering.tire.column == "tyre"

    alone = propose(one_table(tmp_path, **{wanted: at_fixes}))
    assert f"{wanted}: by its name this is what was wanted" in "\n".join(alone.unknown)


def test_a_gyro_alone_is_an_inertial_unit_without_forces(tmp_path: Path) -> None:
    drive = drawn_drive()
    imu = drive["imu"]
    rate = np.interp(drive["gnss"].stamps_ns, imu.stamps_ns, imu.columns["rate_z"])
    found = propose(one_table(tmp_path, r=rate)).declaration
    assert found is not None
    assert found.imu is not None
    assert (found.imu.rate_z.column, found.imu.accel_x) == ("r", None)


def test_a_commanded_acceleration_does_not_hide_the_measured_one(tmp_path: Path) -> None:
    drive = drawn_drive()
    fixes, imu = drive["gnss"].stamps_ns, drive["imu"]
    rate, accel = (
        np.interp(fixes, imu.stamps_ns, imu.columns[name]) for name in ("rate_z", "accel_x")
    )
    noise = np.random.default_rng(3).normal(0.0, 0.1 * np.std(accel), len(accel))
    now_and_then = np.where(np.arange(len(accel)) % 3 == 0, accel, np.nan)
    found = propose(one_table(tmp_path, r=rate, a=accel + noise, control_accel=now_and_then))
    assert found.declaration is not None
    assert found.declaration.imu is not None
    assert found.declaration.imu.accel_x is not None
    assert found.declaration.imu.accel_x.column == "a"

    alone = propose(one_table(tmp_path, r=rate, control_accel=now_and_then))
    said = "acceleration (control_accel) and turning rate (r) stand in different rows"
    assert said in "\n".join(alone.unknown)


@pytest.mark.parametrize(("late_s", "corrected"), [(0.4, True), (1.6, False)])
def test_a_lateness_beyond_what_is_tried_is_told_as_that_and_not_corrected(
    tmp_path: Path, late_s: float, corrected: bool
) -> None:
    drive = drawn_drive()
    fixes, speed = drive["gnss"].stamps_ns, drive["speed"]
    late = np.interp(fixes - late_s * 1e9, speed.stamps_ns, speed.columns["forward"])
    proposed = propose(one_table(tmp_path, v=late))
    assert proposed.declaration is not None
    assert proposed.declaration.speed is not None
    assert (proposed.declaration.speed.late_s > 0.3) == corrected
    said = "\n".join(str(line) for line in proposed.evidence["speed"])
    assert ("s or more" in said) != corrected
