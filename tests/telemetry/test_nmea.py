"""NMEA-0183: knots, degrees and minutes, true north, midnight, checksums."""

from __future__ import annotations

import functools
import math
import operator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.logs import Log, LogError, open_log
from foretwin.telemetry.logs.log import LAST_LINE_OPEN, UNREADABLE_ROW
from foretwin.telemetry.logs.nmea_sentences import (
    CHECKSUM_WRONG,
    Sentence,
    sentence_of,
    yaw_rad_of,
)

COVERS = (
    "foretwin.telemetry.logs.nmea",
    "foretwin.telemetry.logs.nmea_positions",
    "foretwin.telemetry.logs.nmea_sentences",
)

NOON_NS = 1_772_366_400 * 10**9
"""2026-03-01T12:00:00Z."""


def line(body: str) -> str:
    return f"${body}*{functools.reduce(operator.xor, body.encode(), 0):02X}\r\n"


def rmc(time: str, date: str, *, knots: str = "10.0", course: str = "90.0") -> str:
    return line(f"GNRMC,{time},A,5230.6000,N,01323.4000,E,{knots},{course},{date},,,A")


def gga(time: str, *, quality: int = 4, half: str = "S", lon: str = "W") -> str:
    return line(f"GPGGA,{time},5230.6000,{half},01323.4000,{lon},{quality},12,0.6,34.5,M,44.5,M,,")


def opened(tmp_path: Path, *lines: str) -> tuple[Log, dict[str, list[Any]]]:
    path = tmp_path / "drive.nmea"
    path.write_text("".join(lines))
    log = open_log(path)
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return log, found


def test_a_last_line_that_was_cut_before_its_checksum_is_left_out(tmp_path: Path) -> None:
    """Of an altitude of 545.4 m there stood 54 m."""
    cut = gga("120001.00").partition("34.5")[0] + "3"
    log, found = opened(tmp_path, gga("120000.00"), cut)
    assert [fix.position.alt_m for fix in found["gnss"]] == [79.0]
    assert log.skipped == {LAST_LINE_OPEN: 1}
    log, found = opened(tmp_path, gga("120000.00"), gga("120001.00").rstrip())
    assert (len(found["gnss"]), log.skipped) == (2, {})


def test_lines_that_were_blanked_are_counted(tmp_path: Path) -> None:
    """The line break went with them: what stands behind is read."""
    log, found = opened(
        tmp_path, gga("120000.00"), gga("120001.00")[:30], "\0" * 200, gga("120004.00")
    )
    assert [fix.stamp_ns for fix in found["gnss"]] == [0, 4 * 10**9]
    assert log.skipped == {UNREADABLE_ROW: 1}


def test_a_log_that_begins_with_satellites_is_known_by_any_sentence(tmp_path: Path) -> None:
    """As GnssLogger writes them: what kind, the sentence, its time in ms."""
    satellites = f"NMEA,{line('GPGSV,2,1,08,03,14,263,23').rstrip()},1713027213567\n"
    _log, found = opened(tmp_path, *[satellites] * 40, gga("120000.00"))
    assert len(found["gnss"]) == 1
    with pytest.raises(LogError, match="no known log"):
        opened(tmp_path, *[satellites.replace("263", "264")] * 40)


def test_the_example_of_the_standard_has_its_checksum() -> None:
    told = "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47"
    sentence = sentence_of(told)
    assert isinstance(sentence, Sentence)
    assert sentence.fields[1] == "4807.038"
    assert sentence_of(told.replace("545.4", "545.5")) == CHECKSUM_WRONG
    assert sentence_of("$GPGSV,3,1,11*7F") is None


def test_a_sentence_cut_off_by_the_next_does_not_take_it_along() -> None:
    sentence = sentence_of("$GPRMC,1200" + line("HEHDT,1.0,T"))
    assert sentence == Sentence("HDT", ["1.0", "T"])


def test_minutes_knots_and_course(tmp_path: Path) -> None:
    log, found = opened(tmp_path, rmc("120000.00", "010326"), rmc("120000.25", "010326"))
    assert [fix.stamp_ns for fix in found["gnss"]] == [NOON_NS, NOON_NS + 250_000_000]
    assert found["gnss"][0].position.lat_deg == pytest.approx(52.51)
    assert found["gnss"][0].position.lon_deg == pytest.approx(13.39)
    assert found["speed"][0].speed_mps == pytest.approx(5.144444, abs=1e-6)
    assert found["heading"][0].yaw_rad == pytest.approx(0.0)
    assert (log.info.time_base, log.info.reference_point) == ("utc", "antenna")
    assert set(log.info.sends) == {"gnss", "speed", "heading"}


