"""The stand-in car on its lot in real time: it says its samples, hears of objects, and brakes.

It is where a real car with Autoware would be: by the same mapping file that the gateway reads, it
publishes what `[[in]]` listens to, and listens to the objects that `[[out]]` sends towards a car.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.anchor import Anchor
from foretwin.contracts.errors import UserError
from foretwin.contracts.foreign_bus import ForeignBus
from foretwin.contracts.mailbox import Mailbox
from foretwin.telemetry.anchored import world_from_lot_message
from foretwin.telemetry.lot_car.ros_voice import RosVoice
from foretwin.telemetry.ros2.inwards import Inwards
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.rows import InRow, OutRow
from foretwin.telemetry.ros2.sender import RosSender
from foretwin.telemetry.standin.source import StandinSource

_FORGETS_NS = 1_000_000_000
"""A list of objects that is older says nothing of now."""
_STANDS_MPS = 0.05
log = logging.getLogger("lot_car")


class LotReport(msgspec.Struct, frozen=True, kw_only=True):
    """What a drive on the lot came to, in metres of the lot; times from the stamp of a list to its
    arrival here."""

    lists: int
    """Lists of objects that were heard."""
    latency_ms_p50: float | None
    latency_ms_p95: float | None
    brakes: tuple[str, ...]
    """What those are for whom it braked, in order."""
    braked_at_m: float | None
    """From the bumper to the first of them, as it began to brake."""
    stood_before_m: float | None
    """From the bumper to whom it stood before: the least of all."""
    driven_m: float
    """Along its path."""


def heard_objects(mapping: Mapping) -> InRow:
    """Return what a car hears of objects; raises UserError where a mapping sends it none."""
    for row in mapping.outwards:
        if row.source == "virtual_objects" and row.towards_vehicle:
            return InRow(topic=row.topic, type=row.type, channel="objects")
    raise UserError('the mapping has no [[out]] of source "virtual_objects" towards the vehicle')


class LotCar:
    """Does what is due with each `step`; owns no bus."""

    def __init__(
        self,
        mapping: Mapping,
        source: StandinSource,
        *,
        foreign: ForeignBus,
        steering_ratio: float,
        anchor: Anchor | None = None,
        mono_ns: Callable[[], int] = time.monotonic_ns,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Stand at the path's beginning until the first list of objects has come.

        With an `anchor` the source lives in the World: what it says is moved to its lot, and made
        smaller there, as it would be measured on a car of that scale.
        """
        self._source, self._mono_ns = source, mono_ns
        self._anchor = anchor
        self._lot_anchor = None if anchor is None else anchor.turned_round
        self._scale = 1.0 if anchor is None else anchor.scale
        self._voice = RosVoice(mapping, steering_ratio=steering_ratio)
        self._sender = RosSender(mapping, foreign, wall_ns=wall_ns)
        heard = msgspec.structs.replace(mapping, inwards=(heard_objects(mapping),), outwards=())
        self._inwards, self._inbox = Inwards(heard), Mailbox(64)
        for key, history, _ in self._inwards.key_expressions():
            foreign.subscribe(key, self._inbox, history=history)
        self._began_mono_ns = mono_ns()
        # The stand-in's own time begins at a fixed day; here it is that of the machine.
        self._later_ns = wall_ns() - source.first_stamp_ns
        self._latencies_ms: list[float] = []
        self._heard_mono_ns = 0
        self._brakes: dict[str, str] = {}
        self._braked_at_m: float | None = None
        self._stood_before_m: float | None = None
        source.hold(True)

    @property
    def ended(self) -> bool:
        """Whether the path is at its end."""
        return self._source.ended

    def step(self, wait_s: float = 0.02) -> None:
        """Wait for a list of objects, no longer than until samples are due; drive, and say them."""
        due_in_ns = self._source.next_stamp_ns - self._stamp_ns(self._mono_ns())
        item: Any = self._inbox.take(min(wait_s, max(0.0, due_in_ns * 1e-9)))
        while item is not None:
            for _, message in self._inwards.take(item):
                self._hear(message, item.received_wall_ns)
            item = self._inbox.take()
        now_ns = self._mono_ns()
        if now_ns - self._heard_mono_ns > _FORGETS_NS:
            self._source.see((), stamp_ns=self._source.first_stamp_ns)
        for channel, sample in self._source.advance(self._stamp_ns(now_ns)):
            stamp_ns = sample.stamp_ns + self._later_ns
            on_lot = world_from_lot_message(self._lot_anchor, sample)
            for row, payload in self._voice.say(
                channel, msgspec.structs.replace(on_lot, stamp_ns=stamp_ns)
            ):
                self._sender.put(OutRow(topic=row.topic, type=row.type, source="state"), payload)
        self._watch()

    def _stamp_ns(self, mono_ns: int) -> int:
        return self._source.first_stamp_ns + mono_ns - self._began_mono_ns

    def report(self) -> LotReport:
        """Return what it came to so far."""
        late = np.percentile(self._latencies_ms, (50, 95)) if self._latencies_ms else (None, None)
        p50, p95 = (None if one is None else round(float(one), 2) for one in late)
        return LotReport(
            lists=len(self._latencies_ms),
            latency_ms_p50=p50,
            latency_ms_p95=p95,
            brakes=tuple(self._brakes.values()),
            braked_at_m=self._braked_at_m,
            stood_before_m=self._stood_before_m,
            driven_m=round(self._source.s_m / self._scale, 2),
        )

    def _hear(self, message: Any, received_ns: int) -> None:
        assert isinstance(message, drive.RoadUsers)
        if not self._latencies_ms:
            log.info("hears of objects, and sets off")
        self._source.hold(False)
        self._latencies_ms.append((received_ns - message.stamp_ns) * 1e-6)
        self._heard_mono_ns = self._mono_ns()
        there = world_from_lot_message(self._anchor, message)
        self._source.see(there.users, stamp_ns=message.stamp_ns - self._later_ns)

    def _watch(self) -> None:
        ahead, speed_mps = self._source.ahead, self._source.speed_mps / self._scale
        if ahead is None or not (self._source.brakes or self._brakes):
            return
        kind, left_m = ahead.user.kind, round(ahead.gap_m(self._source.s_m) / self._scale, 2)
        if self._source.brakes and ahead.user.user_id not in self._brakes:
            log.info("brakes for a %s %.2f m ahead, at %.2f m/s", kind, left_m, speed_mps)
            self._brakes[ahead.user.user_id] = kind
            self._braked_at_m = left_m if self._braked_at_m is None else self._braked_at_m
        if self._source.speed_mps < _STANDS_MPS and left_m < (self._stood_before_m or math.inf):
            log.info("stands %.2f m before a %s", left_m, kind)
            self._stood_before_m = left_m
