"""A column of times is known by its steps and its zero, in whatever unit it counts."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs.declare.clock import clocks_of
from foretwin.telemetry.logs.declare.layout import TextLayout
from foretwin.telemetry.logs.declare.loose_table import LooseTable, TimeTexts
from foretwin.telemetry.logs.units import TIME_NS

COMMAS = TextLayout(",", ".", True, 0, 1)
SPRING_S = 1_523_201_497.0


@pytest.mark.parametrize("unit", list(TIME_NS))
@pytest.mark.parametrize("hz", [1.0, 14.3, 66.0, 100.0])
@pytest.mark.parametrize(("zero_s", "base"), [(SPRING_S, "utc"), (0.0, "log"), (5_000.0, "boot")])
def test_a_clock_is_found_in_its_unit(unit: str, hz: float, zero_s: float, base: str) -> None:
    time_s = np.arange(0.0, 60.0, 1.0 / hz)
    counted = (zero_s + time_s) / float(Fraction(TIME_NS[unit]) / 10**9)
    table = LooseTable(Path("log.csv"), COMMAS, {"when": counted}, {}, {}, {})
    found = {clock.unit: clock for clock in clocks_of(table)}
    assert found[unit].base == base
    assert found[unit].time_s == pytest.approx(time_s, abs=1e-3)
    if base == "utc":
        assert clocks_of(table)[0].unit == unit
        assert "2018-04-08" in found[unit].evidence


@pytest.mark.parametrize(("first", "counts"), [(SPRING_S, False), (1_000.0, True)])
def test_second_after_second_since_1970_is_no_number_of_rows(first: float, counts: bool) -> None:
    columns = {"when": first + np.arange(900.0)}
    (clock, *_) = clocks_of(LooseTable(Path("log.csv"), COMMAS, columns, {}, {}, {}))
    assert clock.unit == "s"
    assert clock.counts is counts


def test_rows_of_several_sensors_share_a_stamp_and_come_behind_a_finer_clock() -> None:
    shared = 8_000.0 + np.repeat(np.arange(0.0, 60.0, 0.2), 3)
    fine = 9_000.0 + np.cumsum(np.full(len(shared), 1 / 15.0))
    dates = np.round(shared * 1e9).astype(np.int64)
    columns = {"shared": shared, "fine": fine, "coarse": np.floor(fine)}
    table = LooseTable(
        Path("log.csv"), COMMAS, columns, {"date": TimeTexts(dates, "iso8601", False)}, {}, {}
    )
    found = [clock.column for clock in clocks_of(table) if clock.unit in ("s", "iso8601")]
    assert found == ["fine", "date", "shared"]
