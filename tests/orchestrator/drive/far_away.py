"""A worker on another machine, on a bus in memory: what it says of itself a test may change."""

from __future__ import annotations

import time
from typing import Any

import msgspec

from foretwin.contracts.bus import Mailbox, Request
from foretwin.contracts.fleet import (
    Admittance,
    ClockAnswer,
    ClockQuestion,
    Enlisted,
    EnlistRequest,
    MachineInfo,
)
from foretwin.orchestrator.record.machine import this_machine
from tests.orchestrator.house import House, Worker

FAR = "w-laptop-0"


class FarAway(Worker):
    """A worker on another machine; what it says of itself a test may change."""

    def __init__(self, house: House, worker_id: str = FAR, **told: Any) -> None:
        self.machine: MachineInfo = msgspec.structs.replace(this_machine(), **told)
        self.instance = worker_id
        self.clock_off_s = 0.0
        self.enlisted: list[EnlistRequest] = []
        self.admitted: list[str] = []
        self._house = house
        for channel in ("enlist", "admit", "clock"):
            ids = {"run": house.plan.run_id, "process": worker_id}
            house.bus.serve(channel, self._box(), **ids)
        super().__init__(house.plan, house.bus, worker_id)
        self._boxes.append(self.requests)

    def _box(self) -> Mailbox:
        self._boxes: list[Mailbox] = [*getattr(self, "_boxes", []), Mailbox(64)]
        return self._boxes[-1]

    def answer(self) -> None:
        """Answer whatever has been asked."""
        for box in self._boxes:
            while isinstance(request := box.take(), Request):
                self.answer_one(request)

    def answer_one(self, request: Request) -> None:
        message = request.message()
        if isinstance(message, EnlistRequest):
            self.enlisted.append(message)
            request.reply(Enlisted(instance=self.instance, machine=self.machine))
        elif isinstance(message, Admittance):
            self.admitted.append(message.refused)
            request.reply(message)
        elif isinstance(message, ClockQuestion):
            request.reply(ClockAnswer(utc_ns=time.time_ns() + round(1e9 * self.clock_off_s)))
        else:
            super().answer_one(request)


def settle(house: House, *far: FarAway, rounds: int = 12) -> None:
    """Let all answer, the drive look after its members, again and again."""
    for number in range(rounds):
        house.conductor.fleet.look(time.monotonic() + number)
        house.work()
        for one in far:
            one.answer()
        house.settle()
