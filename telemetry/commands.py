"""Commands inferred from the motion, for logs in which none were recorded: pure and causal."""

from __future__ import annotations

import math

from contracts.drive import ControlCommand, VehicleState

_HELD_BELOW_MPS = 1.0
"""Below this a yaw rate says little about the wheels: the angle is held."""
_MAX_TIRE_ANGLE_RAD = 0.6


class CommandEstimator:
    """Gives for each state the command that would explain it, marked as estimated.

    Acceleration is the state's own; the tyre angle is that of a kinematic bicycle,
    atan(wheelbase · yaw rate / speed), or the measured one where there is one. A twin driven by
    this repeats the motion it is compared with: it shows the plumbing, not the truth.
    """

    def __init__(self, *, wheelbase_m: float) -> None:
        """Raises ValueError for a wheelbase that is not positive."""
        if not wheelbase_m > 0.0:
            raise ValueError(f"wheelbase {wheelbase_m} m must be positive")
        self._wheelbase_m = wheelbase_m
        self._tire_angle_rad = 0.0

    def handle(self, state: VehicleState) -> ControlCommand:
        """Return the command at the state's stamp."""
        if state.tire_angle_rad is not None and "tire_angle_rad" not in state.estimated:
            self._tire_angle_rad = state.tire_angle_rad
        elif abs(state.speed_mps) > _HELD_BELOW_MPS:
            angle = math.atan(self._wheelbase_m * state.yaw_rate_radps / state.speed_mps)
            self._tire_angle_rad = min(max(angle, -_MAX_TIRE_ANGLE_RAD), _MAX_TIRE_ANGLE_RAD)
        return ControlCommand(
            stamp_ns=state.stamp_ns,
            accel_mps2=state.accel_mps2,
            steering_wheel_rad=None,
            tire_angle_rad=self._tire_angle_rad,
            estimated=True,
        )