@given(st.floats(0.0, 359.999))
def test_degrees_clockwise_from_north_become_yaw_from_east(course_deg: float) -> None:
    yaw = yaw_rad_of(course_deg)
    assert -math.pi <= yaw <= math.pi
    # East and north of a unit vector, both ways.
    assert math.cos(yaw) == pytest.approx(math.sin(math.radians(course_deg)), abs=1e-9)
    assert math.sin(yaw) == pytest.approx(math.cos(math.radians(course_deg)), abs=1e-9)


def test_gga_is_preferred_and_ellipsoidal_and_south_and_west_are_negative(tmp_path: Path) -> None:
    _, found = opened(tmp_path, gga("120000.00"), rmc("120000.00", "010326"), gga("120001.00"))
    assert [fix.stamp_ns for fix in found["gnss"]] == [NOON_NS, NOON_NS + 10**9]
    position = found["gnss"][0].position
    assert (position.lat_deg, position.lon_deg) == (pytest.approx(-52.51), pytest.approx(-13.39))
    assert position.alt_m == pytest.approx(79.0)


@pytest.mark.parametrize(("quality", "std_m"), [(1, 1.26), (2, 1.02), (4, 0.009), (5, 0.18)])
def test_how_far_a_fix_is_off_comes_from_its_quality_and_hdop(
    tmp_path: Path, quality: int, std_m: float
) -> None:
    _, found = opened(tmp_path, rmc("120000", "010326"), gga("120000", quality=quality))
    assert found["gnss"][0].std_m == pytest.approx(std_m)


def test_a_compass_is_preferred_to_a_course(tmp_path: Path) -> None:
    _, found = opened(tmp_path, rmc("120000", "010326"), line("HEHDT,0.0,T"))
    assert [one.yaw_rad for one in found["heading"]] == [pytest.approx(0.5 * math.pi)]
    assert found["heading"][0].stamp_ns == NOON_NS


def test_a_course_at_a_standstill_is_none(tmp_path: Path) -> None:
    _, found = opened(tmp_path, rmc("120000", "010326", knots="0.1"))
    assert "heading" not in found
    assert found["speed"][0].speed_mps == pytest.approx(0.0514, abs=1e-3)


def test_vtg_gives_the_speed_where_there_is_no_rmc(tmp_path: Path) -> None:
    _, found = opened(
        tmp_path,
        line("GPZDA,120000.00,01,03,2026,00,00"),
        gga("120000.00"),
        line("GPVTG,180.0,T,,M,,N,36.0,K,A"),
    )
    assert found["speed"][0].speed_mps == pytest.approx(10.0)
    assert found["heading"][0].yaw_rad == pytest.approx(-0.5 * math.pi)


def test_vtg_without_a_speed_is_no_fix(tmp_path: Path) -> None:
    log, found = opened(
        tmp_path,
        line("GPZDA,120000.00,01,03,2026,00,00"),
        gga("120000.00"),
        line("GPVTG,180.0,T,,M,,N,,K,A"),
    )
    assert "speed" not in found
    assert log.skipped == {"receiver without fix": 1}


@pytest.mark.parametrize("dated", [True, False])
def test_midnight_begins_the_next_day(tmp_path: Path, dated: bool) -> None:
    day = rmc("235959.50", "280226")
    after = rmc("000000.50", "010326") if dated else gga("000000.50")
    _, found = opened(tmp_path, day, gga("235959.50"), after, gga("000000.50"))
    first, second = (fix.stamp_ns for fix in found["gnss"])
    assert first == NOON_NS - 12 * 3600 * 10**9 - 500_000_000
    assert second - first == 10**9


