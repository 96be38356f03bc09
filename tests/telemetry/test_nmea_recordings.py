"""NMEA on a real drive, and on copies of it that a receiver, a cable or a disk could have left."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.logs import open_log
from tests.telemetry.motion_proof import MotionProof
from tests.telemetry.public_drives import public_drive

DRIVE = "mountain-view-nmea/MTV.Local1.ublox-F9K.20200206-181434.nmea"
SURVEY = "mountain-view-nmea/MTV.Local1.SPAN.20200206-181434.gga"
POSITIONS = 1653


def test_units_signs_and_times() -> None:
    shown = MotionProof(open_log(public_drive(DRIVE)))

    speed, heading = shown.of_speed(), shown.of_heading()
    assert speed.correlation > 0.995
    assert speed.slope == pytest.approx(1.0, abs=0.01)
    assert abs(speed.lag_s) < 0.11
    assert heading.correlation > 0.97
    assert heading.slope == pytest.approx(1.0, abs=0.05)
    assert abs(shown.heading_offset_deg()) < 0.5
    assert len(shown.found["gnss"]) == POSITIONS


def test_no_position_is_lost_where_gga_comes_once_in_four(tmp_path: Path) -> None:
    lines = public_drive(DRIVE).read_text(errors="replace").splitlines(keepends=True)
    ggas = 0
    kept = []
    for line in lines:
        ggas += "GNGGA" in line
        if "GNGGA" not in line or ggas % 4 == 1:
            kept.append(line)
    (tmp_path / "quarter.nmea").write_text("".join(kept))
    said = open_log(tmp_path / "quarter.nmea").samples()
    fixes = [message for _, message in said if isinstance(message, GnssFix)]

    assert len(fixes) == POSITIONS
    # After gaps of up to 40 s the last HDOP says nothing any more.
    assert all(fix.std_m is not None for fix in fixes)
    assert max(abs(fix.position.alt_m) for fix in fixes) < 60.0


def test_a_survey_receivers_gga_alone_counts_from_zero_or_from_a_declared_day(
    tmp_path: Path,
) -> None:
    path = tmp_path / "span.gga"
    text = public_drive(SURVEY).read_text()
    path.write_text("".join(line for line in text.splitlines(keepends=True) if "GGA" in line))
    shown = MotionProof(open_log(path))
    assert len(shown.found["gnss"]) == 1748
    assert shown.found["gnss"][0].stamp_ns == 0
    (tmp_path / "day.toml").write_text("date = 2020-02-07\n")
    first = next(open_log(path, declaration=tmp_path / "day.toml").samples())[1]
    assert first.stamp_ns == 1_581_041_611 * 10**9  # type: ignore[attr-defined]


def test_damaged_bytes_cost_their_sentences_alone_and_are_counted(tmp_path: Path) -> None:
    data = bytearray(public_drive(DRIVE).read_bytes())
    chance = random.Random(5)
    for _ in range(200):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    (tmp_path / "noisy.nmea").write_bytes(data[: len(data) - 20_000])
    log = open_log(tmp_path / "noisy.nmea")
    fixes = sum(channel == "gnss" for channel, _ in log.samples())
    # GSV make up most of a log: of 200 damages some twenty hit what is read.
    assert 5 < log.skipped["checksum wrong"] < 60
    assert POSITIONS - 60 < fixes < POSITIONS
