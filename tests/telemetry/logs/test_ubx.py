"""u-blox UBX: NAV-PVT by the interface description, among other messages and damage."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from foretwin.telemetry.logs import Log, LogError, open_log
from tests.telemetry.motion_proof import MotionProof
from tests.telemetry.public_drives import public_drive
from tests.telemetry.test_nmea import rmc

NOON_NS = 1_772_366_400 * 10**9
"""2026-03-01T12:00:00Z."""


def frame(kind: bytes, payload: bytes) -> bytes:
    body = kind + struct.pack("<H", len(payload)) + payload
    first = second = 0
    for byte in body:
        first, second = (first + byte) & 0xFF, (second + first + byte) & 0xFF
    return b"\xb5\x62" + body + bytes((first, second))


def pvt(
    second: int = 0, *, nano: int = 0, fix: int = 3, flags: int = 1, valid: int = 3,
    speed_mmps: int = 10_000, course: int = 9_000_000, vehicle: int = 0, old: bool = False,
    h_acc: int = 1200, flags3: int = 0,
) -> bytes:  # fmt: skip
    payload = struct.pack(
        "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHHi", 0, 2026, 3, 1, 12, 0, second, valid, 30, nano, fix,
        flags, 0, 12, 133_900_000, 525_100_000, 79_000, 34_500, h_acc, 1500, 0, 0, 0,
        speed_mmps, course, 0, 0, 120, flags3, 0,
    )  # fmt: skip
    return frame(b"\x01\x07", payload if old else payload + struct.pack("<ihH", vehicle, 0, 0))


def opened(tmp_path: Path, *parts: bytes) -> tuple[Log, dict[str, list[Any]]]:
    path = tmp_path / "drive.ubx"
    path.write_bytes(b"".join(parts))
    log = open_log(path)
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return log, found


@pytest.mark.parametrize("old", [False, True])
def test_units_of_nav_pvt(tmp_path: Path, old: bool) -> None:
    log, found = opened(tmp_path, pvt(old=old), pvt(1, nano=-250_000_000, old=old))

    fix = found["gnss"][0]
    assert [one.stamp_ns for one in found["gnss"]] == [NOON_NS, NOON_NS + 750_000_000]
    assert (fix.position.lat_deg, fix.position.lon_deg) == (
        pytest.approx(52.51),
        pytest.approx(13.39),
    )
    assert (fix.position.alt_m, fix.std_m) == (pytest.approx(79.0), pytest.approx(1.2))
    assert found["speed"][0].speed_mps == pytest.approx(10.0)
    assert found["heading"][0].yaw_rad == pytest.approx(0.0)  # eastwards
    assert (log.info.time_base, log.info.reference_point) == ("utc", "antenna")


def test_the_heading_of_the_vehicle_signs_the_speed(tmp_path: Path) -> None:
    known = 0b10_0001
    _, found = opened(
        tmp_path, pvt(flags=known, vehicle=8_000_000), pvt(1, flags=known, vehicle=27_000_000)
    )
    assert [one.speed_mps for one in found["speed"]] == pytest.approx([10.0, -10.0], abs=1e-9)
    assert [one.yaw_rad for one in found["heading"]] == pytest.approx(
        [math.radians(10.0), -math.pi]
    )


def test_a_course_at_a_standstill_is_none(tmp_path: Path) -> None:
    _, found = opened(tmp_path, pvt(speed_mmps=100))
    assert "heading" not in found


def test_other_messages_and_damage_between_cost_no_position(tmp_path: Path) -> None:
    broken = bytearray(pvt(2))
    broken[40] ^= 1
    raw = frame(b"\x02\x15", b"\xb5\x62\x01\x07" + bytes(2000))
    cut = pvt(3)[:50]
    log, found = opened(
        tmp_path, rmc("120000", "010326").encode(), raw, pvt(0), bytes(broken),
        frame(b"\x02\x15", bytes(2000))[:900], pvt(1),
        b"\xd3\x00\x13" + bytes(22), cut, pvt(4), raw, pvt(5)[:60],
    )  # fmt: skip
    assert [one.stamp_ns - NOON_NS for one in found["gnss"]] == [0, 10**9, 4 * 10**9]
    assert log.skipped == {"checksum wrong": 2, "file cut short": 1}


def test_a_file_cut_off_within_another_message_says_so(tmp_path: Path) -> None:
    raw = frame(b"\x02\x15", bytes(2000))
    for end in (3, 7, 1200):
        log, found = opened(tmp_path, pvt(0), raw, pvt(1), raw[:end])
        assert len(found["gnss"]) == 2
        assert log.skipped == {"file cut short": 1}
        log, _ = opened(tmp_path, pvt(0), rmc("120000", "010326").encode(), raw[:end])
        assert log.skipped == {"file cut short": 1}


def test_positions_that_stand_in_nmea_alone_are_read_too(tmp_path: Path) -> None:
    raw = frame(b"\x02\x15", bytes(range(256)) * 8)
    log, found = opened(tmp_path, raw, rmc("120000", "010326").encode(), raw, raw)
    assert [one.stamp_ns for one in found["gnss"]] == [NOON_NS]
    assert not log.skipped


def test_what_is_no_fix_is_counted(tmp_path: Path) -> None:
    log, _ = opened(
        tmp_path, pvt(0), pvt(1, fix=0), pvt(2, flags=0), pvt(3, fix=5), pvt(4, valid=1)
    )
    assert log.skipped == {"receiver without fix": 3, "receiver without time": 1}


def test_a_place_that_the_receiver_calls_invalid_is_no_fix(tmp_path: Path) -> None:
    log, found = opened(tmp_path, pvt(0), pvt(1, flags3=1), pvt(2, flags3=2))
    assert [one.stamp_ns - NOON_NS for one in found["gnss"]] == [0, 2 * 10**9]
    assert log.skipped == {"receiver without fix": 1}
    _, found = opened(tmp_path, pvt(0, flags3=1, old=True))  # where it stood for nothing
    assert len(found["gnss"]) == 1


@pytest.mark.parametrize("h_acc", [0xFFFF_FFFF, 0])
def test_an_accuracy_that_is_not_known_is_none(tmp_path: Path, h_acc: int) -> None:
    _, found = opened(tmp_path, pvt(0, h_acc=h_acc), pvt(1))
    assert [one.std_m for one in found["gnss"]] == [None, pytest.approx(1.2)]


def test_a_log_without_positions_is_told_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"drive\.ubx: no NAV-PVT message in it; .*UBX-NAV-PVT"):
        opened(tmp_path, frame(b"\x02\x15", bytes(100)))
    with pytest.raises(LogError, match=r"no NAV-PVT with a fix \(1 x receiver without fix\)"):
        opened(tmp_path, pvt(fix=0))


def test_a_real_walk_of_boulder_and_half_of_it(tmp_path: Path) -> None:
    """536 positions, RTK; on foot, so positions tell the course roughly."""
    path = public_drive("boulder-walk-ubx/gnss_1730.ubx")
    speed = MotionProof(open_log(path)).of_speed()
    assert speed.correlation > 0.99
    assert speed.slope == pytest.approx(1.0, abs=0.02)
    assert abs(speed.lag_s) < 0.11

    data = bytearray(path.read_bytes())
    del data[data.find(b"\xb5\x62\x02\x15", 690_000) + 500 :]
    data[300_000:300_400] = bytes(400)
    (tmp_path / "half.ubx").write_bytes(data)
    log = open_log(tmp_path / "half.ubx")
    assert 200 < sum(channel == "gnss" for channel, _ in log.samples()) < 260
    assert log.skipped["file cut short"] == 1
