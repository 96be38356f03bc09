"""How much a car's motion and the errors of its sensors wander: the filter's process noise.

Densities are variances per second; spreads are standard deviations before anything is known. What
is chosen is what a car does; `python -m tests.telemetry.estimator_figures` measures how well the
estimates are with it.
"""

from __future__ import annotations

_JERK_DENSITY = 4.0**2
"""(m/s³)² s: acceleration wanders by 4 m/s² in one second. Chosen."""
_CURVATURE_RATE_PMPS = 0.25
"""1/(m s), of a fast turn of the wheel at walking speed. Chosen: with less, the yaw rate would lag
by over 0.2 s."""
_LATERAL_JERK_MPS3 = 5.0
"""Limits how fast the curvature changes at speed: v² dκ/dt. Chosen."""
SLIP_DENSITY = 0.01**2
"""rad² / s: the body's direction differs from the path's by the rear tyres' slip. Chosen."""
GYRO_SLIP_DENSITY = 0.0005**2
"""The same where a gyro tells the body's turning from the path's and the slip is estimated.
Chosen."""
GYRO_BIAS_STD_RADPS = 0.01
"""Of a gyro that was switched on. Chosen: half a degree per second."""
GYRO_BIAS_DENSITY = (2e-5) ** 2
"""(rad/s)² / s: an automotive gyro warms up by 0.01 °/s in a minute. Chosen."""
ACCEL_BIAS_STD_MPS2 = 1.0
"""Of an accelerometer that was switched on: gravity, where it is mounted 3.5° askew and the road
rises by 8 % (0.6 and 0.8 m/s²). Chosen."""
_ACCEL_BIAS_DENSITY = 0.07**2
"""(m/s²)² / s: the grade of the road changes with the place. So gravity changes along the road over
3 to 10 s by the pitch in 43 recordings of KITTI (Geiger 2013): 0.03² to 0.06² in the plain, 0.17²
on hills."""
SLIP_RADPMPS2 = (0.004, 0.002)
"""The rear axle's slip per lateral acceleration, mean and spread over passenger cars: load over
cornering stiffness (Gillespie 1992, 6-2)."""
SPEED_SCALE_STD = 0.01
"""Of a wheel's radius against the one its speed was calibrated with. Chosen: wear and pressure."""
GNSS_CORRELATION_S = 30.0
"""How long the error of a receiver without corrections stays alike: satellites, air, walls.
Chosen."""


CALMEST = 0.03
"""The least share of what a car can do that a calm driver makes of it. Chosen."""


def densities(
    speed_mps: float, *, slip: float, calm: float = 1.0, steady: float = 1.0
) -> tuple[float, ...]:
    """Return how much yaw, speed, acceleration, curvature and both inertial biases wander.

    `calm` is the share of the jerk to be expected now, `steady` that of the wheel's turning.
    """
    turning = min(_CURVATURE_RATE_PMPS, _LATERAL_JERK_MPS3 / max(speed_mps * speed_mps, 1e-6))
    return (
        slip * min(1.0, abs(speed_mps) / 10.0),
        0.0,
        calm * _JERK_DENSITY,
        steady * turning * turning,
        GYRO_BIAS_DENSITY,
        _ACCEL_BIAS_DENSITY,
    )
