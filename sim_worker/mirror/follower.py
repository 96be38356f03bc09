"""Closes a gap smoothly: bounded acceleration, bounded jerk, no overshoot from rest."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.roles import FollowLimits
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

FASTEST_PACE_PER_S = 1.0 / (3.0 * TIMESTEP_S)
"""At a higher one a step would overrun the acceleration that it aims at."""


class Follower:
    """The velocity (K,) that is added to K coordinates so that their gaps close.

    Three saturated stages, each a proportion of what the one before still lacks: the gap asks for
    a velocity, that for an acceleration, that for a jerk (nested saturation, Teel 1992). With
    ω = jerk limit / (2 acceleration limit), small gaps obey (s + ω)³ = 0, critically damped, and
    take 6.3 / ω to 5 %; large ones close at 2 acceleration limit / (3 ω).
    """

    def __init__(self, *, max_accel: Array, max_jerk: Array) -> None:
        """Limits (K,), in units of the coordinates.

        Raises ValueError where they are not positive or so apart that one step is too long.
        """
        self._accel_limit = np.array(max_accel, dtype=np.float64)
        self._jerk_limit = np.array(max_jerk, dtype=np.float64)
        if not (np.all(self._accel_limit > 0.0) and np.all(self._jerk_limit > 0.0)):
            raise ValueError(f"limits {max_accel} and {max_jerk} must be positive")
        self._pace = self._jerk_limit / (2.0 * self._accel_limit)
        if self._pace.max() > FASTEST_PACE_PER_S:
            most = 2.0 * FASTEST_PACE_PER_S
            raise ValueError(f"a jerk limit must be at most {most:.0f} /s of the acceleration's")
        self._velocity_limit = 2.0 * self._accel_limit / (3.0 * self._pace)
        self.velocity = np.zeros(len(self._pace))
        self.acceleration = np.zeros(len(self._pace))

    @property
    def at_rest(self) -> bool:
        """Whether nothing is added."""
        return not (self.velocity.any() or self.acceleration.any())

    def step(self, gap: Array, gap_rate: Array, step_s: float = TIMESTEP_S) -> Array:
        """Return the displacement (K,) of one step.

        `gap` (K,) is what is still to go, `gap_rate` (K,) how it changes, our own velocity in it.
        """
        pace = self._pace
        velocity = np.clip(pace / 3.0 * gap, -self._velocity_limit, self._velocity_limit)
        wanted = np.clip(pace * (velocity + gap_rate), -self._accel_limit, self._accel_limit)
        jerk = 3.0 * pace * (wanted - self.acceleration)
        before = self.acceleration
        self.acceleration = before + step_s * np.clip(jerk, -self._jerk_limit, self._jerk_limit)
        was = self.velocity
        self.velocity = was + 0.5 * step_s * (before + self.acceleration)
        return 0.5 * step_s * (was + self.velocity)

    def fade(self, step_s: float = TIMESTEP_S) -> Array:
        """Return the displacement (K,) of a step in which nothing is followed any more."""
        if self.at_rest:
            return np.zeros_like(self.velocity)
        moved = self.step(np.zeros_like(self.velocity), -self.velocity, step_s)
        if np.all(np.abs(self.velocity) < _STILL) and np.all(np.abs(self.acceleration) < _STILL):
            self.stop()
        return moved

    def stop(self) -> None:
        """Add nothing from now on: what is followed has been put somewhere else."""
        self.velocity = np.zeros_like(self.velocity)
        self.acceleration = np.zeros_like(self.acceleration)


_STILL = 1e-6


def plane_follower(limits: FollowLimits) -> Follower:
    """Return a follower of gaps along, across (m) and in yaw (rad)."""
    return Follower(
        max_accel=np.array([limits.accel_mps2, limits.accel_mps2, limits.yaw_accel_radps2]),
        max_jerk=np.array([limits.jerk_mps3, limits.jerk_mps3, limits.yaw_jerk_radps3]),
    )
