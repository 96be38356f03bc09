"""Identification and the gap on the bus: samples and states in, findings out."""

from __future__ import annotations

import logging
import time
from collections import Counter
from pathlib import Path
from typing import Any

from foretwin.contracts.bus import Bus, Mailbox, Received, Reply, Request
from foretwin.contracts.drive import InfoRequest, VehicleInfo
from foretwin.contracts.errors import one_line
from foretwin.contracts.gap import GapAlarm, GapSample, Verdict
from foretwin.contracts.guard import Refused
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.setup import TuningSetup
from foretwin.contracts.trace import item_name, span
from foretwin.contracts.tuning import Identification, TuneReply, TuneRequest, UseVehicle
from foretwin.geometry.slopes import read_slopes
from foretwin.sim_worker.analysis.tuning import SAMPLES, VehicleWatch

_DEPTH = 16384
_IDLE_S = 0.2
_GATHER_S, _AT_ONCE = 0.05, 500
"""Messages are taken in portions: waking up for each of them costs more than keeping it."""
_LAST_WORDS_S = 1.0
"""How long the messages that are already here may take once the run is over."""
_ASK_EVERY = 2000
"""Samples between two questions to a vehicle that has not said what it is."""
_UNANNOUNCED_AFTER = 4000
"""Samples after which a vehicle that does not answer is taken as it is."""
_CHANNELS = (*SAMPLES, "state")
"""In the order in which messages with one stamp are taken."""
_FINDINGS: dict[type, tuple[str, str]] = {
    Identification: ("identification", "identifications"),
    GapSample: ("gap", "gaps"),
    GapAlarm: ("gap_alarm", "alarms"),
    Verdict: ("verdict", "verdicts"),
}
"""The channel of each kind of finding, and its field in the answer to a `tune` question."""

log = logging.getLogger("sim_worker")


