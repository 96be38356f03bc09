"""All vehicles of a drive in one world, each in its role, stepped together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlCommand, VehicleState
from foretwin.contracts.frames import LocalFrame, target_from_source
from foretwin.contracts.roles import Correction, FollowLimits, Role
from foretwin.contracts.world import World
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.mirror.member import STEP_NS, GroupMember, Member
from foretwin.sim_worker.mirror.role_world import RoleWorld
from foretwin.sim_worker.mirror.track import MeasuredPose
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

Touches = frozenset[tuple[str, str]]
"""Sorted pairs of vehicle ids; `world` stands for what does not move."""

LONGEST_SILENCE_NS = 8_000_000_000
"""Over a longer one nothing is simulated, and a twin that follows starts anew as well."""


class VehicleGroup:
    """Steps twins, moves boxes, and finds which touch; no clock, no bus.

    States must come in time order, others' before `advance` to a stamp at or after theirs.
    """

    def __init__(
        self,
        world: World | None,
        frame: LocalFrame,
        specs: Sequence[GroupMember],
        *,
        limits: FollowLimits,
    ) -> None:
        self._specs, self._frame, self._limits = tuple(specs), frame, limits
        self._world = RoleWorld(
            world,
            {spec.vehicle_id: spec.vehicle for spec in specs},
            commanded=frozenset(spec.vehicle_id for spec in specs if spec.commanded),
        )
        self.members = {
            spec.vehicle_id: Member(spec, self._world.twins[spec.vehicle_id], frame, limits)
            for spec in specs
        }
        self.correction: Correction = "free"
        self.touches: Touches = frozenset()
        """Since the last `forget_touches`."""
        self.stamp_ns: int | None = None

    def carried_to(
        self, world: World | None, frame: LocalFrame, *, specs: Sequence[GroupMember] | None = None
    ) -> VehicleGroup:
        """Return the same vehicles in another World, in the same places and roles.

        `specs` are the same with other parameters.
        """
        new = VehicleGroup(world, frame, specs or self._specs, limits=self._limits)
        new.correction, new.stamp_ns, new.touches = self.correction, self.stamp_ns, self.touches
        for name, old in self.members.items():
            member = new.members[name]
            member.commands, member.role, member.present = old.commands, old.role, old.present
            member.offset, member.settling, member.drawn = old.offset, old.settling, old.drawn
            for state in (old.track.before, old.track.latest):
                if state is not None:
                    member.track.take(state)
            if member.present:
                new._world.set_role(name, member.role)
                twin = old.body.state
                there = target_from_source(frame, self._frame, twin[None, :2], twin[None, 2])
                twin[:2], twin[2] = there.xy_m[0], there.yaw_rad[0]
                member.put(twin, new.stamp_ns or 0)
        return new

    def begin_with_twin(self, vehicle_id: str, state: Array, stamp_ns: int) -> None:
        """Let a vehicle be there as all three, its twin in `state` (8,) at `stamp_ns`."""
        member = self.members[vehicle_id]
        member.role, member.present = "all", True
        member.put(state, stamp_ns)
        self._world.set_role(vehicle_id, "all")
        self.stamp_ns = stamp_ns

    def take_state(self, vehicle_id: str, state: VehicleState) -> None:
        """Take where a vehicle was measured. Raises ValueError where that is not finite."""
        self.members[vehicle_id].take_state(state)

    def take_command(self, vehicle_id: str, command: ControlCommand) -> None:
        """Take a command of a vehicle."""
        self.members[vehicle_id].take_command(command)

    def set_roles(self, roles: Mapping[str, Role]) -> None:
        """Give vehicles roles; those that are not here are passed over."""
        for name, member in self.members.items():
            if name in roles:
                member.take_role(roles[name], self.stamp_ns or 0)
                self._world.set_role(name, member.role if member.present else None)

    def start_anew(self, stamp_ns: int) -> None:
        """Put all twins to where their vehicles were measured last."""
        self.stamp_ns = stamp_ns
        for member in self.members.values():
            if member.present and member.has_twin:
                member.start_anew(stamp_ns)

    def advance(self, stamp_ns: int) -> None:
        """Step up to `stamp_ns`, in whole physics steps."""
        if self.stamp_ns is None or stamp_ns - self.stamp_ns > LONGEST_SILENCE_NS:
            self.stamp_ns = stamp_ns
        self._update_presence(stamp_ns)
        found: set[tuple[str, str]] = set()
        while self.stamp_ns + STEP_NS <= stamp_ns:
            found |= self._step(self.stamp_ns)
            self.stamp_ns += STEP_NS
        for member in self.members.values():
            member.commands.forget_before(stamp_ns)
            if member.present:
                self._world.place(
                    member.spec.vehicle_id, member.box(member.track.at(stamp_ns)).pose
                )
        self.touches |= found | self._overlaps(stamp_ns)

    def forget_touches(self) -> None:
        """Begin to collect touches anew."""
        self.touches = frozenset()

    def _update_presence(self, stamp_ns: int) -> None:
        for name, member in self.members.items():
            there = member.track.known(stamp_ns)
            if there and not member.present:
                member.present = True
                member.stand_as_measured()
                member.start_anew(stamp_ns)
            elif member.present and not there:
                member.present = False
            else:
                continue
            self._world.set_role(name, member.role if member.present else None)

    def _step(self, now_ns: int) -> set[tuple[str, str]]:
        measured: dict[str, MeasuredPose] = {}
        for name, member in self.members.items():
            if member.present:
                measured[name] = member.track.at(now_ns + STEP_NS)
                member.settle()
                self._world.place(name, member.box(measured[name]).pose)
                if member.has_twin:
                    member.command_twin(now_ns)
        self._world.step()
        touches = self._world.contacts()
        touching = {name for pair in touches for name in pair}
        for name, there in measured.items():
            member = self.members[name]
            member.touching = name in touching
            if member.has_twin:
                member.body.read()
                member.draw(there, now_ns + STEP_NS, follow=self.correction == "follow")
        return touches

    def _overlaps(self, stamp_ns: int) -> set[tuple[str, str]]:
        """Return the shadows that stand in one another: no physics parts what measurement moves."""
        shadows = {
            name: _outline(member, member.box(member.track.at(stamp_ns)).pose)
            for name, member in self.members.items()
            if member.present and member.role in ("shadow", "all")
        }
        return {
            (min(one, other), max(one, other))
            for one, other in combinations(shadows, 2)
            if overlapping(shadows[one], shadows[other])
        }


def _outline(member: Member, pose: Array) -> Rectangles:
    vehicle = member.spec.vehicle
    ahead = box_centre_from_base_m(vehicle) * np.array([np.cos(pose[2]), np.sin(pose[2])])
    return Rectangles(pose[:2] + ahead, pose[2], vehicle.length_m.value, vehicle.width_m.value)
