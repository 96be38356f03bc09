"""Alarms that come once and go once."""

from __future__ import annotations

import pytest

from foretwin.contracts.gap import GapSample
from foretwin.sim_worker.analysis.gap.errors import GapLimits
from foretwin.sim_worker.analysis.gap.measured_motion import manoeuvre_of


def sample(across_m: float, *, horizon_s: float = 2.0, independent: bool = True) -> GapSample:
    return GapSample(
        vehicle_id="car",
        stamp_ns=1,
        horizon_s=horizon_s,
        manoeuvre="curve",
        along_m=0.0,
        across_m=across_m,
        yaw_rad=0.0,
        yaw_rate_radps=0.0,
        speed_mps=0.0,
        accel_mps2=0.0,
        independent=independent,
    )


def test_an_alarm_is_raised_once_and_ended_once() -> None:
    limits = GapLimits()
    told = [limits.handle(sample(value)) for value in (0.9, -1.2, 1.2, 1.1, 0.9, 1.3, 0.6, 0.5, 0)]
    assert [len(alarms) for alarms in told] == [0, 0, 1, 0, 0, 0, 0, 0, 1]
    assert (told[2][0].quantity, told[2][0].limit, told[2][0].over) == ("across_m", 1.0, True)
    assert not told[8][0].over


def test_one_outlier_other_horizons_and_estimated_commands_raise_nothing() -> None:
    limits = GapLimits()
    values = (sample(5.0), sample(0.1), sample(9.0, horizon_s=4.0), sample(9.0, horizon_s=4.0))
    guessed = [sample(9.0, independent=False)] * 3
    assert not any(limits.handle(one) for one in (*values, *guessed))


@pytest.mark.parametrize(
    ("speed", "rate", "accel", "expected"),
    [
        (0.0, 0.0, 0.0, "standstill"),
        (10.0, 0.01, 0.1, "straight"),
        (10.0, 0.3, 0.1, "curve"),
        (10.0, 0.3, -2.0, "braking"),
        (5.0, 0.0, 1.2, "accelerating"),
    ],
)
def test_manoeuvres_are_named_by_the_motion(
    speed: float, rate: float, accel: float, expected: str
) -> None:
    assert manoeuvre_of(speed_mps=speed, yaw_rate_radps=rate, accel_mps2=accel) == expected
