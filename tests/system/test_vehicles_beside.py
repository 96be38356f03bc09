"""Vehicles beside the car in a whole drive: the same whatever the number of workers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.foretwin_command import foretwin

SMALL = ("--speed", "max", "--futures", "36", "--rate", "0.5")
BESIDE = """
correction = "follow"
[[vehicles]]
id = "van"
vehicle = "vw_vanagon"
role = "twin"
log = "{log}"
log_offset_s = 2.0
[[vehicles]]
id = "behind"
role = "ghost"
log = "{log}"
log_offset_s = -1.5
"""


@pytest.mark.judge
@pytest.mark.timeout(600)
def test_one_worker_and_two_give_the_same_mirror_with_vehicles_beside(tmp_path: Path) -> None:
    first = foretwin(tmp_path / "first", *SMALL, "--end", "16")
    assert first.run is not None
    config = tmp_path / "beside.toml"
    config.write_text(BESIDE.format(log=first.run / "drive.mcap"))
    one, two = (
        foretwin(
            tmp_path / f"runs{workers}", *SMALL, "--end", "12", "--config", str(config),
            "--workers", str(workers),
        )
        for workers in (1, 2)
    )  # fmt: skip
    assert (one.code, two.code) == (0, 0), one.screen + two.screen
    assert one.record()["futures"]["sha256"] == two.record()["futures"]["sha256"]
    for table in ("mirror", "mirrored", "touches", "comparisons"):
        assert one.rows(table) == two.rows(table), table
    roles = {(row["vehicle_id"], row["role"]) for row in one.rows("mirrored")}
    assert roles == {("van", "twin"), ("behind", "ghost")}
