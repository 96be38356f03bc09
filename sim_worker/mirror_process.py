"""The mirror on the bus: states, commands and the active World in, samples out."""

from __future__ import annotations

import logging
import time
from pathlib import Path

from contracts.bus import Bus, Mailbox, Received
from contracts.drive import ControlCommand, VehicleState
from contracts.process import ProcessLife
from contracts.setup import WorkerSetup
from contracts.simulation import ActiveWorld
from sim_worker.twin import Mirror
from sim_worker.worker import load_world

_DEPTH = 4096
_IDLE_S = 0.2
_LAST_WORDS_S = 0.5
"""How long the messages that are already here may take once the run is over."""

log = logging.getLogger("sim_worker")


class MirrorWorker:
    """Feeds a Mirror from messages; a message that cannot be used is logged and passed over."""

    def __init__(self, setup: WorkerSetup, bus: Bus) -> None:
        self._run_id = setup.run_id
        self._worlds_dir = Path(setup.worlds_dir)
        self._bus = bus
        self._mirror = Mirror(
            setup.vehicle,
            drive_frame=setup.drive_frame,
            window_s=setup.mirror_window_s,
            rate_hz=setup.mirror_rate_hz,
            commands_recorded=setup.commands_recorded,
        )

    def handle(self, received: Received) -> None:
        """Take one message; never raises."""
        try:
            message = received.message()
            if isinstance(message, VehicleState):
                sample = self._mirror.handle_state(message)
                if sample is not None:
                    self._bus.publish("mirror", sample, run=self._run_id)
            elif isinstance(message, ControlCommand):
                self._mirror.handle_command(message)
            elif isinstance(message, ActiveWorld):
                self._change_world(message)
        except Exception:
            log.exception("message on %s passed over", received.key)

    def _change_world(self, active: ActiveWorld) -> None:
        world = None
        if active.world_id is not None:
            world = load_world(self._worlds_dir, active.world_id)
        self._mirror.set_world(world, from_stamp_ns=active.stamp_ns)


def serve_mirror(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Mirror the car until the run is over, then finish what has arrived."""
    mailbox = Mailbox(_DEPTH, when_full="block" if setup.bus.lossless else "drop_oldest")
    worker = MirrorWorker(setup, bus)
    bus.subscribe("active_world", mailbox, run=setup.run_id)
    bus.subscribe("control", mailbox, vehicle=setup.vehicle_id)
    bus.subscribe("state", mailbox, vehicle=setup.vehicle_id)
    life.ready()
    while not life.over:
        _take(worker, mailbox, _IDLE_S)
    deadline = time.monotonic() + _LAST_WORDS_S
    while time.monotonic() < deadline and _take(worker, mailbox, 0.0):
        pass
    if mailbox.dropped:
        log.warning("the mirror fell behind and passed over %d messages", mailbox.dropped)


def _take(worker: MirrorWorker, mailbox: Mailbox, timeout_s: float) -> bool:
    item = mailbox.take(timeout_s)
    if isinstance(item, Received):
        worker.handle(item)
    return item is not None
