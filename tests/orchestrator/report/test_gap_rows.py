"""Gaps of a run's table by horizon and manoeuvre."""

from __future__ import annotations

import pyarrow as pa
import pytest

from foretwin.orchestrator.report.gap_rows import gaps_of


def test_each_horizon_stands_as_a_whole_and_by_manoeuvre() -> None:
    rows = [gap(2.0, "curve", 3.0), gap(2.0, "straight", 1.0), gap(1.0, "straight", 1.0)]
    rows.append(gap(2.0, "straight", 90.0) | {"independent": False})  # a command was late

    found = gaps_of(pa.Table.from_pylist(rows))

    named = [(one.horizon_s, one.manoeuvre, one.runs) for one in found]
    assert named == [
        (1.0, "all", 1),
        (1.0, "straight", 1),
        (2.0, "all", 2),
        (2.0, "straight", 1),
        (2.0, "curve", 1),
    ]
    assert found[2].rms["along_m"] == pytest.approx(5.0**0.5)
    assert found[2].rms["position_m"] == pytest.approx((5.0 + 16.0) ** 0.5)
    assert found[2].independent
    assert gaps_of(None) == []


def test_where_no_commands_were_recorded_the_gaps_are_those_of_estimated_ones() -> None:
    (_, row) = gaps_of(pa.Table.from_pylist([gap(2.0, "curve", 3.0) | {"independent": False}]))

    assert (row.runs, row.independent) == (1, False)


def gap(horizon_s: float, manoeuvre: str, along_m: float) -> dict[str, object]:
    return {
        "stamp_ns": 0,
        "horizon_s": horizon_s,
        "manoeuvre": manoeuvre,
        "along_m": along_m,
        "across_m": 4.0,
        "yaw_rad": 0.0,
        "yaw_rate_radps": 0.0,
        "speed_mps": 0.0,
        "accel_mps2": 0.0,
        "independent": True,
    }
