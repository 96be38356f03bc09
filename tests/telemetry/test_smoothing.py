from __future__ import annotations

import numpy as np
import pytest

from tests.telemetry.smoothing import smooth_positions

STAMPS = (np.arange(0.0, 20.0, 0.2) * 1e9).astype(np.int64)


def test_a_noisy_circle_is_found_again() -> None:
    radius_m, rate = 12.0, 0.5
    angle = rate * STAMPS * 1e-9
    circle = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    noisy = circle + np.random.default_rng(1).normal(0.0, 0.004, circle.shape)
    track = smooth_positions(STAMPS, noisy)
    inner = slice(5, -5)
    assert np.abs(track.xy_m - circle)[inner].max() < 0.03
    assert np.abs(track.speed_mps - rate * radius_m)[inner].max() < 0.05
    assert np.abs(track.yaw_rate_radps - rate)[inner].max() < 0.05
    assert np.abs(track.yaw_rad - angle - np.pi / 2)[inner].max() < 0.02


def test_yaw_is_held_over_a_stop_with_jitter() -> None:
    time_s = STAMPS * 1e-9
    distance = np.where(time_s < 8.0, 0.25 * (8.0 - time_s) ** 2, 0.0)
    jitter = np.random.default_rng(2).normal(0.0, 0.004, (len(STAMPS), 2))
    north = np.stack([np.zeros_like(distance), -distance], axis=1)
    track = smooth_positions(STAMPS, north + jitter)
    standing = time_s > 9.0
    assert np.abs(track.yaw_rad[standing] - np.pi / 2).max() < 0.15
    assert np.ptp(track.yaw_rad[standing]) == 0.0
    assert np.all(track.yaw_rate_radps[standing] == 0.0)


def test_stamps_must_increase() -> None:
    with pytest.raises(ValueError, match="increasing"):
        smooth_positions(STAMPS[::-1].copy(), np.zeros((len(STAMPS), 2)))
