"""Minutes with a telephone's positions: the heading becomes good, and the estimate is honest."""

from __future__ import annotations

import numpy as np
import pytest

from tests.telemetry.phone_figures import bound, estimated, town_drive

DURATION_S = 200.0


@pytest.mark.judge
@pytest.mark.timeout(1800)
def test_after_two_minutes_the_heading_is_within_a_degree_and_the_place_as_sure_as_it_says() -> (
    None
):
    drive = town_drive(1, DURATION_S)
    yaw, within, said = [], [], []
    for seed in range(6):
        found = estimated(drive, seed=100 + seed, std_m=3.0)
        late = found.time_s > 120.0
        yaw.append(found.yaw_rad[late])
        within.append(found.position_m[late] < 2.448 * found.position_std_m[late])
        said.append(found.position_std_m[late].mean())
    assert np.degrees(np.percentile(np.concatenate(yaw), 95)) < 1.0
    assert np.mean(np.concatenate(within)) > 0.85
    # Near what perfect wheels and a perfect gyro could reach: 3 m that last 30 s are not averaged.
    least = bound(drive, std_m=3.0, perfect=True)
    best_m = least.position_std_m[least.time_s > 120.0].mean()
    assert best_m < np.mean(said) < 1.3 * best_m
