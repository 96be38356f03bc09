"""nuScenes' CAN bus expansion, written as its README describes it, and a whole scene as it is."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest

from foretwin.telemetry.logs import Log, LogError, open_log
from tests.telemetry.motion_proof import MotionProof
from tests.telemetry.public_drives import public_drive

START_US = 1_531_883_549_954_657
RADIUS_M, SPEED_MPS = 60.0, 8.0


def pose(tick: int) -> dict[str, Any]:
    """On a circle to the left, speeding up a little."""
    time_s = 0.02 * tick
    speed = SPEED_MPS + 3.0 * math.sin(0.6 * time_s)
    along = SPEED_MPS * time_s + 5.0 * (1.0 - math.cos(0.6 * time_s))
    yaw = along / RADIUS_M
    x, y = 400.0 + RADIUS_M * math.sin(yaw), 1100.0 + RADIUS_M * (1.0 - math.cos(yaw))
    return {
        "utime": START_US + 20_000 * tick,
        "pos": [x, y, 0.0],
        "orientation": [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)],
        "vel": [speed, 0.0, 0.0],
        "accel": [1.8 * math.cos(0.6 * time_s), speed**2 / RADIUS_M, 9.8],
        "rotation_rate": [0.0, 0.0, speed / RADIUS_M],
    }


def scene(
    folder: Path, *, name: str = "scene-0061", located: bool = True, seconds: int = 20
) -> Path:
    folder.mkdir(exist_ok=True)
    files = {
        "pose": [pose(tick) for tick in range(50 * seconds)],
        "steeranglefeedback": [
            {"utime": START_US + 10_000 * tick, "value": 0.7} for tick in range(100 * seconds)
        ],
        "vehicle_monitor": [
            {"utime": START_US + 500_000 * tick, "gear_position": 7, "right_signal": 0,
             "left_signal": int(tick > 20 and tick % 4 > 1)} for tick in range(2 * seconds)
        ],
        "zoesensors": [{"utime": START_US, "brake_sensor": 0.17}],
    }  # fmt: skip
    for kind, messages in files.items():
        (folder / f"{name}_{kind}.json").write_text(json.dumps(messages))
    if located:
        declared = folder / f"{name}_pose.json.toml"
        declared.write_text('location = "singapore-onenorth"\n')
    return folder / f"{name}_pose.json"


def by_channel(log: Log) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return found


def test_channels_units_and_place(tmp_path: Path) -> None:
    log = open_log(scene(tmp_path))
    found = by_channel(log)

    assert {channel: len(said) for channel, said in found.items()} == {
        "gnss": 1000, "heading": 1000, "speed": 1000, "imu": 1000, "steering": 2000, "status": 40,
    }  # fmt: skip
    assert found["gnss"][0].stamp_ns == START_US * 1000
    position = found["gnss"][0].position
    assert position.lat_deg == pytest.approx(1.28821 + 1100.0 / 110_574, abs=2e-5)
    assert position.lon_deg == pytest.approx(103.784752 + 400.0 / 111_293, abs=2e-5)
    assert found["steering"][0].steering_wheel_rad == 0.7  # to the left, as the circle
    assert (found["status"][0].gear, found["status"][0].indicator) == ("drive", "off")
    # Lamps blink, indicators do not.
    assert {said.indicator for said in found["status"][23:]} == {"left"}
    assert log.info.body_from_antenna_m == (0.0, 0.0, 0.0)
    assert log.info.time_base == "utc"


def test_the_channels_tell_of_one_motion(tmp_path: Path) -> None:
    shown = MotionProof(open_log(scene(tmp_path)))
    for proof in (shown.of_speed(), shown.of_yaw_rate(), shown.of_acceleration()):
        assert proof.correlation > 0.99
        assert proof.slope == pytest.approx(1.0, abs=0.05)
        assert abs(proof.lag_s) < 0.11
    assert abs(shown.heading_offset_deg()) < 0.2


def test_a_whole_real_scene(tmp_path: Path) -> None:
    """Boston, a turn to the right: 118 m by positions, 116 m by speed."""
    folder = public_drive("nuscenes/can_bus")
    log = open_log(folder)
    shown = MotionProof(log)
    for proof in (shown.of_speed(), shown.of_yaw_rate(), shown.of_heading()):
        assert proof.correlation > 0.99
        assert proof.slope == pytest.approx(1.0, abs=0.07)
        assert abs(proof.lag_s) < 0.11
    assert shown.of_acceleration().correlation > 0.98
    assert shown.of_steering().correlation > 0.97
    assert abs(shown.heading_offset_deg()) < 1.0
    assert log.skipped == {}

    copy = shutil.copytree(folder, tmp_path / "can_bus")
    pose = copy / "scene-0103_pose.json"
    pose.write_bytes(pose.read_bytes()[:100_000])
    pose.with_name(pose.name + ".toml").write_text('location = "boston-seaport"\n')
    with pytest.raises(LogError, match=r"scene-0103_pose\.json: no list of messages: "):
        open_log(copy)


def test_the_yaw_of_a_car_that_leans(tmp_path: Path) -> None:
    path = scene(tmp_path, seconds=1)
    messages = json.loads(path.read_text())
    (cy, sy), (cr, sr) = ((math.cos(angle / 2), math.sin(angle / 2)) for angle in (1.1, 0.2))
    messages[0]["orientation"] = [cy * cr, cy * sr, sy * sr, sy * cr]  # turned, then rolled
    path.write_text(json.dumps(messages))
    assert by_channel(open_log(path))["heading"][0].yaw_rad == pytest.approx(1.1)


def test_the_map_comes_from_nuscenes_own_tables(tmp_path: Path) -> None:
    path = scene(tmp_path / "can_bus", located=False)
    with pytest.raises(
        LogError, match=r"scene-0061 .*write .*scene-0061_pose\.json\.toml with loc"
    ):
        open_log(path)
    tables = tmp_path / "v1.0-mini"
    tables.mkdir()
    (tables / "scene.json").write_text(json.dumps([{"name": "scene-0061", "log_token": "a"}]))
    (tables / "log.json").write_text(json.dumps([{"token": "a", "location": "boston-seaport"}]))
    for named in (path, tmp_path / "can_bus", path.with_name("scene-0061_zoesensors.json")):
        assert by_channel(open_log(named))["gnss"][0].position.lat_deg == pytest.approx(
            42.35, abs=0.01
        )


def test_a_folder_of_several_scenes_asks_which(tmp_path: Path) -> None:
    scene(tmp_path)
    scene(tmp_path, name="scene-0103")
    with pytest.raises(LogError, match=r"holds 2 scenes; name one, such as .*scene-0061_pose"):
        open_log(tmp_path)


def test_damage_is_counted_or_told_in_a_line(tmp_path: Path) -> None:
    path = scene(tmp_path)
    messages = json.loads(path.read_text())
    del messages[3]["pos"]
    messages[4]["vel"] = ["fast", 0, 0]
    messages[5]["accel"] = [0.0]
    messages[6]["utime"] = 1e30
    path.write_text(json.dumps(messages))
    log = open_log(path)
    assert len(by_channel(log)["gnss"]) == 996
    assert log.skipped == {"unreadable row": 4}

    path.write_text(path.read_text()[:5000])
    with pytest.raises(LogError, match=r"scene-0061_pose\.json: no list of messages: "):
        open_log(path)
    path.unlink()
    with pytest.raises(LogError, match=r"scene-0061_pose\.json: no poses, so no positions"):
        open_log(
            tmp_path / "scene-0061_zoesensors.json", declaration=tmp_path / f"{path.name}.toml"
        )
