"""Alarms that come once and go once."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.gap import GapSample
from foretwin.sim_worker.analysis.gap.errors import GapLimits, GapMeter, gap_table
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.gap.measured_motion import manoeuvre_of, motion_on_grid
from foretwin.sim_worker.analysis.motion_record import MotionRecorder
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import FRAME, state_at


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


def test_what_states_leave_open_of_a_gap_grows_with_the_way_and_the_time() -> None:
    """Straight on at 8 m/s for 4 s; headings are known to 0.1 rad, speeds to 0.2 m/s."""
    stamps = 1 + np.arange(200) * 20_000_000
    states = [
        msgspec.structs.replace(
            state_at(0.16 * k, 0.0, 0.0, 8.0, stamp_ns=int(stamp_ns), yaw_rate=0.0, accel=0.0),
            position_std_m=0.0,
            yaw_std_rad=0.1,
            speed_std_mps=0.2,
        )
        for k, stamp_ns in enumerate(stamps)
    ]
    recorder = MotionRecorder(frame=FRAME)
    for state in states:
        recorder.handle("speed", SpeedSample(stamp_ns=state.stamp_ns, speed_mps=8.0))
    record = recorder.record()
    motion = motion_on_grid(states, record.stamp_ns, frame=FRAME)
    meter = GapMeter(FreeRunner(load_vehicle()), vehicle_id="car")
    found = meter.samples(record, motion, horizons_s=(1.0, 2.0))
    for sample in found:
        assert sample.across_std_m == pytest.approx(0.1 * 8.0 * sample.horizon_s, rel=0.01)
        assert sample.along_std_m == pytest.approx(0.2 * sample.horizon_s)
        assert sample.yaw_std_rad == pytest.approx(math.hypot(0.1, 0.1))
        assert sample.speed_std_mps == pytest.approx(math.hypot(0.2, 0.2))
        assert not sample.beyond_limits
    unsure = motion._replace(position_std_m=np.full(len(motion.x_m), 3.0))
    for sample in meter.samples(record, unsure, horizons_s=(2.0,)):
        assert sample.along_std_m == pytest.approx(math.hypot(0.4, 3.0, 3.0))
        assert sample.across_std_m == pytest.approx(math.hypot(1.6, 3.0, 3.0), rel=0.01)
    assert {row.horizon_s: row.state_std["along_m"] for row in gap_table(found)} == pytest.approx(
        {1.0: 0.2, 2.0: 0.4}
    )
