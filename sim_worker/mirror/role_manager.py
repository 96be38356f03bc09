"""When a mirror needs a group: for another role than all three, a correction, other vehicles."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.roles import Correction, MirrorCast, OtherVehicle, Role, UseRoles
from foretwin.contracts.simulation import MirrorSample
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.mirror.member import GroupMember
from foretwin.sim_worker.mirror.samples import with_group
from foretwin.sim_worker.mirror.vehicle_group import LONGEST_SILENCE_NS, VehicleGroup
from foretwin.sim_worker.vehicle.commands import STEP_BACK_NS, CommandMemory


class FreeTwin(NamedTuple):
    """The state (8,) of the free twin and the stamp of its last step."""

    state: Array
    stamp_ns: int


class RoleManager:
    """Holds the group beside a mirror's free twin; without need there is none, at no cost.

    Calls for one state of the car come in the order `change_world`, `before`, `start_anew` where
    the free twin does, `advance`, `completed`.
    """

    def __init__(
        self,
        car: GroupMember,
        settings: MirrorCast,
        *,
        drive_frame: LocalFrame,
        commands: CommandMemory,
    ) -> None:
        """`commands` are the car's, which the free twin takes too."""
        others = [
            GroupMember(other.vehicle_id, other.vehicle, other.commands_recorded)
            for other in settings.others
        ]
        self._car = car.vehicle_id
        self._commands = commands
        self._members = (car, *others)
        self._limits = settings.limits
        self._drive_frame = self._frame = drive_frame
        self._world: World | None = None
        self._roles: dict[str, Role] = {one.vehicle_id: "shadow" for one in others}
        self._roles[self._car] = "all"
        self._correction: Correction = "free"
        self._pending: list[UseRoles] = []
        self._last: VehicleState | None = None
        self._lost = False
        self._group: VehicleGroup | None = self._new_group() if others else None

    def _new_group(self) -> VehicleGroup:
        group = VehicleGroup(self._world, self._frame, self._members, limits=self._limits)
        group.members[self._car].commands = self._commands
        group.set_roles(self._roles)
        return group

    @property
    def _needed(self) -> bool:
        alone = len(self._members) == 1
        return not alone or self._roles[self._car] != "all" or self._correction != "free"

    def set_roles(self, use: UseRoles) -> None:
        """Let roles and correction count from the first state at or after their stamp on."""
        self._pending.append(use)

    def take_other(self, other: OtherVehicle) -> None:
        """Take another vehicle's state and commands; of an unknown one, nothing."""
        name = other.state.vehicle_id
        if self._group is None or name not in self._group.members or name == self._car:
            return
        for command in other.commands:
            self._group.take_command(name, command)
        self._group.take_state(name, other.state)

    def change_world(self, world: World | None, frame: LocalFrame) -> None:
        """Go on in another World."""
        self._world, self._frame = world, frame
        if self._group is not None:
            self._group = self._group.carried_to(world, frame)

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Go on with other parameters of the car."""
        car, *others = self._members
        self._members = (car._replace(vehicle=vehicle), *others)
        if self._group is not None:
            self._group = self._group.carried_to(self._world, self._frame, specs=self._members)

    def before(self, state: VehicleState, free_twin: Callable[[], FreeTwin | None]) -> None:
        """Make the changes that are due at a state of the car, and take the state."""
        if self._last is not None and state.stamp_ns < self._last.stamp_ns - STEP_BACK_NS:
            self._begin_anew(state.stamp_ns)
        due = [use for use in self._pending if use.stamp_ns <= state.stamp_ns]
        self._pending = [use for use in self._pending if use.stamp_ns > state.stamp_ns]
        for use in due:
            known = {name: role for name, role in use.roles.items() if name in self._roles}
            self._roles |= known
            self._correction = use.correction
        if due:
            self._apply(free_twin)
        self._lost = self._last is None or state.stamp_ns - self._last.stamp_ns > LONGEST_SILENCE_NS
        self._last = state
        if self._group is not None:
            self._group.take_state(self._car, state)

    def _begin_anew(self, stamp_ns: int) -> None:
        """Forget what was by the old clock; roles that were to come by it are due."""
        self._pending = [msgspec.structs.replace(use, stamp_ns=stamp_ns) for use in self._pending]
        self._last = None
        if self._group is not None:
            self._group = self._new_group()
            self._group.correction = self._correction

    def _apply(self, free_twin: Callable[[], FreeTwin | None]) -> None:
        if self._group is None:
            if not self._needed:
                return
            self._group = self._new_group()
            twin = free_twin()
            if twin is not None and self._last is not None:
                self._group.take_state(self._car, self._last)
                self._group.begin_with_twin(self._car, twin.state, twin.stamp_ns)
        self._group.correction = self._correction
        self._group.set_roles(self._roles)

    def start_anew(self, stamp_ns: int) -> None:
        """Follow the free twin that starts anew, unless a correction makes that needless."""
        if self._group is None or not (self._correction == "free" or self._lost):
            return
        self._group.start_anew(stamp_ns)
        if not self._needed and self._group.members[self._car].plain:
            self._group = None

    def advance(self, stamp_ns: int) -> None:
        """Step the group up to a state of the car."""
        if self._group is not None:
            self._group.advance(stamp_ns)

    def completed(self, sample: MirrorSample) -> MirrorSample:
        """Return the free twin's sample with what the group adds to it."""
        if self._group is None:
            return sample
        completed = with_group(
            sample, self._group, self._car, drive_frame=self._drive_frame, world_frame=self._frame
        )
        self._group.forget_touches()
        return completed
