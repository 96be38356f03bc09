"""Of the comparisons of a finding one accuses; the others only go with it."""

from __future__ import annotations

import math

from foretwin.sim_worker.analysis.gap.consistency import Consistency
from foretwin.sim_worker.analysis.gap.findings import findings_of
from foretwin.sim_worker.analysis.gap.fitting import DelayedLine, Line

OBEYS = Line(gain=1.0, gain_std=0.02, offset=0.0, offset_std=0.001, residual=0.002, explained=0.99)


def seen(steering: Line, *, delay_s: float = 0.1, motion: Line = OBEYS) -> Consistency:
    """Five seconds in a bend of a car whose gyro is right."""
    return Consistency(
        gyro_by_course=OBEYS,
        speed_by_gnss=OBEYS,
        measured_by_command=DelayedLine(steering, delay_s, math.nan),
        model_by_command=None,
        model_stops_at_rad=math.nan,
        motion_by_measured=None,
        motion_by_measured_hard=None,
        missing_mps2=math.nan,
        motion_lag=None,
        motion_by_command=motion,
        motion_by_angle=None,
        excited_s=5.0,
        moved_s=5.0,
    )


def test_a_car_that_steers_beside_is_accused_by_its_offset_though_its_gain_is_right() -> None:
    found = findings_of(seen(OBEYS._replace(offset=0.06), motion=OBEYS._replace(offset=0.05)))

    assert found is not None
    assert (found.culprit, found.cause) == ("vehicle", "steering_offset")
    assert found.evidence[0].name == "measured_by_command"
    assert (found.deciding.name, found.deciding.value) == ("measured_offset", 0.06)


def test_an_offset_that_the_motion_does_not_show_is_the_sensors() -> None:
    found = findings_of(seen(OBEYS._replace(offset=0.06)))

    assert found is not None
    assert (found.cause, found.deciding.name) == ("offset_sensor", "measured_offset")


def test_a_car_that_steers_late_is_accused_by_its_delay() -> None:
    found = findings_of(seen(OBEYS, delay_s=0.6))

    assert found is not None
    assert (found.cause, found.deciding.value) == ("steering_delay", 0.6)
    assert found.deciding.expected < 0.36


def test_a_gain_accuses_where_nothing_else_does() -> None:
    found = findings_of(seen(OBEYS._replace(gain=0.5)))

    assert found is not None
    assert (found.cause, found.deciding.name) == ("steering_gain", "measured_by_command")


def test_a_car_that_does_as_told_is_left_alone() -> None:
    assert findings_of(seen(OBEYS)) is None
