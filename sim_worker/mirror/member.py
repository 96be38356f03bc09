"""One vehicle of several: its twin, its box, and how a change of role leaves it where it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlCommand, VehicleState
from foretwin.contracts.frames import LocalFrame, wrap_angle
from foretwin.contracts.roles import FollowLimits, Role
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.mirror.follower import plane_follower
from foretwin.sim_worker.mirror.track import MeasuredPose, Track
from foretwin.sim_worker.mirror.twin_body import TwinBody
from foretwin.sim_worker.vehicle.commands import CommandMemory
from foretwin.sim_worker.vehicle.planar import MAX_STEERING_DELAY_S
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

STEP_NS = round(TIMESTEP_S * 1e9)
_PASSES_OVER_S = 2.0
"""Time constant with which speed that was added becomes the model's own."""
_ROLLS_MPS = 0.5
"""Below it a brake that holds would eat what is passed over."""


class GroupMember(NamedTuple):
    """A vehicle and its parameters; `commanded` where its own commands are known."""

    vehicle_id: str
    vehicle: VehicleParameters
    commanded: bool = False


class Member:
    """Twin and box of one vehicle; a role says which of them others see and meet.

    A vehicle no longer moved by physics keeps pose and speed, and drifts to where it is measured
    under the limits of correction; one that begins to be starts with the pose and speed it had.
    """

    def __init__(
        self, spec: GroupMember, body: TwinBody, frame: LocalFrame, limits: FollowLimits
    ) -> None:
        self.spec = spec
        self.body = body
        self.track = Track(spec.vehicle, frame)
        self.commands = CommandMemory(spec.vehicle, keep_s=MAX_STEERING_DELAY_S + 1.0)
        self.role: Role = "ghost"
        self.present = False
        self.touching = False
        self.drawn = plane_follower(limits)
        """What correction adds to the twin's own motion, in its own axes."""
        self.offset = np.zeros(3)
        """Of the box from the measured pose, in the measured vehicle's axes."""
        self.settling = plane_follower(limits)
        self._reach_m = limits.reach_m

    @property
    def has_twin(self) -> bool:
        """Whether physics moves it."""
        return self.role in ("twin", "all")

    @property
    def plain(self) -> bool:
        """Whether it is nowhere else than a vehicle that never changed its role."""
        return self.drawn.at_rest and self.settling.at_rest and not self.offset.any()

    def take_state(self, state: VehicleState) -> None:
        """Take where it was measured; while a human drives, its commands move nothing."""
        self.track.take(state)
        if state.control_mode == "manual":
            self.commands.human_drives(state.stamp_ns)

    def take_command(self, command: ControlCommand) -> None:
        """Take a command of the vehicle; ignored where none are expected."""
        if self.spec.commanded:
            self.commands.add(command)

    def start_anew(self, stamp_ns: int) -> None:
        """Put the twin to where its vehicle was measured last."""
        self.drawn.stop()
        self.put(self.track.state(), stamp_ns)

    def stand_as_measured(self) -> None:
        """Put the box to where its vehicle is measured."""
        self.offset = np.zeros(3)
        self.settling.stop()

    def take_role(self, role: Role, stamp_ns: int) -> None:
        """Go on in another role from the same pose and speed."""
        if role == self.role:
            return
        had_twin, had_box = self.has_twin, self.role != "twin"
        self.role = role
        if not self.present:
            return
        if self.has_twin and not had_twin:
            self._begin_twin(stamp_ns)
        if role == "twin" or not had_box:
            box_goes_on_from_twin = role in ("shadow", "ghost")
            twin = self.twin()
            self.stand_as_measured()
            if box_goes_on_from_twin:
                self.offset, self.settling.velocity = _seen_from(self.track.at(stamp_ns), twin)

    def _begin_twin(self, stamp_ns: int) -> None:
        box = self.box(self.track.at(stamp_ns))
        along, across = _into(box.pose[2], box.rate[:2])
        state = self.track.state().copy()
        state[:3], state[3] = box.pose, along
        self.drawn.stop()
        self.drawn.velocity = np.array([0.0, across - state[4], box.rate[2] - state[5]])
        self.put(state, stamp_ns)

    def put(self, state: Array, stamp_ns: int) -> None:
        """Put the twin at `state` (8,), as if it had driven there under its commands."""
        history = self.commands.angles_before(
            stamp_ns, count=self.body.history_samples, step_ns=STEP_NS
        )
        self.body.seed(state, steering_history_rad=history)

    def twin(self) -> MeasuredPose:
        """Return the twin's pose and how it changes, correction included."""
        state = self.body.state
        velocity = state[3:6] + self.drawn.velocity
        rate = np.empty(3)
        rate[:2], rate[2] = _out_of(state[2], velocity[:2]), velocity[2]
        return MeasuredPose(state[:3], rate)

    def box(self, measured: MeasuredPose) -> MeasuredPose:
        """Return the box's pose and how it changes, where the vehicle is `measured`."""
        yaw, turning = measured.pose[2], measured.rate[2]
        aside = _out_of(yaw, self.offset[:2])
        pose, rate = measured.pose + self.offset, measured.rate + self.settling.velocity
        pose[:2] = measured.pose[:2] + aside
        rate[:2] = measured.rate[:2] + _out_of(yaw, self.settling.velocity[:2])
        rate[:2] += turning * np.array([-aside[1], aside[0]])
        return MeasuredPose(pose, rate)

    def settle(self) -> None:
        """Let the box drift on towards where it is measured, for one step."""
        if self.settling.at_rest and not self.offset.any():
            return
        self.offset += self.settling.step(-self.offset, -self.settling.velocity)
        if np.abs([self.offset, self.settling.velocity, self.settling.acceleration]).max() < 1e-4:
            self.stand_as_measured()

    def command_twin(self, stamp_ns: int) -> None:
        """Command the twin for the step from `stamp_ns` on: as its vehicle was, or as it moved."""
        command = self.commands.at(stamp_ns) or self.track.command(self.body.slopes)
        self.body.command(accel_mps2=command.accel_mps2, tire_angle_rad=command.tire_angle_rad)

    def draw(self, measured: MeasuredPose, stamp_ns: int, *, follow: bool) -> None:
        """Correct the twin after a step: towards `measured`, or less and less.

        In contact with something it is left to physics. Too far away it starts anew.
        """
        if not np.isfinite(self.body.state).all():
            self.start_anew(stamp_ns)
            return
        if follow and not self.touching:
            twin = self.twin()
            gap, gap_rate = _seen_from(twin, measured)
            if np.hypot(gap[0], gap[1]) > self._reach_m:
                self.start_anew(stamp_ns)
                return
            moved = self.drawn.step(gap, gap_rate)
        elif self.drawn.at_rest:
            return
        else:
            moved = self.drawn.fade()
        rolls = abs(self.body.state[3]) > _ROLLS_MPS
        faster = self.drawn.velocity[0] * TIMESTEP_S / _PASSES_OVER_S if rolls else 0.0
        self.drawn.velocity[0] -= faster
        self.body.nudge(moved, faster_mps=faster)


def _seen_from(one: MeasuredPose, other: MeasuredPose) -> MeasuredPose:
    """Return another pose and how it changes in the axes of one, which turn with it."""
    yaw = one.pose[2]
    pose, rate = other.pose - one.pose, other.rate - one.rate
    pose[:2], pose[2] = _into(yaw, pose[:2]), wrap_angle(pose[2])
    rate[:2] = _into(yaw, rate[:2]) - one.rate[2] * np.array([-pose[1], pose[0]])
    return MeasuredPose(pose, rate)


def _into(yaw_rad: float, vector: Array) -> Array:
    """Return (2,) along and across a heading."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([cos * vector[0] + sin * vector[1], cos * vector[1] - sin * vector[0]])


def _out_of(yaw_rad: float, vector: Array) -> Array:
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])
