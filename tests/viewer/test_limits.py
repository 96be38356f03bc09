"""The limits on screen are those that raise alarms."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from foretwin.contracts.gap import ALARM_HORIZON_S, GapSample
from foretwin.sim_worker.analysis.gap.errors import GapLimits
from foretwin.viewer.log_drive import DriveLog
from foretwin.viewer.log_tuning import TuningLog
from foretwin.viewer.rows import Row
from tests.viewer import scene

QUIET = GapSample(
    vehicle_id="car",
    stamp_ns=1,
    horizon_s=ALARM_HORIZON_S,
    manoeuvre="curve",
    along_m=0.0,
    across_m=0.0,
    yaw_rad=0.0,
    yaw_rate_radps=0.0,
    speed_mps=0.0,
    accel_mps2=0.0,
    independent=True,
)


def numbers(row: Row) -> list[float]:
    cells: Any = row.components
    return [float(value) for value in cells.scalars.as_arrow_array().to_pylist()]


def limits_drawn(since_s: float) -> dict[str, list[float]]:
    """The lines of the gap plots while the free twin has run for so long."""
    sample = msgspec.structs.replace(scene.mirror_at(3.0), since_reset_s=since_s)
    rows = DriveLog(scene.DRIVE_FRAME).mirror(sample, 1)
    return {row.path.split("/")[1]: numbers(row) for row in rows if row.path.endswith("/limit")}


def alarms(**gaps: float) -> set[str]:
    limits = GapLimits()
    told = [limits.handle(msgspec.structs.replace(QUIET, **gaps)) for _ in range(2)]
    return {alarm.quantity for some in told for alarm in some}


@pytest.mark.parametrize(
    ("plot", "field", "unit"),
    [
        ("across_m", "across_m", 1.0),
        ("along_m", "along_m", 1.0),
        ("yaw_deg", "yaw_rad", math.radians(1.0)),
    ],
)
def test_beyond_the_line_of_a_gap_after_2_s_is_an_alarm(plot: str, field: str, unit: float) -> None:
    rows = TuningLog().gap(QUIET, 1)
    drawn = next(numbers(row) for row in rows if row.path == f"reality/{plot}/limit")
    for line in drawn:
        assert alarms(**{field: 1.001 * unit * line}) == {field}
        assert alarms(**{field: 0.999 * unit * line}) == set()
    assert drawn[0] == -drawn[1]


def test_the_lines_of_the_free_twin_s_gaps_grow_as_alarms_allow() -> None:
    drawn = limits_drawn(ALARM_HORIZON_S)
    for plot, field, unit in (
        ("speed_mps", "speed_mps", 1.0),
        ("yaw_deg", "yaw_rad", math.pi / 180),
    ):
        for line in drawn[plot]:
            assert alarms(**{field: 1.001 * unit * line}) == {field}
            assert alarms(**{field: 0.999 * unit * line}) == set()
    (distance_m,) = drawn["pos_m"]
    for angle in (0.0, 0.5, 1.0, 1.5):
        along_m, across_m = distance_m * math.cos(angle), distance_m * math.sin(angle)
        assert alarms(along_m=1.001 * along_m, across_m=1.001 * across_m)
    for plot, lines in limits_drawn(2.0 * ALARM_HORIZON_S).items():
        grown = 4.0 if plot == "pos_m" else 2.0
        assert lines == pytest.approx([grown * line for line in drawn[plot]])
    assert limits_drawn(0.1) == drawn


def test_what_uncertain_states_leave_open_widens_the_line_and_holds_the_alarm_back() -> None:
    unsure = {"across_std_m": 0.3}
    rows = TuningLog().gap(msgspec.structs.replace(QUIET, **unsure), 1)
    line = next(numbers(row) for row in rows if row.path == "reality/across_m/limit")[0]
    assert line == pytest.approx(1.0 + 0.6)
    assert alarms(across_m=1.001 * line, **unsure) == {"across_m"}
    assert alarms(across_m=0.999 * line, **unsure) == set()


def test_where_no_alarm_can_be_raised_no_limit_is_drawn() -> None:
    """Of commands that were estimated from the motion itself."""
    guessed = msgspec.structs.replace(QUIET, independent=False, across_m=9.0)
    assert not GapLimits().handle(guessed)
    assert [row.path for row in TuningLog().gap(guessed, 1) if row.path.endswith("/limit")] == []
    sample = msgspec.structs.replace(scene.mirror_at(3.0), independent=False)
    rows = DriveLog(scene.DRIVE_FRAME).mirror(sample, 1)
    assert [row.path for row in rows if row.path.endswith("/twin")]
    assert [row.path for row in rows if row.path.endswith("/limit")] == []


def test_lines_fall_at_once_where_the_free_twin_starts_anew() -> None:
    log, points = DriveLog(scene.DRIVE_FRAME), []
    for tick in range(100):
        for row in log.mirror(scene.mirror_at(tick / 10), tick * 100_000_000):
            if row.path == "gap/speed_mps/limit":
                assert row.drive_ns is not None
                points.append((row.drive_ns / 1e9, numbers(row)[0]))
    for at_s, limit in points:
        assert limit == pytest.approx(0.6 * max(at_s % 8.0, 2.0))
    assert {7.9, 8.0} <= {at_s for at_s, _ in points}
    assert len(points) < 20
