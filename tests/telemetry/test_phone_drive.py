"""Minutes with a telephone's positions: the heading becomes good, and the estimate is honest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.telemetry.phone_berlin import berlin, with_map
from tests.telemetry.phone_berlin import estimated as estimated_in_berlin
from tests.telemetry.phone_figures import Errors, bound, estimated, mapped, town_drive

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


@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_with_a_map_the_place_is_within_the_limit_once_roads_have_turned() -> None:
    """Ten seeds on two drives; streets are drawn 1 m beside where they are, lanes unknown."""
    drives = [town_drive(1), town_drive(2)]
    found = [mapped(drives[k % 2], 1 + k % 2, seed=k, error_m=1.0) for k in range(10)]
    errors = Errors(*np.concatenate([np.array(one) for one in found], axis=1))
    early, late = errors.time_s > 30.0, errors.time_s > 280.0

    assert np.percentile(errors.position_m[late], 95) < 2.5
    assert np.degrees(np.percentile(errors.yaw_rad[early], 95)) < 1.0
    assert np.mean(errors.position_m < 2.448 * errors.position_std_m) > 0.95


@pytest.mark.judge
@pytest.mark.real_data
@pytest.mark.timeout(1800)
def test_in_berlin_the_map_takes_a_quarter_off_the_errors_and_says_so(data_dir: Path) -> None:
    real = berlin(data_dir)
    without, with_osm = (
        [
            estimated_in_berlin(
                real, seed=100 + k, wheels=True, roads=with_map(real) if kind else None
            )
            for k in range(6)
        ]
        for kind in (False, True)
    )
    worst_m, yaw_deg = [], []
    for found in (without, with_osm):
        late = [np.array(one)[:, one.time_s >= 60.0] for one in found]
        errors = Errors(*np.concatenate(late, axis=1))
        worst_m.append(np.percentile(errors.position_m, 95))
        yaw_deg.append(np.degrees(np.nanpercentile(errors.yaw_rad, 95)))
    within = np.mean(errors.position_m < 2.448 * errors.position_std_m)

    assert worst_m[1] < 0.75 * worst_m[0]
    assert yaw_deg[1] < yaw_deg[0]
    assert within > 0.9
