"""Waits until all processes of a drive are on the bus, and the vehicle has said what it is."""

from __future__ import annotations

import errno
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass

from foretwin.contracts.bus import Bus, Mailbox, Reply
from foretwin.contracts.drive import InfoRequest
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.intake import unannounced
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.supervision import DriveError

START_TIMEOUT_S = 120.0
ASK_AGAIN_S = 0.1
"""So long after a question that nobody answered the vehicle is asked again what it is."""
LEAST_FREE_BYTES = 1_000_000
"""With less than this left on the disk it is the disk that kept a process from starting."""


@dataclass(frozen=True, slots=True)
class Joining:
    """The beginning of one drive; `look_after` is called again and again meanwhile."""

    bus: Bus
    conductor: Conductor
    watch: ProcessWatch
    look_after: Callable[[Conductor, float], None]
    stop: Callable[[], bool]

    def all_there(self) -> bool:
        """Wait for all; False where it was stopped.

        Raises DriveError where one stays away, UserError where that is since the disk is full.
        """
        conductor = self.conductor
        expected = conductor.strangers.expected
        deadline = time.monotonic() + START_TIMEOUT_S
        while not expected <= conductor.alive.keys():
            self.look_after(conductor, time.monotonic())
            if self.stop():
                return False
            missing = ", ".join(sorted(expected - conductor.alive.keys()))
            if self.watch.given_up & expected:
                dead = ", ".join(sorted(self.watch.given_up & expected))
                raise self._no_start(f"cannot be started: {dead}; see log.jsonl")
            if time.monotonic() > deadline:
                text = f"not up after {START_TIMEOUT_S:.0f} s: {missing}; see log.jsonl"
                raise self._no_start(text)
            conductor.handle(conductor.mailbox.take(0.1))
        return self._ask_info(deadline)

    def _no_start(self, text: str) -> Exception:
        """Return what to say of processes that stay away: of a full disk, that it is full."""
        plan = self.conductor.plan
        if shutil.disk_usage(plan.folder).free >= LEAST_FREE_BYTES:
            return DriveError(text)
        return UserError(f"--out {plan.config.out}: {os.strerror(errno.ENOSPC).lower()}")

    def _ask_info(self, deadline: float) -> bool:
        conductor, config = self.conductor, self.conductor.plan.config
        live = config.resolved_source == "live"
        answers = Mailbox(4)
        while not self.stop():
            heard_ns = conductor.intake.first_stamp_ns
            self.bus.request(
                "info", InfoRequest(), answers, timeout_s=2.0, vehicle=config.vehicle_id
            )
            reply = answers.take(3.0)
            if isinstance(reply, Reply) and reply.message is not None:
                conductor.take_info(reply.message)
                return True
            # A live car need not know our question: one that was there when it was asked does not.
            # A gateway knows it, and the antenna's place.
            if live and heard_ns is not None and conductor.plan.ros2 is None:
                conductor.take_info(unannounced(config.vehicle_id, heard_ns))
                return True
            if not live and time.monotonic() > deadline:
                raise DriveError("the vehicle does not say what it is; see log.jsonl")
            time.sleep(ASK_AGAIN_S)  # where nobody is there, that is said at once
            if live:  # it may start when it likes
                while (item := conductor.mailbox.take()) is not None:
                    conductor.handle(item)
                self.look_after(conductor, time.monotonic())
        return False
