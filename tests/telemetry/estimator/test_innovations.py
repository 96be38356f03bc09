"""Surprises, normalised and counted: an honest filter has 95 of 100 within its 95 %."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.drive import SpeedSample
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.innovations import (
    LINE_95,
    PLANE_95,
    LineInnovation,
    PositionInnovation,
    SurpriseCount,
)
from tests.telemetry.position_track import Sample, fix, info


def test_squares_of_an_honest_filter_are_below_their_bounds_95_times_of_100() -> None:
    random = np.random.default_rng(3)
    spread = np.array([[0.04, 0.01], [0.01, 0.09]])
    count = SurpriseCount()
    for residual in random.multivariate_normal([0.0, 0.0], spread + 0.01 * np.eye(2), 4000):
        one = PositionInnovation(residual, np.zeros((12, 2)), 0.04, 0.01, 0.09)
        count.take("gnss", one.square(0.1), PLANE_95)
    for number in random.normal(0.0, 1.0, 4000):
        count.take("speed", number * number, LINE_95)
    for found in count.counts.values():
        assert found.taken == 4000
        assert found.within / found.taken == pytest.approx(0.95, abs=0.012)


def test_a_copy_counts_by_itself() -> None:
    count = SurpriseCount()
    count.take("gnss", 1.0, PLANE_95)
    other = count.copy()
    other.take("gnss", 100.0, PLANE_95)
    assert count.counts["gnss"] == (1, 1)
    assert other.counts["gnss"] == (2, 1)


def line_share(noise_std: float, *, usual: float = 1.0) -> float:
    """Return which share is within of a sensor whose noise may be 0.05 to 3."""
    count = SurpriseCount()
    for residual in np.random.default_rng(5).normal(0.0, noise_std, 5000):
        innovation = LineInnovation(residual, 0.0)
        count.take_line("speed", innovation, least_std=0.05, most_std=3.0, usual=usual)
    found = count.counts["speed"]
    assert found.taken == 4980
    return found.within / found.taken


def test_a_sensor_that_states_no_noise_is_judged_by_its_surprises_before() -> None:
    for noise_std in (0.1, 0.6, 2.0):
        assert line_share(noise_std) == pytest.approx(0.95, abs=0.012)
    assert line_share(0.02) > 0.99
    assert line_share(6.0) == pytest.approx(0.67, abs=0.02)


def test_a_gyro_is_judged_by_the_noise_it_shows_between_neighbours() -> None:
    assert line_share(0.05, usual=3.0) == pytest.approx(0.95, abs=0.012)
    assert line_share(0.1, usual=3.0) == pytest.approx(0.67, abs=0.02)


def test_what_comes_all_at_once_is_a_surprise() -> None:
    count = SurpriseCount()
    for residual in [0.1] * 20 + [1.0]:
        count.take_line("speed", LineInnovation(residual, 0.0), least_std=0.05)
    assert count.counts["speed"] == (1, 0)


def drive(*, std_m: float, noise_m: float, late: bool, speed_noise: float = 0.03) -> StateEstimator:
    random = np.random.default_rng(4)
    estimator = StateEstimator(info())
    samples: list[Sample] = []
    for k in range(800):
        speed = SpeedSample(
            stamp_ns=round(k * 0.05e9), speed_mps=9.0 + float(random.normal(0, speed_noise))
        )
        samples.append(("speed", speed))
        if k % 4 == 0:
            off = random.normal(0.0, noise_m, 2)
            samples.append(fix(k / 20, 9.0 * k / 20 + off[0], off[1], std_m=std_m))
    if late:
        samples = [s for pair in zip(samples[1::2], samples[::2], strict=False) for s in pair]
    for channel, message in samples:
        received = message.stamp_ns + 10**9 if late else None
        estimator.handle(channel, message, received_ns=received)
    return estimator


def test_what_a_drive_says_of_itself_tells_an_honest_receiver_from_one_that_lies() -> None:
    honest = drive(std_m=0.1, noise_m=0.1, late=False).consistency
    lying = drive(std_m=0.02, noise_m=2.0, late=False).consistency
    share = honest.surprises["gnss"].within / honest.surprises["gnss"].taken
    assert share > 0.93
    assert honest.widened == 1.0
    assert honest.position_noise_m == 0.1
    assert lying.position_noise_m is not None
    assert lying.position_noise_m > 0.5
    assert set(honest.surprises) == {"gnss", "speed"}


@pytest.mark.parametrize(
    ("noise_mps", "least", "most"), [(0.02, 0.99, 1.0), (0.6, 0.92, 0.98), (6.0, 0.5, 0.8)]
)
def test_the_share_of_speeds_shows_wheels_that_are_worse_than_any_are_taken_to_be(
    noise_mps: float, least: float, most: float
) -> None:
    found = drive(std_m=0.1, noise_m=0.1, late=False, speed_noise=noise_mps).consistency
    speed = found.surprises["speed"]
    assert 770 <= speed.taken <= 780
    assert least <= speed.within / speed.taken <= most


def test_samples_out_of_order_are_counted_once() -> None:
    through = drive(std_m=0.1, noise_m=0.1, late=True).consistency
    assert through.surprises["gnss"].taken <= 200
    assert through.surprises["gnss"].taken > 180
