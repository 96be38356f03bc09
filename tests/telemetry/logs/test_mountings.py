"""Inertial units on their side or upside down: turned where a transform says how, else left out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foretwin.contracts import drive
from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs import Log, open_log
from foretwin.telemetry.logs.mountings import NOT_UPRIGHT
from foretwin.telemetry.ros_messages.parts import typestore
from foretwin.telemetry.ros_messages.table import messages_from
from tests.telemetry.autoware_messages import transform_message
from tests.telemetry.test_foreign_mcap import START_NS, ForeignFile, fix

COVERS = (
    "foretwin.telemetry.logs.foreign_ros",
    "foretwin.telemetry.ros_messages.transforms",
)
IMU, TF = "sensor_msgs/msg/Imu", "tf2_msgs/msg/TFMessage"
FORCE, RATE = np.array([0.4, -0.3, 9.8]), np.array([0.01, 0.02, 0.3])
"""Of the car, turning to the left."""

UPRIGHT = np.eye(3)
SIDE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Into the car's axes of a unit whose x looks up, y ahead and z to the left."""
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])
TURNED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Upright, and its x looks to the left."""


def quaternion_of(turn: Array) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a matrix of right angles, by its trace or its greatest axis."""
    w = math.sqrt(max(1.0 + np.trace(turn), 0.0)) / 2.0
    if w > 1e-6:
        x, y, z = (turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
        return x / (4.0 * w), y / (4.0 * w), z / (4.0 * w), w
    return (*(np.diag(turn) > 0.0).astype(float).tolist(), 0.0)


def static_transform(turn: Array) -> Any:
    message = transform_message(
        0, parent="base_link", child="imu_link", place_m=(0.5, 0.0, 0.3), yaw_rad=0.0
    )
    turned = message.transforms[0].transform.rotation
    turned.x, turned.y, turned.z, turned.w = quaternion_of(turn)
    return message


def measured(stamp_ns: int, force: Array, rate: Array) -> Any:
    sample = drive.ImuSample(
        stamp_ns=stamp_ns,
        accel_mps2=tuple(force.tolist()),
        rate_radps=tuple(rate.tolist()),
    )
    part = messages_from("imu", sample, None)[0]
    message: Any = typestore().deserialize_cdr(part.data, part.kind)
    message.header.frame_id = "imu_link"
    return message


def recording(
    path: Path, mounted: Array, *, told: Array | None, force: Array = FORCE
) -> tuple[Log, list[drive.ImuSample]]:
    """Write ten samples of a unit turned into the car by `mounted`, as `told` says or not."""
    file = ForeignFile(path / "drive.mcap")
    if told is not None:
        file.add("/tf_static", TF, static_transform(told), START_NS)
    for tick in range(10):
        at = START_NS + tick * 100_000_000
        file.add("/fix", "sensor_msgs/msg/NavSatFix", fix(at, 52.5), at)
        file.add("/imu", IMU, measured(at, mounted.T @ force, mounted.T @ RATE), at)
    log = open_log(file.close())
    return log, [one for _, one in log.samples() if isinstance(one, drive.ImuSample)]


@pytest.mark.parametrize("mounted", [UPRIGHT, SIDE, UPSIDE_DOWN, TURNED])
def test_axes_that_a_static_transform_tells_are_turned_into_the_cars(
    tmp_path: Path, mounted: Array
) -> None:
    log, found = recording(tmp_path, mounted, told=mounted)
    assert len(found) == 10
    assert found[0].accel_mps2 == pytest.approx(FORCE.tolist())
    assert found[0].rate_radps == pytest.approx(RATE.tolist())
    assert "imu" in log.info.sends
    assert log.skipped == {}


@pytest.mark.parametrize(
    ("mounted", "told"),
    [(SIDE, None), (UPSIDE_DOWN, None), (SIDE, UPRIGHT), (UPRIGHT, UPSIDE_DOWN)],
)
def test_one_that_is_not_upright_is_left_out_counted_and_told(
    tmp_path: Path, mounted: Array, told: Array | None
) -> None:
    log, found = recording(tmp_path, mounted, told=told)
    assert found == []
    assert log.info.sends == ("gnss",)
    assert log.skipped == {NOT_UPRIGHT: 10}


@pytest.mark.parametrize(("tilt_deg", "kept"), [(20.0, True), (45.0, False)])
def test_a_unit_on_a_slope_is_upright(tmp_path: Path, tilt_deg: float, kept: bool) -> None:
    c, s = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    tilted = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    _, found = recording(tmp_path, tilted, told=None, force=np.array([0.0, 0.0, 9.8]))
    assert len(found) == (10 if kept else 0)


def test_a_unit_without_gravity_is_believed(tmp_path: Path) -> None:
    _, found = recording(tmp_path, UPRIGHT, told=None, force=np.array([0.4, -0.3, 0.0]))
    assert len(found) == 10
