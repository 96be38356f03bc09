"""Causes that share a gap, parted; and what is left where one of them is not allowed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.sim_worker.analysis.gap.fitting import joint_fit

ASKED = np.array([1.4, 1.2, 0.6, 0.0, 0.0, 0.8, 1.4, 0.3])
LOSS = -np.array([0.2, 0.4, 0.6, 0.8, 0.7, 0.7, 0.9, 1.0])
COLUMNS = np.stack([ASKED, LOSS], axis=1)
VARIANCE = np.full(8, 0.01)


@given(gain=st.floats(-1.0, 1.0), loss=st.floats(-1.0, 1.0))
def test_free_causes_are_parted_exactly(gain: float, loss: float) -> None:
    fit = joint_fit(
        gain * ASKED + loss * LOSS, COLUMNS, variance=VARIANCE, prior_std=np.full(2, np.inf)
    )
    assert fit.sizes == pytest.approx([gain, loss], abs=1e-9)
    assert fit.left == pytest.approx(0.0, abs=1e-12)


def test_a_cause_held_by_its_prior_leaves_what_another_must_explain() -> None:
    gap = 0.5 * ASKED
    free, held = (
        joint_fit(gap, COLUMNS, variance=VARIANCE, prior_std=np.array([std, 0.1]))
        for std in (np.inf, 0.05)
    )
    assert held.left - free.left > 9.0
    assert abs(held.sizes[0]) < abs(free.sizes[0])


def test_deviations_shrink_with_more_blocks_and_alike_causes_are_survived() -> None:
    twice = joint_fit(
        np.zeros(16),
        np.tile(COLUMNS, (2, 1)),
        variance=np.full(16, 0.01),
        prior_std=np.full(2, np.inf),
    )
    once = joint_fit(np.zeros(8), COLUMNS, variance=VARIANCE, prior_std=np.full(2, np.inf))
    assert twice.std == pytest.approx(once.std / np.sqrt(2.0))
    alike = np.stack([ASKED, ASKED], axis=1)
    fit = joint_fit(0.4 * ASKED, alike, variance=VARIANCE, prior_std=np.full(2, np.inf))
    assert fit.sizes == pytest.approx([0.2, 0.2])
