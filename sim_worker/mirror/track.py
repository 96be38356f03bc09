"""Where a vehicle was measured, at any instant around its last two states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, wrap_angle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.vehicle.commands import TwinCommand, estimated_command
from foretwin.sim_worker.vehicle.gravity import climb_mps2
from foretwin.sim_worker.vehicle.seeding import local_state

LOST_AFTER_NS = 1_000_000_000
"""A vehicle not measured for longer is not there any more."""
_CONTINUOUS_NS = 2_000_000_000
"""Between two states farther apart, nothing says how the vehicle moved."""


class MeasuredPose(NamedTuple):
    """A pose x, y, yaw (3,) of base_link and how it changes (3,), in the world's frame."""

    pose: Array
    rate: Array


class Track:
    """The last two states of a vehicle in one frame, and nothing of what comes later."""

    def __init__(
        self, vehicle: VehicleParameters, frame: LocalFrame, *, continuous_ns: int = _CONTINUOUS_NS
    ) -> None:
        """Between states farther apart than `continuous_ns` nothing is interpolated."""
        self.vehicle = vehicle
        self._frame, self._continuous_ns = frame, continuous_ns
        self.latest: VehicleState | None = None
        self.before: VehicleState | None = None
        self._rows: list[tuple[int, Array]] = []

    def take(self, state: VehicleState) -> bool:
        """Add a state; one without a heading or out of time order is passed over: False."""
        if not state.yaw_valid:
            return False
        if self.latest is not None and state.stamp_ns <= self.latest.stamp_ns:
            return False
        row = (state.stamp_ns, local_state(state, self._frame, self.vehicle))
        self._rows = [*self._rows[-1:], row]
        self.before, self.latest = self.latest, state
        return True

    def known(self, stamp_ns: int) -> bool:
        """Whether the vehicle was measured, and not long before `stamp_ns`."""
        return self.latest is not None and stamp_ns - self.latest.stamp_ns <= LOST_AFTER_NS

    def state(self) -> Array:
        """Return the newest measured state (8,)."""
        return self._rows[-1][1]

    def at(self, stamp_ns: int) -> MeasuredPose:
        """Return the pose at `stamp_ns`: evenly between two states, else on from the nearest.

        Beyond the newest state the vehicle goes on at its speed and yaw rate.
        """
        newest_ns, newest = self._rows[-1]
        if len(self._rows) == 2:
            oldest_ns, oldest = self._rows[0]
            span_ns = newest_ns - oldest_ns
            if stamp_ns <= newest_ns and span_ns <= self._continuous_ns:
                share = min(max((stamp_ns - oldest_ns) / span_ns, 0.0), 1.0)
                moved = newest[:3] - oldest[:3]
                moved[2] = wrap_angle(moved[2])
                row = oldest + share * (newest - oldest)
                row[:3] = oldest[:3] + share * moved
                return MeasuredPose(row[:3], _rate(row))
        ahead_s = max(0.0, (stamp_ns - newest_ns) / 1e9)
        row = newest.copy()
        row[2] += 0.5 * ahead_s * newest[5]
        row[:2] += ahead_s * _rate(row)[:2]
        row[2] = newest[2] + ahead_s * newest[5]
        return MeasuredPose(row[:3], _rate(row))

    def command(self, slopes: Slopes | None = None) -> TwinCommand:
        """Return the command that turned the last state but one into the last; see commands."""
        newest_ns, newest = self._rows[-1]
        oldest_ns, oldest = self._rows[0]
        span_s = (newest_ns - oldest_ns) / 1e9
        if len(self._rows) < 2 or not 0.0 < span_s <= self._continuous_ns / 1e9:
            oldest, span_s = newest, 1.0
        climb = climb_mps2(slopes, newest[None])
        return estimated_command(
            self.vehicle,
            oldest,
            newest,
            stamp_ns=oldest_ns,
            duration_s=span_s,
            climb_mps2=0.0 if climb is None else float(climb[0]),
        )


def _rate(row: Array) -> Array:
    cos, sin = np.cos(row[2]), np.sin(row[2])
    return np.array([cos * row[3] - sin * row[4], sin * row[3] + cos * row[4], row[5]])