@pytest.mark.parametrize("dated", [True, False])
def test_a_sentence_of_before_midnight_that_comes_late_begins_no_day(
    tmp_path: Path, dated: bool
) -> None:
    day = rmc("235959.00", "280226")
    after = rmc("000000.25", "010326") if dated else gga("000000.25")
    _, found = opened(tmp_path, day, gga("235959.00"), after, gga("235959.75"), gga("000000.50"))
    first_ns = NOON_NS - 12 * 3600 * 10**9 - 10**9
    after_ms = [(fix.stamp_ns - first_ns) // 10**6 for fix in found["gnss"]]
    assert after_ms == [0, 750, 1250, 1500]


def test_times_before_the_first_date_are_of_the_day_before_where_midnight_lies_between(
    tmp_path: Path,
) -> None:
    _, found = opened(tmp_path, gga("235959.50"), gga("000000.50"), rmc("000000.75", "010326"))
    assert found["gnss"][1].stamp_ns - found["gnss"][0].stamp_ns == 10**9
    assert found["speed"][0].stamp_ns - found["gnss"][1].stamp_ns == 250_000_000


def test_a_year_beyond_all_calendars_is_an_unreadable_row(tmp_path: Path) -> None:
    beyond = line(f"GPZDA,120000.00,01,03,{10**12},00,00")
    log, found = opened(tmp_path, beyond, rmc("120000", "010326"))
    assert len(found["gnss"]) == 1
    assert log.skipped == {"unreadable row": 1}


def test_what_is_refused_is_counted(tmp_path: Path) -> None:
    broken = rmc("120001", "010326").replace("5230", "5231")
    log, found = opened(
        tmp_path,
        line("GPVTG,90.0,T,88.0,M,10.0,N,18.5,K,A"),
        rmc("120000", "010326"),
        broken,
        line("GPRMC,120002,V,,,,,,,010326,,,N"),
        line("GPRMC,120003,A,5270.0000,N,01323.4,E,1.0,1.0,010326,,,A"),
        gga("126000"),
        gga("120004", quality=0),
        gga("120005", quality=8),
        "something else\n$GPXXX,1,2\n",
        gga("120006"),
    )
    assert log.skipped == {
        "sentence before any time": 1,
        "checksum wrong": 1,
        "receiver without fix": 3,
        "unreadable row": 2,
    }
    assert [fix.stamp_ns for fix in found["gnss"]] == [NOON_NS, NOON_NS + 6 * 10**9]


def test_the_positions_of_rmc_fill_what_gga_leaves_out(tmp_path: Path) -> None:
    """As receivers log that tell RMC four times as often as GGA."""
    lines = []
    for tick in range(8):
        time = f"12000{tick // 4}.{25 * (tick % 4):02d}"
        lines += [rmc(time, "010326"), *([gga(time, half="N", lon="E")] if tick % 4 == 0 else [])]
    log, found = opened(tmp_path, *lines)

    stamps = [fix.stamp_ns for fix in found["gnss"]]
    assert stamps == [NOON_NS + tick * 250_000_000 for tick in range(8)]
    assert not log.skipped
    # Between two GGAs altitude and HDOP are the last one's, the quality that of RMC's mode: alone.
    assert {fix.position.alt_m for fix in found["gnss"]} == {34.5 + 44.5}
    assert [fix.std_m for fix in found["gnss"][:3]] == pytest.approx([0.009, 1.26, 1.26])


def test_without_an_hdop_of_late_a_receiver_alone_is_one_all_the_same(tmp_path: Path) -> None:
    _, found = opened(tmp_path, rmc("120000", "010326"), gga("120000"), rmc("120011", "010326"))
    assert [fix.std_m for fix in found["gnss"]] == pytest.approx([0.009, 2.1])
    _, found = opened(tmp_path, line("GPRMC,120000,A,5230.6,N,01323.4,E,9.0,84.4,010326,,"))
    assert [fix.std_m for fix in found["gnss"]] == [2.1]


def test_a_log_without_a_date_counts_from_its_first_time_and_says_so(tmp_path: Path) -> None:
    log, found = opened(tmp_path, gga("235959.50"), gga("000000.50"))
    assert [fix.stamp_ns for fix in found["gnss"]] == [0, 10**9]
    assert (log.info.time_base, log.info.source) == ("log", "drive.nmea (date unknown)")


def test_the_date_can_be_declared(tmp_path: Path) -> None:
    (tmp_path / "drive.nmea.toml").write_text(
        "date = 2026-03-01\nbody_from_antenna_m = [1.0, 0.0, 1.5]\n"
    )
    log, found = opened(tmp_path, gga("120000.00"))
    assert found["gnss"][0].stamp_ns == NOON_NS
    assert (log.info.time_base, log.info.source) == ("utc", "drive.nmea")
    assert log.info.body_from_antenna_m == (1.0, 0.0, 1.5)
    with pytest.raises(LogError, match=r"drive\.nmea: .*2026-03-02, and 2026-03-01 is declared"):
        opened(tmp_path, rmc("120000", "020326"))
    (tmp_path / "drive.nmea.toml").write_text("date = 7\n")
    with pytest.raises(LogError, match=r"drive\.nmea\.toml: .*date"):
        opened(tmp_path, gga("120000.00"))


def test_a_log_without_a_time_or_a_fix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"drive\.nmea: no RMC, GGA or ZDA sentence with a time"):
        opened(tmp_path, line("HEHDT,12.0,T"))
    with pytest.raises(LogError, match=r"drive\.nmea: no RMC or GGA sentence with a fix"):
        opened(tmp_path, gga("120000", quality=0), line("GPZDA,120000,01,03,2026,00,00"))
