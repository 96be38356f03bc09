"""A vehicle on the bus: the thin process under a recorded drive and under the stand-in car.

Nothing downstream can tell which of them, or a real car, sends.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import msgspec

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.bus import Bus, Mailbox, Received, Request
from foretwin.contracts.drive import AdvanceReply, DriveEnd, VehicleInfo, VehicleTime
from foretwin.contracts.guard import Refused
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.trace import traced
from foretwin.telemetry.anchored import world_from_lot_info, world_from_lot_message

_LATE_S = 0.005
"""What a sample may be late, so that those close to each other leave together."""
_MOST_AT_ONCE_NS = 200_000_000
_IDLE_S = 0.2
_LOOK_S = 0.02
"""Between two looks whether the orchestrator is there, or the run over."""

log = logging.getLogger("telemetry.vehicle")


class VehicleSource(Protocol):
    """Where samples come from: a recorded drive or a simulated car."""

    @property
    def info(self) -> VehicleInfo:
        """What is known of the vehicle before its first sample."""

    @property
    def first_stamp_ns(self) -> int:
        """Where the drive begins: the stamp that the clock starts at."""

    @property
    def next_stamp_ns(self) -> int:
        """When the next sample is due; once `ended`, of no meaning."""

    @property
    def ended(self) -> bool:
        """Whether the last sample has been given."""

    @property
    def skipped_invalid(self) -> int:
        """How many samples were refused so far."""

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, msgspec.Struct]]:
        """Yield (channel, message) up to and including the stamp, each once, in stamp order."""


class VehicleProcess:
    """Publishes a source, paced by the monotonic clock or in lock step, and answers questions.

    `speed` is drive seconds per wall second; None is lock step: samples follow `advance` requests
    alone. Where there is an `anchor`, the source is on a lot, and what is published in the World.
    `step` does what is due and returns whether to go on.
    """

    def __init__(
        self,
        source: VehicleSource,
        *,
        bus: Bus,
        life: ProcessLife,
        vehicle_id: str,
        speed: float | None,
        anchor: Anchor | None = None,
        mono_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Raises ValueError for a speed that is not positive."""
        if speed is not None and not speed > 0.0:
            raise ValueError(f"speed {speed} must be positive; leave it out for lock step")
        self._source = source
        self._bus, self._life = bus, life
        self._vehicle_id = vehicle_id
        self._speed, self._anchor = speed, anchor
        self._mono_s = mono_s
        self._mailbox = Mailbox(256)
        self._heard: dict[str, Callable[[Any], None]] = {}
        self._published: Counter[str] = Counter()
        self._last_stamp_ns = source.first_stamp_ns
        self._given_until_ns = source.first_stamp_ns
        self._started_s: float | None = None
        self._behind = False
        self._end_sent = False
        bus.serve("info", self._mailbox, vehicle=vehicle_id)
        bus.serve("vehicle_clock", self._mailbox, vehicle=vehicle_id)
        if speed is None:
            bus.serve("advance", self._mailbox, vehicle=vehicle_id)
        life.ready()

    @property
    def published(self) -> dict[str, int]:
        """Samples published so far by channel."""
        return dict(self._published)

    def hear(self, channel: str, take: Callable[[Any], None], **ids: str) -> None:
        """Hand on what is said on a channel; what the guard refuses is counted."""
        self._heard[channel] = take
        self._bus.subscribe(channel, self._mailbox, recover=False, **ids)

    def serve(self) -> None:
        """Be on the bus until the run is over; blocks."""
        while self.step():
            pass

    def step(self) -> bool:
        """Answer what was asked, publish what is due, wait a moment; return False to leave."""
        self._mailbox.gather(self._wait_s())
        item = self._mailbox.take()
        while item is not None:
            self._answer(item)
            item = self._mailbox.take()
        if self._life.over:
            return False
        if self._started_s is None and self._life.begun:
            log.info("the orchestrator is ready")
            self._started_s = self._mono_s()
        if self._speed is not None and self._started_s is not None and not self._end_sent:
            due_ns = self._now_ns(self._started_s, self._speed)
            # Questions are answered between portions, also by a source that cannot keep up.
            self._publish_until(min(due_ns, self._given_until_ns + _MOST_AT_ONCE_NS))
            self._behind = self._given_until_ns < due_ns
        return True

    def _now_ns(self, started_s: float, speed: float) -> int:
        elapsed_ns = int((self._mono_s() - started_s) * speed * 1e9)
        return self._source.first_stamp_ns + elapsed_ns

    def _wait_s(self) -> float:
        if self._speed is None or self._end_sent:
            return _IDLE_S
        if self._started_s is None:
            return _LOOK_S
        if self._behind:
            return 0.0
        ahead_ns = self._source.next_stamp_ns - self._now_ns(self._started_s, self._speed)
        return min(max(ahead_ns / self._speed * 1e-9, _LATE_S), _LOOK_S)

    def _answer(self, item: Any) -> None:
        match item:
            case Received(channel=channel) if channel in self._heard:
                try:
                    self._heard[channel](item.message())
                except Refused as refused:
                    if text := self._life.refusals.take(refused):
                        log.warning("%s", text)
            case Request(channel="info"):
                item.reply(world_from_lot_info(self._anchor, self._source.info))
            case Request(channel="vehicle_clock"):
                if self._started_s is None or self._speed is None:
                    item.refuse("no clock runs")
                else:
                    item.reply(VehicleTime(stamp_ns=self._now_ns(self._started_s, self._speed)))
            case Request(channel="advance"):
                try:
                    until_ns = item.message().until_stamp_ns
                except Refused as problem:
                    item.refuse(str(problem))
                    return
                self._publish_until(until_ns)
                item.reply(AdvanceReply(published=self.published, ended=self._end_sent))

    @traced("samples that are due")
    def _publish_until(self, until_stamp_ns: int) -> None:
        for channel, message in self._source.advance(until_stamp_ns):
            there = world_from_lot_message(self._anchor, message)
            self._bus.publish(channel, there, vehicle=self._vehicle_id)
            self._published[channel] += 1
            self._last_stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        self._given_until_ns = max(self._given_until_ns, until_stamp_ns)
        if self._source.ended and not self._end_sent:
            self._end_sent = True
            end = DriveEnd(
                stamp_ns=self._last_stamp_ns,
                published=self.published,
                skipped_invalid=self._source.skipped_invalid,
            )
            self._bus.publish("end", end, vehicle=self._vehicle_id)
            log.info("the drive is over after %s", self.published)


def serve_vehicle(
    source: VehicleSource,
    bus: Bus,
    life: ProcessLife,
    *,
    vehicle_id: str,
    speed: float | None,
    anchor: Anchor | None = None,
) -> None:
    """Put `source` on the bus until the run is over; blocks."""
    process = VehicleProcess(
        source, bus=bus, life=life, vehicle_id=vehicle_id, speed=speed, anchor=anchor
    )
    process.serve()
