"""The worst time to collision against the roots of its polynomial."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.metrics.evaluation import evaluate
from tests.sim_worker.metrics.motions import LENGTH_M, WIDTH_M, Mover, rollout, times

OWN_REACH_M = math.hypot(LENGTH_M, WIDTH_M) / 2.0


def wttc(ego: Mover, *others: Mover, until_s: float = 0.1) -> float:
    driven = rollout(ego, *others, time_s=times(until_s))
    return float(evaluate(driven, ("wttc",))["wttc"].values[0])


@settings(max_examples=200)
@given(
    st.floats(0.0, 25.0), st.floats(0.0, 25.0), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1),
    st.floats(3.0, 80.0),
)  # fmt: skip
def test_it_is_the_least_root_of_the_quartic(
    speed: float, other_mps: float, yaw: float, bearing: float, away: float
) -> None:
    """|Δx + Δv t| = r + a t², squared: equation 8 of Wachenfeld et al. with equal accelerations."""
    x, y = away * math.cos(bearing), away * math.sin(bearing)
    reach = OWN_REACH_M + math.hypot(4.0, 2.0) / 2.0
    vx, vy = other_mps * math.cos(yaw) - speed, other_mps * math.sin(yaw)

    def least(px: float, py: float) -> float:
        square, a = px * px + py * py, MAX_DECEL_MPS2
        if square <= reach * reach:
            return 0.0
        quartic = [a * a, 0.0, 2 * a * reach - vx * vx - vy * vy, -2 * (px * vx + py * vy),
                   reach * reach - square]  # fmt: skip
        roots = np.roots(quartic)
        real = roots[np.abs(roots.imag) < 1e-7 * (1.0 + np.abs(roots))].real
        return float(real[real > 0.0].min())

    expected = min(least(x + vx * t, y + vy * t) for t in (0.0, 0.1))
    found = wttc(Mover(0, 0, 0, speed), Mover(x, y, yaw, other_mps))
    assert found == pytest.approx(expected, abs=1e-6)


def test_head_on_it_is_the_root_of_a_square() -> None:
    gap, closing, grows = 40.0 - OWN_REACH_M - math.hypot(4.0, 2.0) / 2.0, 18.0, 2 * MAX_DECEL_MPS2
    expected = (math.sqrt(closing**2 + 2 * grows * (gap - 1.8)) - closing) / grows

    assert wttc(Mover(0, 0, 0, 10), Mover(40, 0, math.pi, 8)) == pytest.approx(expected, abs=1e-6)


def test_the_nearest_instant_and_road_user_count() -> None:
    far = Mover(200, 0, 0, 0)
    near = Mover(10, 8, 0, 10)

    assert wttc(Mover(0, 0, 0, 10), far, near) == wttc(Mover(0, 0, 0, 10), near)
    assert wttc(Mover(0, 0, 0, 10), far, until_s=8.0) < wttc(Mover(0, 0, 0, 10), far)
    assert wttc(Mover(0, 0, 0, 10)) == math.inf
