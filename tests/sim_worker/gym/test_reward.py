"""What a step is worth, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.sim_worker.gym.reward import (
    ARRIVED,
    COLLISION,
    OFF_ROAD,
    PER_S,
    PROGRESS_PER_M,
    SPEEDING_PER_M,
    default_reward,
)
from foretwin.sim_worker.gym.rows import StepFacts

STEADY = StepFacts(
    0.1, *(np.array([v]) for v in (0.8, 8.0, 8.0, 0.0, 0.0, 0.0)), *(np.zeros((6, 1), dtype=bool))
)
QUIET = 0.8 * PROGRESS_PER_M + 0.1 * PER_S


def worth(**changed: float) -> float:
    facts = STEADY._replace(**{name: np.array([value]) for name, value in changed.items()})
    return float(default_reward(facts)[0])


def test_steady_driving_pays_metres_and_costs_time() -> None:
    assert worth() == pytest.approx(QUIET)
    assert worth(speed_mps=8.8) == pytest.approx(QUIET)  # a tenth above the target is free
    assert worth(speed_mps=10.8) == pytest.approx(QUIET + 2.0 * 0.1 * SPEEDING_PER_M)


def test_discomfort_costs_with_the_square_and_jerk_no_more_than_four_times_its_bound() -> None:
    gentle, hard = QUIET - worth(accel_mps2=3.0), QUIET - worth(lateral_accel_mps2=-6.0)
    assert hard == pytest.approx(4.0 * gentle)
    assert worth(jerk_mps3=1e6) == pytest.approx(worth(jerk_mps3=-20.0))


def test_events_settle_once_each() -> None:
    assert worth(collided=True) == pytest.approx(QUIET + COLLISION)
    assert worth(off_road=True, failed=True) == pytest.approx(QUIET + OFF_ROAD)
    assert worth(arrived=True) == pytest.approx(QUIET + ARRIVED)
