"""An F1TENTH car in its own size: the single-track model and the numbers of its own simulator.

Althoff, Würsching (2020), CommonRoad: Vehicle Models, eq. 10. The tyres turn at their rate; nothing
of it is shared with the model of the twin.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array

MU, C_F, C_R, H, MASS, INERTIA = 1.0489, 4.718, 5.4562, 0.074, 3.74, 0.04712
LF, LR = 0.15875, 0.17145
TIRE_RATE_RADPS = 3.2
STEP_S = 2e-4
_G = 9.81


class GymCar:
    """Stands with its rear axle at a place, x, y, yaw (3,), and rolls at a speed."""

    def __init__(self, pose: Array, speed_mps: float) -> None:
        x, y, self.yaw = (float(one) for one in pose)
        self._x, self._y = x + LR * np.cos(self.yaw), y + LR * np.sin(self.yaw)
        self.speed_mps, self.yaw_rate, self._slip, self.angle = speed_mps, 0.0, 0.0, 0.0

    def pose(self) -> Array:
        """Return x, y, yaw (3,) of the rear axle."""
        x, y = self._x - LR * np.cos(self.yaw), self._y - LR * np.sin(self.yaw)
        return np.array([x, y, self.yaw])

    def drive(self, for_s: float, accel_mps2: float, tire_rad: float) -> None:
        """Go on under constant commands."""
        span = LF + LR
        front, rear = C_F * (_G * LR - accel_mps2 * H), C_R * (_G * LF + accel_mps2 * H)
        for _ in range(round(for_s / STEP_S)):
            v, rate, slip = self.speed_mps, self.yaw_rate, self._slip
            moment = (LR * rear - LF * front) * slip + LF * front * self.angle
            moment -= (LF**2 * front + LR**2 * rear) * rate / v
            side = (LR * rear - LF * front) * rate / v - (rear + front) * slip + front * self.angle
            self._x += STEP_S * v * np.cos(self.yaw + slip)
            self._y += STEP_S * v * np.sin(self.yaw + slip)
            self.yaw += STEP_S * rate
            self.yaw_rate += STEP_S * MU * MASS / (INERTIA * span) * moment
            self._slip += STEP_S * (MU / (v * span) * side - rate)
            self.speed_mps += STEP_S * accel_mps2
            most = TIRE_RATE_RADPS * STEP_S
            self.angle += min(max(tire_rad - self.angle, -most), most)
