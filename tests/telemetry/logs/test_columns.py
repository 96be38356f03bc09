"""Standard deviations in a table: a receiver that knows none writes 0, -1 or no number."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.logs import open_log

DECLARED = """reference_point = "antenna"
[time]
column = "t"
unit = "s"
base = "log"
[position]
frame = "wgs84"
latitude = { column = "lat", unit = "deg" }
longitude = { column = "lon", unit = "deg" }
std = { column = "s", unit = "m" }
"""


@pytest.mark.parametrize(
    ("cell", "std_m"), [("-1", None), ("0", None), ("-0.0", None), ("nan", None), ("2.5", 2.5)]
)
def test_a_standard_deviation_is_above_zero_or_unknown(
    tmp_path: Path, cell: str, std_m: float | None
) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(f"t,lat,lon,s\n1,52.5,13.4,{cell}\n2,52.5,13.4,1\n")
    path.with_name("drive.csv.toml").write_text(DECLARED)
    fixes = [one for _, one in open_log(path).samples() if isinstance(one, GnssFix)]
    assert [one.std_m for one in fixes] == [std_m, 1.0]
