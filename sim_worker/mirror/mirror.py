"""The mirror of the real car: shadow and ghost at its pose, the twin under its commands."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlCommand, VehicleState
from foretwin.contracts.frames import LocalFrame, wrap_angle
from foretwin.contracts.gap import STATE_STDS, limits_after
from foretwin.contracts.roles import MirrorCast, OtherVehicle, UseRoles
from foretwin.contracts.simulation import MirrorSample, PlaneState
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.mirror.member import STEP_NS, GroupMember
from foretwin.sim_worker.mirror.role_manager import FreeTwin, RoleManager
from foretwin.sim_worker.mirror.role_world import RoleWorld
from foretwin.sim_worker.mirror.samples import plane_state
from foretwin.sim_worker.mirror.track import Track
from foretwin.sim_worker.vehicle.commands import STEP_BACK_NS, CommandMemory, TwinCommand
from foretwin.sim_worker.vehicle.parameters import check_vehicle
from foretwin.sim_worker.vehicle.planar import MAX_STEERING_DELAY_S
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

_ALONE = MirrorCast()
_GRID_TOLERANCE = 0.05
"""Of a sample period: how early a state may be and still count for its instant."""
_SURE_YAW_STD_RAD = limits_after(0.0)["yaw_rad"] / STATE_STDS
"""A twin that started with a heading less sure than this departs by that alone."""


class Mirror:
    """Steps the twin along with the measured states of one car; no clock, no bus.

    The free twin starts from the measured state, runs on commands alone, and starts anew after each
    `window_s`, in each new World, where its physics diverged, where it runs into what stands, and
    once the heading that it started with is surer: what it loses there says nothing of the model.
    It never teleports otherwise. All gaps are its own. Roles, corrections and other vehicles need
    a `VehicleGroup` beside it, which is there only as long as something asks for it. States must
    come in time order; a command counts from its stamp on and should come before the first state
    after it.
    """

    def __init__(
        self,
        vehicle: VehicleParameters,
        *,
        drive_frame: LocalFrame,
        window_s: float = 8.0,
        rate_hz: float = 10.0,
        commands_recorded: bool = False,
        vehicle_id: str = "ego",
        cast: MirrorCast = _ALONE,
    ) -> None:
        self._vehicle_id, self._vehicle = vehicle_id, vehicle
        self._drive_frame = drive_frame
        self._window_ns = round(window_s * 1e9)
        self._period_ns = 1e9 / rate_hz
        self._recorded = commands_recorded
        self._commands = CommandMemory(vehicle, keep_s=MAX_STEERING_DELAY_S + 1.0)
        self._pending: list[tuple[int, World | None]] = []
        self._pending_vehicles: list[tuple[int, VehicleParameters]] = []
        self._world_id: str | None = None
        self._met: frozenset[tuple[str, str]] = frozenset()
        """What the free twin has just run into: it starts anew with the state that is due."""
        self._touches = self._met
        """The same since the last sample."""
        self._frame = drive_frame
        self._build(None)
        self._track = self._new_track()
        self._role_manager = RoleManager(
            GroupMember(vehicle_id, vehicle, commands_recorded),
            cast,
            drive_frame=drive_frame,
            commands=self._commands,
        )
        self._map_shift_m = self._seed_map_shift_m = np.zeros(2)
        self._is_sure = self._seed_is_sure = True
        self._seed_stamp_ns = 0
        self._steps = 0
        self._independent = False
        self._first_stamp_ns: int | None = None
        self._last_index = -1

    def _build(self, world: World | None) -> None:
        name = self._vehicle_id
        commanded = frozenset({name} if self._recorded else ())
        self._world = RoleWorld(world, {name: self._vehicle}, commanded=commanded)
        self._world.set_role(name, "all")
        self._twin = self._world.twins[name]

    def _new_track(self) -> Track:
        return Track(self._vehicle, self._frame, continuous_ns=self._window_ns)

    def set_world(self, world: World | None, *, from_stamp_ns: int = 0) -> None:
        """Use `world`, or open ground, from the first state at or after `from_stamp_ns` on."""
        self._pending.append((from_stamp_ns, world))

    def use_vehicle(self, vehicle: VehicleParameters, *, from_stamp_ns: int = 0) -> None:
        """Give the twin these parameters from the first state at or after `from_stamp_ns` on.

        Raises ValueError for what is no road vehicle any more.
        """
        check_vehicle(vehicle, before=self._vehicle)
        self._pending_vehicles.append((from_stamp_ns, vehicle))

    def handle_command(self, command: ControlCommand) -> None:
        """Take a command of the car; ignored where none are expected."""
        if self._recorded:
            self._commands.add(command)

    def set_roles(self, use: UseRoles) -> None:
        """Let roles and correction count from the first state at or after their stamp on."""
        self._role_manager.set_roles(use)

    def handle_other(self, other: OtherVehicle) -> None:
        """Take where another vehicle was measured, and what was commanded."""
        self._role_manager.take_other(other)

    def handle_state(self, state: VehicleState) -> MirrorSample | None:
        """Step the twin up to the state; returns a sample where one is due.

        States without a known heading and out of time order are passed over; after a step of the
        car's clock back by a second or more everything begins anew. Raises ValueError for a state
        that is not finite.
        """
        if not state.yaw_valid:
            return None
        last = self._track.latest
        if last is not None and state.stamp_ns < last.stamp_ns - STEP_BACK_NS:
            # Worlds that were to come by the old clock are due: their time has passed.
            self._pending = [(state.stamp_ns, world) for _, world in self._pending]
            self._first_stamp_ns, self._last_index = None, -1
            self._track, last = self._new_track(), None
        if last is not None and state.stamp_ns <= last.stamp_ns:
            return None
        self._change_vehicle(state.stamp_ns)
        self._change_world(state.stamp_ns)
        self._is_sure = (state.yaw_std_rad or 0.0) <= _SURE_YAW_STD_RAD
        self._track.take(state)
        if state.control_mode == "manual":
            self._commands.human_drives(state.stamp_ns)
        measured, before = self._track.state(), self._track.before
        self._map_shift_m = np.array(state.map_shift_m or (0.0, 0.0))
        self._role_manager.before(state, self._free_twin)
        if before is None or state.stamp_ns - before.stamp_ns > self._window_ns:
            self._seed(measured, state.stamp_ns)
        else:
            self._advance(state.stamp_ns)
        self._world.place(self._vehicle_id, measured[:3])
        self._touches |= self._met
        surer = self._is_sure and not self._seed_is_sure
        if self._met or surer or not np.isfinite(self._twin.state).all():
            self._seed(measured, state.stamp_ns)
        self._role_manager.advance(state.stamp_ns)
        sample = self._sample(state, measured) if self._due(state.stamp_ns) else None
        if sample is not None and self._touches:
            touches = tuple(sorted({*sample.touches, *self._touches}))
            sample, self._touches = msgspec.structs.replace(sample, touches=touches), frozenset()
        if state.stamp_ns - self._seed_stamp_ns >= self._window_ns:
            self._seed(measured, state.stamp_ns)
        return sample

    def _change_vehicle(self, stamp_ns: int) -> None:
        due = [vehicle for stamp, vehicle in self._pending_vehicles if stamp <= stamp_ns]
        if not due:
            return
        self._pending_vehicles = [one for one in self._pending_vehicles if one[0] > stamp_ns]
        self._vehicle = self._track.vehicle = due[-1]
        self._commands.use_vehicle(self._vehicle)
        self._world.use_vehicle(self._vehicle_id, self._vehicle)
        self._role_manager.use_vehicle(self._vehicle)

    def _change_world(self, stamp_ns: int) -> None:
        due = [world for stamp, world in self._pending if stamp <= stamp_ns]
        if not due:
            return
        self._pending = [entry for entry in self._pending if entry[0] > stamp_ns]
        world = due[-1]
        world_id = None if world is None else world.id
        if world_id == self._world_id:
            return
        self._world_id = world_id
        self._frame = self._drive_frame if world is None else world.frame
        self._build(world)
        self._role_manager.change_world(world, self._frame)
        self._track = self._new_track()

    def _seed(self, measured: Array, stamp_ns: int) -> None:
        history = self._commands.angles_before(
            stamp_ns, count=self._twin.history_samples, step_ns=STEP_NS
        )
        self._world.place(self._vehicle_id, measured[:3])
        self._world.reset()
        self._twin.seed(measured, steering_history_rad=history)
        self._seed_stamp_ns, self._steps = stamp_ns, 0
        self._met = frozenset()
        self._seed_map_shift_m = self._map_shift_m
        self._seed_is_sure = self._is_sure
        self._role_manager.start_anew(stamp_ns)
        self._independent = self._recorded and history is not None and not self._commands.estimated

    def _advance(self, stamp_ns: int) -> None:
        """Step in whole physics steps, moving the shadow evenly towards its measured pose."""
        guess = self._track.command(self._twin.slopes)
        total = (stamp_ns - self._seed_stamp_ns) // STEP_NS
        while self._steps < total:
            now_ns = self._seed_stamp_ns + self._steps * STEP_NS
            command = self._command(now_ns, guess)
            self._world.place(self._vehicle_id, self._track.at(now_ns + STEP_NS).pose)
            self._twin.command(accel_mps2=command.accel_mps2, tire_angle_rad=command.tire_angle_rad)
            self._world.step()
            self._twin.read()
            self._steps += 1
            if found := self._world.contacts():
                self._met = frozenset(found)
                break
        self._commands.forget_before(stamp_ns)

    def _command(self, stamp_ns: int, guess: TwinCommand) -> TwinCommand:
        command = self._commands.at(stamp_ns) if self._recorded else None
        if command is None:
            self._independent = False
            return guess
        return command

    def _free_twin(self) -> FreeTwin | None:
        if self._track.before is None:
            return None
        stamp_ns = self._seed_stamp_ns + self._steps * STEP_NS
        return FreeTwin(self._twin.state, stamp_ns)

    def _due(self, stamp_ns: int) -> bool:
        if self._first_stamp_ns is None:
            self._first_stamp_ns = stamp_ns
        index = int((stamp_ns - self._first_stamp_ns) / self._period_ns + _GRID_TOLERANCE)
        due = index > self._last_index
        self._last_index = max(index, self._last_index)
        return due

    def _sample(self, state: VehicleState, measured: Array) -> MirrorSample:
        twin = self._twin_at(state.stamp_ns)
        box = self._in_drive_frame(self._world.box_pose(self._vehicle_id), measured[3])
        # What a map has moved the position by since is no motion that the twin lacks.
        shift = self._map_shift_m - self._seed_map_shift_m
        dx, dy = twin[:2] - measured[:2] + shift
        cos, sin = np.cos(measured[2]), np.sin(measured[2])
        sample = MirrorSample(
            stamp_ns=state.stamp_ns,
            world_id=self._world_id,
            real=self._in_drive_frame(measured[:3], measured[3]),
            twin=self._in_drive_frame(twin[:3], twin[3]),
            shadow=box,
            ghost=box,
            gap_m=float(np.hypot(dx, dy)),
            gap_along_m=float(cos * dx + sin * dy),
            gap_across_m=float(cos * dy - sin * dx),
            gap_yaw_rad=float(wrap_angle(twin[2] - measured[2])),
            gap_speed_mps=float(twin[3] - measured[3]),
            since_reset_s=(state.stamp_ns - self._seed_stamp_ns) / 1e9,
            independent=self._independent,
            twin_yaw_rate_radps=float(twin[5]),
        )
        return self._role_manager.completed(sample)

    def _twin_at(self, stamp_ns: int) -> Array:
        """Return the twin's state (8,), carried on by the part of a step that is left."""
        twin = self._twin.state
        left_s = (stamp_ns - self._seed_stamp_ns) / 1e9 - self._steps * TIMESTEP_S
        cos, sin = np.cos(twin[2]), np.sin(twin[2])
        twin[0] += left_s * (cos * twin[3] - sin * twin[4])
        twin[1] += left_s * (sin * twin[3] + cos * twin[4])
        twin[2] += left_s * twin[5]
        return twin

    def _in_drive_frame(self, pose: Array, speed_mps: float) -> PlaneState:
        return plane_state(pose, speed_mps, drive_frame=self._drive_frame, world_frame=self._frame)
