"""The mirror on the bus: states, commands and the active World in, samples out."""

from __future__ import annotations

import logging
from collections import deque
from pathlib import Path

from foretwin.contracts.bus import Bus, Mailbox, Received, Request
from foretwin.contracts.drive import ControlCommand, VehicleState
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.roles import OtherVehicles, UseRoles
from foretwin.contracts.setup import WorkerSetup
from foretwin.contracts.simulation import ActiveWorld
from foretwin.contracts.tuning import UseVehicle
from foretwin.sim_worker.message_loop import passed_over_where_unfit, take_messages
from foretwin.sim_worker.mirror.mirror import Mirror
from foretwin.sim_worker.vehicle.commands import STEP_BACK_NS
from foretwin.sim_worker.world_file import load_world

_DEPTH = 4096
_GATHER_S = 0.05
"""States are taken in portions: a sample of the mirror is made of several."""

log = logging.getLogger("sim_worker")


class MirrorWorker:
    """Feeds a Mirror from messages; a message that cannot be used is logged and passed over.

    In lock step a state waits until the commands up to its stamp are there: they come from
    another process, and results must not depend on which is faster. So it does for the other
    vehicles: the bus keeps no order between keys.
    """

    def __init__(self, setup: WorkerSetup, bus: Bus, *, refusals: Refusals | None = None) -> None:
        self._run_id = setup.run_id
        self._refusals = Refusals() if refusals is None else refusals
        self._worlds_dir = Path(setup.worlds_dir)
        self._bus = bus
        self._waits = setup.bus.lossless and setup.commands_recorded
        self._held: deque[VehicleState] = deque()
        self._commanded_ns: int | None = None
        self._waits_for_others = setup.bus.lossless and bool(setup.mirror_cast.others)
        self._others: deque[OtherVehicles] = deque()
        assert setup.drive_frame is not None
        self._mirror = Mirror(
            setup.vehicle,
            drive_frame=setup.drive_frame,
            window_s=setup.mirror_window_s,
            rate_hz=setup.mirror_rate_hz,
            commands_recorded=setup.commands_recorded,
            vehicle_id=setup.vehicle_id,
            cast=setup.mirror_cast,
        )

    def handle(self, item: Received | Request) -> None:
        """Take one message or question; never raises."""
        with passed_over_where_unfit(item, refusals=self._refusals, log=log):
            message = item.message()
            match message:
                case VehicleState():
                    self._held.append(message)
                case OtherVehicles():
                    self._others.append(message)
                case ControlCommand():
                    if message.stamp_ns < (self._commanded_ns or 0) - STEP_BACK_NS:
                        # No more commands of the old clock will come.
                        self._release(everything=True)
                    self._mirror.handle_command(message)
                    self._commanded_ns = message.stamp_ns
                case ActiveWorld():
                    self._change_world(message)
                case UseVehicle():
                    self._mirror.use_vehicle(message.vehicle, from_stamp_ns=message.stamp_ns)
                case UseRoles():
                    self._mirror.set_roles(message)
            if isinstance(item, Request):
                item.reply(message)
            else:
                self._release()

    def finish(self) -> None:
        """Handle the states that still wait for commands: none will come."""
        self._release(everything=True)

    def _release(self, *, everything: bool = False) -> None:
        while self._held and (everything or self._complete(self._held[0])):
            state = self._held.popleft()
            while self._others and self._others[0].stamp_ns <= state.stamp_ns:
                for other in self._others.popleft().heard:
                    self._mirror.handle_other(other)
            sample = self._mirror.handle_state(state)
            if sample is not None:
                self._bus.publish("mirror", sample, run=self._run_id)

    def _complete(self, state: VehicleState) -> bool:
        """Whether all is there that a state must wait for."""
        stamp_ns, told_ns = state.stamp_ns, self._commanded_ns
        human = state.control_mode == "manual"  # no command moves the car, if any comes
        commanded = human or (told_ns is not None and stamp_ns <= told_ns)
        accompanied = bool(self._others) and stamp_ns <= self._others[-1].stamp_ns
        return (commanded or not self._waits) and (accompanied or not self._waits_for_others)

    def _change_world(self, active: ActiveWorld) -> None:
        world = None
        if active.world_id is not None:
            world = load_world(self._worlds_dir, active.world_id)
        self._mirror.set_world(world, from_stamp_ns=active.stamp_ns)


def serve_mirror(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Mirror the car until the run is over, then finish what has arrived."""
    mailbox = Mailbox(_DEPTH, when_full="block" if setup.bus.lossless else "drop_oldest")
    worker = MirrorWorker(setup, bus, refusals=life.refusals)
    for channel in ("use_world", "use_vehicle", "use_roles"):
        bus.serve(channel, mailbox, run=setup.run_id, process=setup.process_id)
    bus.subscribe("other_vehicles", mailbox, run=setup.run_id)
    bus.subscribe("control", mailbox, vehicle=setup.vehicle_id)
    bus.subscribe("state", mailbox, vehicle=setup.vehicle_id)
    life.ready()
    lossless = setup.bus.lossless
    take_messages(mailbox, worker.handle, life, lossless=lossless, gather_s=_GATHER_S)
    worker.finish()
    if mailbox.dropped:
        log.warning("the mirror fell behind and passed over %d messages", mailbox.dropped)
