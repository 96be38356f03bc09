"""Which heading counts where a log has a compass and a course, and of which instant it is."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.telemetry.test_nmea import NOON_NS, gga, line, opened, rmc

COVERS = (
    "foretwin.telemetry.logs.nmea",
    "foretwin.telemetry.logs.nmea_positions",
)
S = 10**9


def compass(heading_deg: float | None) -> str:
    return line(f"GPHDT,{'' if heading_deg is None else heading_deg},T")


def noon(second: int) -> str:
    return rmc(f"1200{second:02d}.00", "010326", course="90.0")


def headings_deg(tmp_path: Path, *lines: str) -> list[tuple[int, int]]:
    """Return seconds after noon and degrees from north of each heading; nothing is refused."""
    log, found = opened(tmp_path, *lines)
    assert log.skipped == {}
    return [
        ((one.stamp_ns - NOON_NS) // S, round(90.0 - math.degrees(one.yaw_rad)) % 360)
        for one in found.get("heading", [])
    ]


def test_a_compass_without_a_solution_leaves_the_course(tmp_path: Path) -> None:
    lines = [text for second in range(3) for text in (noon(second), compass(None))]
    assert headings_deg(tmp_path, *lines) == [(0, 90), (1, 90), (2, 90)]


def test_a_course_stands_in_for_a_compass_that_is_lost_until_it_is_found(tmp_path: Path) -> None:
    told = {0: 80.0, 1: 80.0, 9: 85.0}
    lines = [text for second in range(10) for text in (noon(second), compass(told.get(second)))]
    assert headings_deg(tmp_path, *lines) == [(0, 80), (1, 80), (7, 90), (8, 90), (9, 85)]


def test_a_compass_that_speaks_seldom_is_not_crowded_out(tmp_path: Path) -> None:
    lines = [noon(second) + compass(80.0) * (second % 3 == 0) for second in range(7)]
    assert headings_deg(tmp_path, *lines) == [(0, 80), (3, 80), (6, 80)]


@pytest.mark.parametrize("first", [True, False])
def test_a_heading_is_of_its_own_instant_on_whichever_side_it_stands(
    tmp_path: Path, first: bool
) -> None:
    lines = []
    for second in range(4):
        position = gga(f"1200{second:02d}.00") + noon(second)
        said = compass(10.0 * second)
        lines.append(said + position if first else position + said)
    assert headings_deg(tmp_path, *lines) == [(0, 0), (1, 10), (2, 20), (3, 30)]