class TuningWorker:
    """Feeds a VehicleWatch from messages; one that cannot be used is logged and passed over.

    In lock step messages wait for a `tune` question, which says how many there are, and are taken
    in the order of their stamps: the answer must not depend on which came first.
    """

    def __init__(
        self, setup: TuningSetup, bus: Bus, mailbox: Mailbox, *, refusals: Refusals | None = None
    ) -> None:
        self._setup = setup
        self._refusals = Refusals() if refusals is None else refusals
        self._bus = bus
        self._mailbox = mailbox
        self._lock_step = setup.bus.lossless
        self._roads = None if setup.slopes is None else read_slopes(Path(setup.slopes))
        self._held: list[tuple[tuple[int, int, int], str, Any]] = []
        self._received: Counter[str] = Counter()
        self._asked_for_info = 0
        self._watch: Any = None
        self._used: UseVehicle | None = None
        self._question: Request | None = None

    def handle(self, item: Any) -> None:
        """Take one item of the mailbox; never raises."""
        try:
            match item:
                case Received():
                    self._take(item)
                case Reply(channel="info", message=VehicleInfo() as info):
                    self._begin(info)
                case Request(channel="tune"):
                    self._question = item
                case Request(channel="use_vehicle"):
                    self._use(item)
            self._answer_if_all_is_there()
        except Refused as refused:
            if text := self._refusals.take(refused):
                log.warning("%s", text)
            if isinstance(item, Request):
                self._question = None if item is self._question else self._question
                item.refuse(one_line(refused))
        except Exception as error:
            log.exception("%s passed over", getattr(item, "key", item))
            if isinstance(item, Request):
                self._question = None if item is self._question else self._question
                item.refuse(one_line(error))

    def _take(self, item: Received) -> None:
        try:
            envelope = item.envelope()
        finally:
            self._received[item.channel] += 1
        message = envelope.message
        place = (message.stamp_ns, _CHANNELS.index(item.channel), envelope.seq)
        if self._watch is None:
            self._ask_for_info()
        if self._lock_step or self._watch is None:
            self._held.append((place, item.channel, message))
        else:
            self._weigh(item.channel, message)

    def _ask_for_info(self) -> None:
        """Ask the vehicle what it is, once its samples show that it is there."""
        received = self._received.total()
        if not self._lock_step and received >= _UNANNOUNCED_AFTER:
            self._begin(
                VehicleInfo(vehicle_id=self._setup.vehicle_id, time_base="utc", start_stamp_ns=0)
            )
        elif received > self._asked_for_info:
            self._asked_for_info = received + _ASK_EVERY
            self._bus.request(
                "info", InfoRequest(), self._mailbox, timeout_s=5.0, vehicle=self._setup.vehicle_id
            )

    def _begin(self, info: VehicleInfo) -> None:
        if self._watch is not None:
            return
        self._watch = VehicleWatch(
            info, self._setup.vehicle, frame=self._setup.drive_frame, roads=self._roads
        )
        if self._used is not None:
            self._watch.use(self._used)
        if not self._lock_step:
            held, self._held = self._held, []
            for _, channel, message in held:
                self._weigh(channel, message)

    def _use(self, request: Request) -> None:
        message: UseVehicle = request.message()
        self._used = message
        if self._watch is not None:
            self._watch.use(message)
        log.info("parameters %d count", message.version)
        request.reply(message)

    def _weigh(self, channel: str, message: Any) -> list[Any]:
        """Take one message and publish what follows; a fault in one costs that one alone."""
        try:
            found: list[Any] = self._watch.handle(channel, message)
        except Exception:
            log.exception("%s at %s passed over", channel, message.stamp_ns)
            return []
        for one in found:
            self._bus.publish(_FINDINGS[type(one)][0], one, run=self._setup.run_id)
        return found

    def _answer_if_all_is_there(self) -> None:
        if self._question is None:
            return
        asked: TuneRequest = self._question.message()
        counts = asked.published | {"state": asked.states}
        missing = any(self._received[name] < counts.get(name, 0) for name in _CHANNELS)
        if missing or (self._watch is None and self._held):
            return
        question, self._question = self._question, None
        # On a busy machine some of what the car sends in the next step is here already.
        due = [one for one in self._held if one[0][2] < counts.get(one[1], 0)]
        self._held = [one for one in self._held if one[0][2] >= counts.get(one[1], 0)]
        held = sorted(due, key=lambda one: one[0])
        by_field: dict[str, list[Any]] = {field: [] for _, field in _FINDINGS.values()}
        for _, channel, message in held:
            for finding in self._weigh(channel, message):
                by_field[_FINDINGS[type(finding)][1]].append(finding)
        question.reply(TuneReply(**{field: tuple(one) for field, one in by_field.items()}))


def serve_tuning(setup: TuningSetup, bus: Bus, life: ProcessLife) -> None:
    """Watch the vehicle until the run is over."""
    mailbox = Mailbox(_DEPTH, when_full="block" if setup.bus.lossless else "drop_oldest")
    worker = TuningWorker(setup, bus, mailbox, refusals=life.refusals)
    for channel in ("use_vehicle", "tune"):
        bus.serve(channel, mailbox, run=setup.run_id, process=setup.process_id)
    for channel in _CHANNELS:
        bus.subscribe(channel, mailbox, vehicle=setup.vehicle_id)
    life.ready()
    while not life.over:
        _take(worker, mailbox, _IDLE_S)
        if not setup.bus.lossless:
            time.sleep(_GATHER_S)
    deadline_s = time.monotonic() + _LAST_WORDS_S
    while time.monotonic() < deadline_s and len(mailbox):
        _take(worker, mailbox, 0.0, most=1)
    if mailbox.dropped:
        log.warning("tuning fell behind and passed over %d messages", mailbox.dropped)


def _take(
    worker: TuningWorker, mailbox: Mailbox, timeout_s: float, *, most: int = _AT_ONCE
) -> None:
    for taken in range(most):
        item = mailbox.take(0.0 if taken else timeout_s)
        if item is None:
            return
        with span(item_name(item)):
            worker.handle(item)


if __name__ == "__main__":
    run_process(TuningSetup, serve_tuning)
