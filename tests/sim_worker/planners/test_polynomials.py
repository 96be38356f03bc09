"""Motions begin as given and end as wanted, whatever is given and wanted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.sim_worker.planners.polynomials import braked, joined, to_place, to_speed

VALUES = st.floats(-20.0, 20.0)
TIMES = st.floats(0.5, 6.0)


def arrays(*values: float) -> list[np.ndarray]:
    return [np.array([value]) for value in values]


@given(VALUES, VALUES, VALUES, VALUES, VALUES, TIMES)
def test_to_a_place(s: float, v: float, a: float, end: float, end_v: float, t: float) -> None:
    place, speed, accel, there, then, end_s = arrays(s, v, a, end, end_v, t)
    motion = to_place(place, speed, accel, end_place=there, end_speed=then, end_s=end_s)
    assert [float(x[0]) for x in motion.at(np.zeros(1))] == pytest.approx([s, v, a], abs=1e-9)
    assert [float(x[0]) for x in motion.at(end_s)] == pytest.approx([end, end_v, 0.0], abs=1e-6)
    assert motion.place_at(end_s + 2.0)[0] == pytest.approx(end + 2.0 * end_v, abs=1e-6)


@given(VALUES, VALUES, VALUES, VALUES, TIMES)
def test_to_a_speed(s: float, v: float, a: float, end_v: float, t: float) -> None:
    place, speed, accel, then, end_s = arrays(s, v, a, end_v, t)
    motion = to_speed(place, speed, accel, end_speed=then, end_s=end_s)
    assert [float(x[0]) for x in motion.at(np.zeros(1))] == pytest.approx([s, v, a], abs=1e-9)
    _, at_end, accel_then = motion.at(end_s)
    assert [float(at_end[0]), float(accel_then[0])] == pytest.approx([end_v, 0.0], abs=1e-6)


@given(VALUES, VALUES, VALUES, VALUES, VALUES, TIMES, st.floats(0.0, 1.0))
def test_speed_acceleration_and_jerk_are_derivatives(
    s: float, v: float, a: float, end: float, end_v: float, t: float, share: float
) -> None:
    place, speed, accel, there, then, end_s = arrays(s, v, a, end, end_v, t)
    motion = to_place(place, speed, accel, end_place=there, end_speed=then, end_s=end_s)
    step = 1e-4
    now = np.array([share * (t - 4.0 * step) + 2.0 * step])
    before, after = motion.at(now - step), motion.at(now + step)
    _, present, push = motion.at(now)
    scale = 1.0 + max(abs(x) for x in (v, a, end - s, end_v)) / min(t, 1.0) ** 3
    assert (after[0] - before[0]) / (2 * step) == pytest.approx(present, abs=1e-4 * scale)
    assert (after[1] - before[1]) / (2 * step) == pytest.approx(push, abs=1e-3 * scale)
    assert (after[2] - before[2]) / (2 * step) == pytest.approx(
        motion.jerk_at(now), abs=1e-2 * scale
    )
    assert motion.speed_at(now) == pytest.approx(present, abs=1e-9 * scale)


def test_even_braking_ends_at_rest() -> None:
    motion = braked(*arrays(3.0, 12.0), decel=8.0)
    place, speed, accel = motion.at(np.array([[0.5], [1.4], [1.6], [4.0]]))
    assert speed[:, 0] == pytest.approx([8.0, 0.8, 0.0, 0.0])
    assert accel[:, 0] == pytest.approx([-8.0, -8.0, 0.0, 0.0])
    assert place[2:, 0] == pytest.approx(3.0 + 12.0**2 / 16.0)


def test_sets_of_motions_become_one() -> None:
    one = to_speed(*arrays(0.0, 1.0, 0.0), end_speed=np.array([2.0, 3.0]), end_s=np.array([2.0]))
    other = to_speed(*arrays(0.0, 1.0, 0.0), end_speed=np.array([4.0]), end_s=np.array([1.0]))
    both = joined(one, other)
    assert both.at(np.array([5.0]))[1] == pytest.approx([2.0, 3.0, 4.0])
