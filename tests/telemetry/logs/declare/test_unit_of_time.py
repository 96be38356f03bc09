"""A table whose clock may be in seconds or in milliseconds, and moves as a car does by either."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs.declare.choice import Chosen, OpenQuestion
from foretwin.telemetry.logs.declare.clock import ClockColumn
from foretwin.telemetry.logs.declare.motion import motion_of
from foretwin.telemetry.logs.declare.proposal import propose
from foretwin.telemetry.logs.declare.readings import Reading, unit_of_time
from foretwin.telemetry.logs.log import LogError
from tests.telemetry.logs.declare.test_propose import country

COVERS = ("foretwin.telemetry.logs.declare.readings",)


def straight_table(folder: Path) -> Path:
    """Write an all but straight minute at 100 Hz, by a clock in ms, with a heading in radians.

    In seconds that clock makes a drive as well, of which the heading is the latitude.
    """
    time_s = np.arange(0.0, 60.0, 0.01)
    held = np.repeat(np.arange(0, len(time_s), 10), 10)
    swing = 0.03 * np.sin(time_s / 4.0) + 0.02 * np.sin(time_s / 1.5)
    speed = 20.0 + 4.0 * np.sin(time_s / 7.0)
    metre = 0.01 / 6.371e6
    east, north = np.cumsum(speed * np.cos(swing)) * metre, np.cumsum(speed * np.sin(swing)) * metre
    heading = 0.1 - swing[held]
    columns = (heading, 4_321_632 + time_s * 1e3, -2.1 + east[held] / 0.8, 0.6435 + north[held])
    path = folder / "straight.csv"
    path.write_text(
        "".join(f"{a:.6f},{b:.3f},{c:.12f},{d:.12f}\n" for a, b, c, d in zip(*columns, strict=True))
    )
    return path


def test_positions_of_a_clock_read_a_thousand_times_too_slowly_tell_no_motion() -> None:
    time_s = np.arange(0.0, 30.0, 0.1)
    xy_m = np.stack([12.0 * time_s, 0.1 * time_s**2], axis=1)

    assert motion_of(time_s, xy_m) is not None
    assert motion_of(time_s * 100.0, xy_m * 100.0) is not None
    assert motion_of(time_s * 250.0, xy_m * 250.0) is None  # 25 s apart
    # Smoothing them over 400 s on a grid of 50 ms would take most of a minute.
    assert motion_of(time_s * 1000.0, xy_m * 1000.0) is None


def test_a_heading_is_no_latitude_by_a_clock_that_is_a_thousand_times_slower(
    tmp_path: Path,
) -> None:
    found = propose(straight_table(tmp_path), country_of=country)
    assert found.declaration is not None
    assert (found.declaration.time.unit, found.question) == ("ms", None)
    place = found.declaration.position
    assert place is not None
    assert (getattr(place.latitude, "column", ""), place.frame) == ("c4", "wgs84")


def reading(unit: str, frame: str) -> Reading:
    clock = ClockColumn("t", unit, "log", np.arange(3.0), False, "")
    return Reading(clock, frame, Chosen(None, "", OpenQuestion("origin", "where?")), None)


def test_a_unit_of_time_that_nothing_tells_is_asked_for() -> None:
    asked = unit_of_time([reading("s", "wgs84"), reading("ms", "wgs84"), reading("us", "local")])
    assert asked is not None
    assert (asked.key, asked.choices) == ("time_unit", ("s", "ms"))
    assert unit_of_time([reading("s", "wgs84"), reading("ms", "local")]) is None
    assert unit_of_time([reading("s", "wgs84"), reading("s", "wgs84")]) is None


def test_a_unit_of_time_can_be_answered(tmp_path: Path) -> None:
    path = straight_table(tmp_path)
    found = propose(path, country_of=country, answers={"time_unit": "ms"})
    assert found.declaration is not None
    assert found.declaration.time.unit == "ms"
    with pytest.raises(LogError, match="time_unit=us: no column is a time in that"):
        propose(path, answers={"time_unit": "us"})
    with pytest.raises(LogError, match="time_unit=days1900: no column is a time in that"):
        propose(path, answers={"time_unit": "days1900"})


def test_a_time_that_grows_by_one_is_taken_where_its_unit_is_answered(tmp_path: Path) -> None:
    """Seconds of the week beside positions alone, as of a receiver's own software."""
    time_s = np.arange(300)
    yaw = np.cumsum(0.05 * np.sin(time_s / 15.0))
    lat = 48.1 + np.cumsum(9.0 * np.sin(yaw)) / 111_195.0
    lon = 11.6 + np.cumsum(9.0 * np.cos(yaw)) / 111_195.0 / np.cos(np.radians(48.1))
    rows = [
        f"{456_250 + at},{one:.8f},{other:.8f}"
        for at, one, other in zip(time_s, lat, lon, strict=True)
    ]
    path = tmp_path / "week.csv"
    path.write_text("\n".join(["sow,lat,lon", *rows, ""]))
    with pytest.raises(LogError, match=r"counts rows.*--answer time_unit=s"):
        propose(path)
    found = propose(path, answers={"time_unit": "s"}).declaration
    assert found is not None
    assert (found.time.column, found.time.unit) == ("sow", "s")
