"""Corrects the filter with yaw rates, which are a speed times a curvature: neither is known well.

A line through what is thought of both says that a car of which hardly anything is known, and that
by chance looks as if it stood, cannot turn: the rate would be the gyro's bias. What a line leaves
out is as large as the spreads of both together (Bar-Shalom, Li, Kirubarajan 2001, 10.3). Of lines
the best goes through what is thought once the rate is known: of a car that surely drives it tells
the bend, and what that line leaves out is little (posterior linearisation; García-Fernández,
Svensson, Morelande, Särkkä 2015).
"""

from __future__ import annotations

import math

import numpy as np

from foretwin.telemetry.estimator.filter_state import CURVATURE, GYRO_BIAS, SPEED
from foretwin.telemetry.estimator.innovations import LineInnovation
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter

_STRAIGHT_DEVIATIONS = 3.0
"""A gyro that reads less of its noise tells of no turn."""
_LINES = 4
"""So many lines are laid, each through what the one before made of speed and curvature. Chosen:
with one, a gyro that is heard once a second beside fixes alone is hardly believed; eight are as
good as four."""
_BEFORE = np.ix_((SPEED, CURVATURE, GYRO_BIAS), (SPEED, CURVATURE, GYRO_BIAS))


def correct_yaw_rate(
    filter_: KinematicFilter, rate_radps: float, std_radps: float
) -> LineInnovation:
    """Apply a measured yaw rate without a bias; return how far it lay off."""
    row = np.zeros(len(filter_.mean))
    row[SPEED], row[CURVATURE] = filter_.mean[CURVATURE], filter_.mean[SPEED]
    return filter_.correct(row, rate_radps - filter_.yaw_rate_radps, std_radps)


def correct_gyro(filter_: KinematicFilter, rate_radps: float, std_radps: float) -> LineInnovation:
    """Apply a gyro's rate, whose bias is estimated; return how far it lay off."""
    filter_.know_slip()
    speed, curvature = filter_.mean.item(SPEED), filter_.mean.item(CURVATURE)
    turned = rate_radps - filter_.mean.item(GYRO_BIAS)
    (p_vv, p_vk, p_vb), (_, p_kk, p_kb), (_, _, p_bb) = filter_.covariance[_BEFORE].tolist()
    straight = abs(turned) < _STRAIGHT_DEVIATIONS * std_radps
    # Who pulls away straight on after a bend does not stand.
    blind = straight and p_vv * curvature**2 > p_kk * speed**2
    v, k, vv, vk, kk = speed, curvature, p_vv, p_vk, p_kk
    found = []
    for _ in range(_LINES):
        by_v, by_k, beyond = 0.0 if blind else k, v, vv * kk + vk * vk
        off = turned - v * k - by_v * (speed - v) - by_k * (curvature - k)
        gain_v, gain_k = p_vv * by_v + p_vk * by_k + p_vb, p_vk * by_v + p_kk * by_k + p_kb
        variance = beyond + by_v * gain_v + by_k * gain_k + p_vb * by_v + p_kb * by_k + p_bb
        found.append(LineInnovation(off, variance))
        total = variance + std_radps * std_radps
        v, k = speed + gain_v * off / total, curvature + gain_k * off / total
        v = v if filter_.may_reverse else max(v, 0.0)
        vv, vk = p_vv - gain_v * gain_v / total, p_vk - gain_v * gain_k / total
        kk = p_kk - gain_k * gain_k / total
    row = np.zeros(len(filter_.mean))
    row[SPEED], row[CURVATURE], row[GYRO_BIAS] = by_v, by_k, 1.0
    filter_.correct(row, off, math.sqrt(std_radps * std_radps + beyond))
    return found[0]
