"""Columns that repeat others, and rows that hold several rates with a time each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.declare.loose_table import read_loose_table
from foretwin.telemetry.logs.declare.rasters import check_one_time
from foretwin.telemetry.logs.log import LogError
from tests.telemetry.logs.declare.test_position_units import drive_columns, read_again, written


def test_a_column_that_is_another_is_left_aside_and_told(tmp_path: Path) -> None:
    columns = drive_columns()
    path = written(tmp_path, columns | {"lat2": columns["lat"], "lon2": columns["lon"]})
    assert 'latitude = { column = "lat", unit = "deg" }' in read_again(path)
    told = propose(path).unknown
    assert {"lat2: the same as lat", "lon2: the same as lon"} <= set(told)


def rasters(folder: Path, *, fast: np.ndarray, slow: np.ndarray) -> Path:
    """Write positions with a slow time beside a fast time and what was measured by that."""
    columns = drive_columns()
    lines = ["t_gps,lat,lon,t_can,load"]
    for row, time_s in enumerate(fast):
        cells = ["", "", ""]
        if row < len(slow):
            cells = [f"{slow[row]:.3f}", *(f"{columns[name][row]:.9f}" for name in ("lat", "lon"))]
        lines.append(",".join([*cells, f"{time_s:.3f}", f"{row % 17}"]))
    path = folder / "rasters.csv"
    path.write_text("\n".join([*lines, ""]))
    return path


def test_rows_of_several_rates_with_a_time_each_are_refused(tmp_path: Path) -> None:
    """Read by the fast time the car would drive five times as fast."""
    times = drive_columns()["t"]
    path = rasters(tmp_path, fast=np.arange(0.0, 75.0, 0.02), slow=times)
    with pytest.raises(LogError, match=r"t_gps, lat, lon end at row 750 of 3750, .* than t_can"):
        propose(path)


@pytest.mark.parametrize("factor", [1.0, 1000.0, 1e-3])
def test_a_receiver_that_ends_early_by_the_same_time_is_none_of_them(
    tmp_path: Path, factor: float
) -> None:
    times = drive_columns()["t"]
    path = rasters(tmp_path, fast=np.arange(0.0, 300.0, 0.1), slow=times * factor)
    check_one_time(read_loose_table(path))
