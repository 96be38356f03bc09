"""One row with a wild time costs itself and no other."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.logs import Log, open_log
from foretwin.telemetry.logs.log import CLOCK_NOT_SET, TIME_BACKWARDS
from foretwin.telemetry.logs.one_drive import of_one_drive

S = 10**9
NOON_S = 1_772_366_400
DECLARED = """reference_point = "antenna"
[time]
column = "t"
unit = "s"
base = "utc"
[position]
frame = "wgs84"
latitude = { column = "lat", unit = "deg" }
longitude = { column = "lon", unit = "deg" }
[speed]
forward = { column = "v", unit = "m/s" }
"""


def drive(tmp_path: Path, times_s: list[float]) -> Log:
    """A table with a row at each time."""
    path = tmp_path / "drive.csv"
    rows = [f"{at_s:.1f},{52.5 + 1e-5 * n},13.4,10.0" for n, at_s in enumerate(times_s)]
    path.write_text("\n".join(["t,lat,lon,v", *rows]) + "\n")
    path.with_name("drive.csv.toml").write_text(DECLARED)
    return open_log(path)


def test_a_row_of_the_future_does_not_make_all_later_ones_late(tmp_path: Path) -> None:
    times_s = [NOON_S + 0.5 * n for n in range(100)]
    times_s[30] += 5000.0
    log = drive(tmp_path, times_s)
    assert sum(channel == "gnss" for channel, _ in log.samples()) == 99
    assert log.skipped == {TIME_BACKWARDS: 2}  # its position and its speed
    assert log.info.end_stamp_ns == log.info.start_stamp_ns + 49.5 * S


def test_rows_of_before_the_clock_was_set_are_no_part_of_the_drive(tmp_path: Path) -> None:
    receiver_s = 315_964_800.0  # 1980-01-06, where GPS begins
    log = drive(tmp_path, [0.0, receiver_s, *(NOON_S + 0.5 * n for n in range(20))])
    assert log.info.start_stamp_ns == NOON_S * S
    assert sum(channel == "gnss" for channel, _ in log.samples()) == 20
    assert log.skipped == {CLOCK_NOT_SET: 4}


def test_a_clock_that_was_never_set_is_one() -> None:
    stamps_ns = np.arange(5, dtype=np.int64) * S
    kept, refused = of_one_drive(stamps_ns, "utc")
    assert kept.tolist() == [0, 1, 2, 3, 4]
    assert not refused


def test_what_comes_late_is_put_in_order_and_what_is_below_zero_left_to_who_reads() -> None:
    stamps_ns = np.array([5, 4, 6, -1, 7, 5], dtype=np.int64) * S
    kept, refused = of_one_drive(stamps_ns, "log")
    assert kept.tolist() == [3, 1, 0, 5, 2, 4]
    assert not refused


def test_neighbours_that_changed_places_are_all_read(tmp_path: Path) -> None:
    times_s = [NOON_S + 0.5 * n for n in range(100)]
    for n in range(0, 100, 10):
        times_s[n], times_s[n + 1] = times_s[n + 1], times_s[n]
    log = drive(tmp_path, times_s)
    stamps_ns = [one.stamp_ns for channel, one in log.samples() if channel == "gnss"]
    assert stamps_ns == [round((NOON_S + 0.5 * n) * S) for n in range(100)]
    assert log.info.start_stamp_ns == NOON_S * S
    assert log.skipped == {}


def test_a_clock_that_is_ahead_for_a_row_costs_that_row_alone(tmp_path: Path) -> None:
    """And none that comes late besides."""
    times_s = [NOON_S + 0.5 * n for n in range(100)]
    times_s[50] += 20.0
    for n in range(0, 100, 10):
        times_s[n + 2], times_s[n + 3] = times_s[n + 3], times_s[n + 2]
    log = drive(tmp_path, times_s)
    assert sum(channel == "gnss" for channel, _ in log.samples()) == 99
    assert log.skipped == {TIME_BACKWARDS: 2}  # its position and its speed


@given(st.lists(st.integers(min_value=0, max_value=9), min_size=1, max_size=9))
def test_as_many_are_kept_as_rise(minutes: list[int]) -> None:
    stamps_ns = 60 * S * np.array(minutes, dtype=np.int64)
    kept, refused = of_one_drive(stamps_ns, "log")
    assert (np.diff(stamps_ns[kept]) >= 0).all()
    most = max(
        size
        for size in range(1, len(minutes) + 1)
        if any(list(some) == sorted(some) for some in itertools.combinations(minutes, size))
    )
    assert len(kept) == most
    assert refused.total() == len(minutes) - most
