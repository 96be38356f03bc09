"""openpilot's logs, as Cap'n Proto's own library wrote them (tests/data/comma), and a real qlog."""

from __future__ import annotations

import bz2
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard

from foretwin.telemetry.logs import Log, LogError, open_log
from tests.telemetry.motion_proof import MotionProof
from tests.telemetry.public_drives import public_drive

LOGS = Path(__file__).parents[2] / "data" / "comma"


def by_channel(log: Log) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return found


def test_messages_of_today() -> None:
    log = open_log(LOGS / "circle--rlog.bz2")
    found = by_channel(log)

    # The receiver outside the telephone is taken, from its first fix on.
    assert len(found["gnss"]) == 197
    assert log.skipped == {"receiver without fix": 3}
    assert found["gnss"][0].position.lat_deg == pytest.approx(52.5, abs=1e-3)
    assert found["gnss"][0].std_m == 1.5
    assert found["gnss"][0].stamp_ns == 10**12 + 300_000_000 + 1000
    assert found["steering"][0].steering_wheel_rad == pytest.approx(math.radians(30.0))
    assert {one.gear for one in found["status"]} == {"drive"}
    assert [one.indicator for one in found["status"]] == ["off"] * 201 + ["left"] * 199
    assert log.info.time_base == "boot"
    assert set(log.info.sends) == set(found)


def test_units_signs_and_axes() -> None:
    shown = MotionProof(open_log(LOGS / "circle--rlog.bz2"))
    for proof in (shown.of_speed(), shown.of_yaw_rate(), shown.of_acceleration()):
        assert proof.correlation > 0.99
        assert proof.slope == pytest.approx(1.0, abs=0.05)
        assert abs(proof.lag_s) < 0.11
    assert abs(shown.heading_offset_deg()) < 0.3
    assert shown.found["imu"][0].accel_mps2[2] == pytest.approx(9.8)
    assert shown.found["imu"][0].accel_mps2[1] > 0.0  # a turn to the left pushes to the left


def test_a_gyroscope_alone_is_counted_and_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """In qlogs of real cars the accelerometer is told at other times than the gyroscope."""
    monkeypatch.setattr("foretwin.telemetry.logs.comma_log._FRESH_NS", -1)
    log = open_log(LOGS / "before--qlog.bz2")
    assert "imu" not in by_channel(log)
    assert log.skipped == {"gyroscope without accelerometer": 400}


def test_messages_of_2018() -> None:
    found = by_channel(open_log(LOGS / "before--qlog.bz2"))
    assert {channel: len(said) for channel, said in found.items()} == {
        "gnss": 400, "heading": 400, "imu": 400,
    }  # fmt: skip
    assert found["gnss"][0].std_m is None
    assert found["imu"][0].rate_radps[2] == pytest.approx(8.0 / 60.0)


@pytest.mark.parametrize("name", ["qlog", "rlog.zst", "a1b2--2024-01-01--12-00-00--3--rlog.bz2"])
def test_plain_packed_and_long_names(tmp_path: Path, name: str) -> None:
    data = bz2.decompress((LOGS / "before--qlog.bz2").read_bytes())
    path = tmp_path / name
    if name.endswith(".zst"):
        data = zstandard.compress(data)
    path.write_bytes(bz2.compress(data) if name.endswith(".bz2") else data)
    assert len(by_channel(open_log(path))["gnss"]) == 400


def test_a_log_that_was_cut_off_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = (LOGS / "circle--rlog.bz2").read_bytes()
    plain = bz2.decompress(whole)
    for name, data in {
        "rlog": plain[: len(plain) // 2 + 3],
        "rlog.zst": (packed := zstandard.compress(plain))[: len(packed) * 9 // 10],
    }.items():
        (tmp_path / name).write_bytes(data)
        log = open_log(tmp_path / name)
        assert 50 < len(by_channel(log)["gnss"]) < 190
        assert log.skipped["file cut short"] == 1


def test_what_is_no_log_is_told_in_a_line(tmp_path: Path) -> None:
    for data in (
        b"nothing of the kind",
        bytes(64),
        b"BZh9" + bytes(50),
        b"\x28\xb5\x2f\xfd" + bytes(9),
    ):
        (tmp_path / "rlog").write_bytes(data)
        with pytest.raises(LogError, match=r"rlog: no gpsLocation with a fix in it"):
            open_log(tmp_path / "rlog")


REAL = "openpilot-demo/qlog.bz2"


def test_a_real_drive_on_a_motorway(tmp_path: Path) -> None:
    """One minute at 21 to 29 m/s, all but straight, with positions in its last 20 s.

    So steady a speed proves a unit by the way alone; signs and axes are proved by sensors.
    """
    log = open_log(public_drive(REAL))
    found = by_channel(log)
    assert len(found["gnss"]) == len(found["heading"]) == 20
    assert log.skipped == {"receiver without fix": 23, "gyroscope without accelerometer": 38}
    shown = MotionProof(log)
    # The receiver's first six fixes come without altitude, and the seventh leaps.
    known = np.isfinite(shown.speed.values) & (shown.speed.time_s > 7.0)
    told = np.interp(
        shown.speed.time_s[known],
        shown.seconds("speed"),
        [one.speed_mps for one in found["speed"]],
    )
    assert shown.speed.values[known].mean() / told.mean() == pytest.approx(1.0, abs=0.01)
    assert abs(shown.heading_offset_deg()) < 1.0
    force, rate = (
        np.array([getattr(one, name) for one in found["imu"]])
        for name in ("accel_mps2", "rate_radps")
    )
    assert force[:, 2].mean() == pytest.approx(9.8, abs=0.05)

    def at_imu(channel: str, values: list[float]) -> np.ndarray:
        return np.interp(shown.seconds("imu"), shown.seconds(channel), values)

    speed = [one.speed_mps for one in found["speed"]]
    wheel = at_imu("steering", [one.steering_wheel_rad for one in found["steering"]])
    turning = wheel * at_imu("speed", speed)
    assert np.corrcoef(rate[:, 2], turning)[0, 1] > 0.8
    assert 1.0 / np.polyfit(turning, rate[:, 2], 1)[0] == pytest.approx(77.0, abs=10.0)
    gained = np.convolve(np.gradient(speed, shown.seconds("speed")), np.ones(10) / 10, "same")
    assert np.corrcoef(force[:, 0], at_imu("speed", gained.tolist()))[0, 1] > 0.75

    packed = public_drive(REAL).read_bytes()
    (tmp_path / "qlog.bz2").write_bytes(packed[: len(packed) * 9 // 10])
    cut = open_log(tmp_path / "qlog.bz2")
    assert 0 < len(by_channel(cut)["gnss"]) < 20
    assert cut.skipped["file cut short"] == 1
