"""A logger that writes a row a second: position to the metre, speed, heading and turning rate."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from foretwin.contracts.drive import HeadingSample, SpeedSample
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs.log import Log
from tests.telemetry.position_track import Sample, fix, info, xy, yaw
from tests.telemetry.winding_drive import TICK_S, TICKS, WINDING, measured, truly

COVERS = ("foretwin.telemetry.logs.log",)
ROW_TICKS = 50


def rows() -> Iterator[Sample]:
    """As a reader has them: the position of a row first."""
    for tick in range(0, TICKS, ROW_TICKS):
        *_, x, y = WINDING[tick]
        yield fix(tick * TICK_S, float(round(x)), float(round(y)))
        yield from measured(tick, gyro=truly, wheels=truly, heading=truly)


def test_a_row_is_summed_up_by_one_state_that_holds_all_of_it() -> None:
    log = Log(info=info(), read=lambda _: rows())
    estimator = StateEstimator(log.info)
    given_out = (estimator.handle(channel, message) for channel, message in log.samples())
    states = [state for state in given_out if state is not None]
    stamps = [state.stamp_ns for state in states[3:]]
    assert stamps == sorted(set(stamps))
    off = []
    for state in states[20:]:
        speed, rate, heading, *_ = WINDING[round(state.stamp_ns * 1e-9 / TICK_S)]
        turned = math.remainder(yaw(state) - heading, math.tau)
        off.append((state.speed_mps - speed, turned, state.yaw_rate_radps - rate))
    speed_mps, yaw_rad, rate_radps = np.sqrt(np.mean(np.square(off), axis=0))
    assert speed_mps < 0.4
    assert math.degrees(yaw_rad) < 1.0
    assert math.degrees(rate_radps) < 2.0
    assert not estimator.left_out


def test_where_a_heading_begins_the_motion_the_car_has_gone_on_since_its_fix() -> None:
    estimator = StateEstimator(info())
    for time_s in (0.0, 1.0, 2.0):
        stamp_ns = round(time_s * 1e9)
        estimator.handle("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=15.0))
        estimator.handle("heading", HeadingSample(stamp_ns=stamp_ns, yaw_rad=0.0))
        state = estimator.handle(*fix(time_s, 15.0 * time_s, 0.0))
        assert state is not None
        assert abs(xy(state)[0] - 15.0 * time_s) < 0.1
    assert not estimator.skipped


@pytest.mark.parametrize(("beside", "every"), [("wheels", 5), ("heading", ROW_TICKS)])
def test_what_stands_beside_seldom_fixes_does_not_cost_the_motion_that_they_show(
    beside: str, every: int
) -> None:
    """A filter that leads a second ahead without knowing of a bend swings about the truth."""
    estimator, off = StateEstimator(info()), []
    for tick in range(0, TICKS, every):
        speed, _, heading, x, y = WINDING[tick]
        for sample in measured(tick, **{beside: truly}):
            estimator.handle(*sample)
        if tick % ROW_TICKS:
            continue
        state = estimator.handle(*fix(tick * TICK_S, float(round(x)), float(round(y))))
        if state is not None and tick > 20 * ROW_TICKS:
            turned = math.remainder(yaw(state) - heading, math.tau)
            off.append((state.speed_mps - speed, math.degrees(turned)))
    speed_mps, yaw_deg = np.sqrt(np.mean(np.square(off), axis=0))
    assert (speed_mps < 1.2, yaw_deg < 15.0) == (True, True)
