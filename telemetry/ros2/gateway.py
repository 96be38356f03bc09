"""Between the vehicle's ROS 2 and a run: its topics as telemetry, and back what we say.

One thread; what arrives waits in bounded mailboxes that forget the oldest. Nothing is repeated:
each message towards the vehicle answers one fresh word of the orchestrator, so silence there is
silence here, and the dead man of `foretwin.telemetry.ros2.safety` shuts the gate besides.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

from foretwin.contracts import drive, gap
from foretwin.contracts.anchor import Anchor
from foretwin.contracts.bus import Bus, Mailbox, Received, Request
from foretwin.contracts.foreign_bus import Arrived, ForeignBus
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.guard import Refused
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.point_cloud import NO_MOUNTS, Mounts, PointCloud
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.simulation import Event, MirrorSample
from foretwin.contracts.towards_vehicle import Authority, OrderKeys, VehicleCommand
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.telemetry.ros2.cadence import Cadence
from foretwin.telemetry.ros2.diagnostics import DiagnosticLevels
from foretwin.telemetry.ros2.gated_sender import GatedSender
from foretwin.telemetry.ros2.injected import how_shown
from foretwin.telemetry.ros2.injection import InjectionWord
from foretwin.telemetry.ros2.introduction import Introduction
from foretwin.telemetry.ros2.inwards import Inwards
from foretwin.telemetry.ros2.lot_guard import LotGuard
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.merged_objects import MergedObjects
from foretwin.telemetry.ros2.mirrored import MirroredObjects, without_own_twin
from foretwin.telemetry.ros2.orders import Orders
from foretwin.telemetry.ros2.outwards import Outwards
from foretwin.telemetry.ros2.rows import SHOWS_LIGHTS, OutRow, Source
from foretwin.telemetry.ros2.safety import GateTrouble, VehicleGate
from foretwin.telemetry.ros2.sender import RosSender
from foretwin.telemetry.ros2.virtual_objects import UnfitError, VirtualObjects

_PORTION = 16
"""So many samples at most between two looks at the orchestrator's orders."""
_DIAGNOSTICS_NS = _ROUTE_EVERY_NS = 1_000_000_000
_CLOUDS = 8  # so many wait, the newest: one is a megabyte
_STATE_EVERY_NS, _OBJECTS_EVERY_NS = 20_000_000, 100_000_000

log = logging.getLogger("foretwin.telemetry.ros2")


class Gateway:
    """Does what is due with each `step`; owns neither bus."""

    def __init__(
        self,
        mapping: Mapping,
        *,
        bus: Bus,
        foreign: ForeignBus,
        run_id: str,
        vehicle_id: str,
        drive_frame: LocalFrame,
        flag_on: bool,
        order_keys: OrderKeys | None = None,
        car: VehicleParameters | None = None,
        anchor: Anchor | None = None,
        guard: LotGuard | None = None,
        mounts: Mounts = NO_MOUNTS,
        refusals: Refusals | None = None,
        mono_ns: Callable[[], int] = time.monotonic_ns,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Subscribe to what the mapping names; `flag_on` is the command line's switch.

        `order_keys` say whose orders count: without them none does, and nothing goes towards the
        vehicle. `car` gives the size of the car's own twin, where that goes out. With an `anchor`
        the car's topics live on its lot, and all that is said on `bus` in the World; `guard` knows
        the lot's fence, and shuts the gate. `mounts` say where sensors sit whose clouds pass.
        """
        self._mapping, self._bus, self._foreign = mapping, bus, foreign
        self._vehicle_id, self._mono_ns, self._wall_ns = vehicle_id, mono_ns, wall_ns
        self.inwards = Inwards(mapping, anchor, mounts)
        self.introduction = Introduction(mapping, self.inwards, vehicle_id=vehicle_id)
        self._out = Outwards(
            mapping, drive_frame=drive_frame, vehicle_id=vehicle_id, anchor=anchor, mounts=mounts
        )
        limits = mapping.towards_vehicle
        self.gate = VehicleGate(
            limits, config_on=limits.enabled, flag_on=flag_on, trouble=self._lot_trouble
        )
        self._guard, self._word = guard, InjectionWord(self.gate, guard)
        self._virtual = VirtualObjects(at_most=limits.max_objects, placed=mapping.placed)
        self._sender = RosSender(mapping, foreign, wall_ns=wall_ns)
        self._gated = GatedSender(
            self._sender, self.gate,
            foreign=foreign, max_rate_hz=limits.max_rate_hz, mono_ns=mono_ns,
        )  # fmt: skip
        self._send, self.held = self._gated.send, self._gated.held
        """By topic, messages towards the vehicle that were not sent."""
        self.refusals = Refusals() if refusals is None else refusals
        """Of what came from the run's side."""
        named, alt_m = mapping.mirrored, self._out.ground_alt_m
        self._mirrored = MirroredObjects(named, car=car, drive_frame=drive_frame, alt_m=alt_m)
        self._diagnostics, self._due = DiagnosticLevels(), Cadence(mono_ns).due
        self._merged, self._inbox = MergedObjects(mapping.merged, frame=drive_frame), Mailbox(2048)
        self._views, self._clouds = (Mailbox(n, nudges=self._inbox) for n in (256, _CLOUDS))
        self._orders: Orders | None = None
        self._logged_gate = self.gate.state
        self._out.warm_up()
        for key, history, bulky in self.inwards.key_expressions():
            foreign.subscribe(key, self._clouds if bulky else self._inbox, history=history)
        bus.serve("info", self._views, vehicle=vehicle_id)
        self._listen(run_id, order_keys)
        self._sender.announce(mapping.announced(towards_vehicle=self.gate.state != "off"))
        log.info("towards the vehicle: %s", self.gate.why)

    def step(self, wait_s: float = 0.005) -> None:
        """Wait a moment for anything, then pass on what has come from either side."""
        arrived: Any = self._inbox.take(wait_s)
        for left in reversed(range(_PORTION)):
            self._take_orders()
            if arrived is None:
                break
            self._take_in(arrived)
            arrived = self._inbox.take() if left else None
        for waiting in (self._clouds, self._views):
            for _ in range(_PORTION):
                if (item := waiting.take()) is None:
                    break
                self._pass_on(item)
                self._take_orders()
        if self.inwards.route is not None and self._due("route", _ROUTE_EVERY_NS):
            self._bus.publish("route", self.inwards.route, vehicle=self._vehicle_id)
        self.introduction.answer(now_ns=self._mono_ns())
        if (word := self._word.news(self._mono_ns())) is not None:
            self._bus.publish("injection", word, vehicle=self._vehicle_id)
        self._diagnose()

    def report(self) -> dict[str, dict[str, int]]:
        """Return all counts: what came in, what was left out, what was sent, bounded and held."""
        words = 0 if self._orders is None else self._orders.dropped
        samples, views, clouds = (b.dropped for b in (self._inbox, self._views, self._clouds))
        return {
            "in": dict(self.inwards.counts),
            "unused": dict(self.inwards.unused),
            "lost": dict(self.inwards.lost),
            "sent": dict(self._sender.sent),
            "held": dict(self.held),
            "refused": self.refusals.counts(),
            "merged": dict(+self._merged.counts),
            "gate": dict(self.gate.counts),
            "dropped": {"samples": samples, "words": words, "views": views, "clouds": clouds},
        }

    def _listen(self, run_id: str, order_keys: OrderKeys | None) -> None:
        if self.gate.state != "off" and order_keys is not None:
            self._orders = Orders(
                self._bus, run_id=run_id, keys=order_keys, refusals=self.refusals,
                commands="vehicle_command" in self._mapping.sources,
            )  # fmt: skip
        for channel in self._mapping.vehicle_channels or (("state",) if self._guard else ()):
            self._bus.subscribe(channel, self._views, vehicle=self._vehicle_id)
        for channel in self._mapping.run_channels:
            views = self._clouds if channel == "point_cloud" else self._views
            self._bus.subscribe(channel, views, run=run_id)

    def _take_orders(self) -> None:
        """Take the orders that have come, then look whether the gate may stay open."""
        for order in self._orders.take() if self._orders is not None else ():
            if isinstance(order, Authority):
                self.gate.heartbeat(order.sent_mono_ns, now_ns=self._mono_ns())
            else:
                self._command(order)
        if self.gate.state == "open":
            self.gate.look(now_ns=self._mono_ns(), link_up=self._foreign.connected)
        if self.gate.state != self._logged_gate:
            was, self._logged_gate = self._logged_gate, self.gate.state
            log.warning("towards the vehicle: %s: %s", self.gate.state, self.gate.why)
            if (was, self.gate.state) == ("open", "shut"):
                self._take_back()

    def _lot_trouble(self, now_ns: int) -> GateTrouble | None:
        guard, car = self._guard, self.inwards
        return guard.trouble(now_ns, heard_ns=car.heard_mono_ns, fix=car.fix) if guard else None

    def _take_back(self) -> None:
        """Say once that nobody is there, to who was told otherwise; afterwards all is silent."""
        last: dict[Source, Callable[[OutRow], bytes]] = {
            "virtual_objects": lambda row: self._out.objects(self._virtual.nobody(), row.type),
            "lights": lambda row: self.inwards.lights.nothing(row, stamp_ns=self._wall_ns()),
        }
        for row in (row for source in last for row in self._out.rows(source)):
            if row.towards_vehicle and self._sender.sent[row.topic]:
                self._sender.put(row, last[row.source](row))

    def _command(self, message: VehicleCommand) -> None:
        now_ns, stamp_ns = self._mono_ns(), self._wall_ns()
        admitted = self.gate.admit(
            self._out.on_lot(message),
            now_ns=now_ns,
            link_up=self._foreign.connected,
            tire_angle_rad=self.inwards.measured("tire_angle_rad", now_ns=now_ns),
            speed_mps=self.inwards.measured("speed_mps", now_ns=now_ns),
        )
        for row in self._out.rows("vehicle_command"):
            if admitted is None:
                self.held[row.topic] += 1
            else:
                self._gated.put(row, self._out.command(admitted, row.type, stamp_ns=stamp_ns))

    def _take_in(self, arrived: Arrived) -> None:
        for channel, message in self.inwards.take(arrived):
            if isinstance(message, drive.RoadUsers):
                self._send_merged(message)
            self._bus.publish(channel, message, vehicle=self._vehicle_id)

    def _pass_on(self, item: Any) -> None:
        match self._decoded(item):
            case Request():
                self.introduction.take(item, now_ns=self._mono_ns())
            case Arrived():
                self._take_in(item)
            case drive.VehicleState() as state:
                if self._guard is not None:
                    self._guard.take_state(self._out.on_lot(state), now_ns=self._mono_ns())
                self._mirrored.take_state(state.stamp_ns)
                self._merged.take_state(state)
                out, stamp_ns, often = self._out, state.stamp_ns, _STATE_EVERY_NS
                self._send(out.rows("state"), lambda _: out.state(state), every_ns=often)
                self._send(out.rows("clock"), lambda _: out.clock(stamp_ns), every_ns=often)
                if self._virtual.has_own and self._due("virtual objects", _OBJECTS_EVERY_NS):
                    self._objects(lambda: self._virtual.own(state.stamp_ns))
            case MirrorSample() as mirror:
                self._send(self._out.rows("twin"), lambda _: self._out.twin(mirror))
                if self._mapping.mirrored:
                    self._objects(lambda: self._mirrored.users(mirror))
            case ShownLights() as shown:
                self.inwards.lights.take(shown, wall_ns=self._wall_ns(), mono_ns=self._mono_ns())
                for source in SHOWS_LIGHTS:
                    self._send(self._out.rows(source), self.inwards.lights.payload)
            case drive.RoadUsers() as users:
                self._objects(lambda: users)
            case PointCloud() | RadarList() as one:
                self._send(self._out.rows_of(one), lambda row: self._measured(one, row))
            case Event() | gap.GapAlarm() | gap.Verdict() as finding:
                self._diagnostics.take(finding)

    def _decoded(self, item: Any) -> Any:
        try:
            return item.message() if isinstance(item, Received) else item
        except Refused as refused:
            if text := self.refusals.take(refused):
                log.warning("%s", text)
            return None

    def _objects(self, users: Callable[[], drive.RoadUsers]) -> None:
        """Send virtual road users together with those that others have said lately."""
        try:
            known = self._virtual.take(users(), now_ns=self._mono_ns())
        except UnfitError as why:
            self.held[str(why)] += 1
            return

        def payload(row: OutRow) -> bytes:
            meant = without_own_twin(known) if row.towards_vehicle else known
            if row.towards_vehicle:
                self.inwards.injected.note(self._out.on_lot(meant), how=how_shown(row.type))
            return self._out.objects(meant, row.type)

        self._send(self._out.rows("virtual_objects"), payload)

    def _measured(self, one: PointCloud | RadarList, row: OutRow) -> bytes:
        if row.towards_vehicle:
            within = self._virtual.at(one.stamp_ns, now_ns=self._mono_ns())
            self.inwards.injected.note_measured(one, self._out.on_lot(within))
        return self._out.measured(one, row)

    def _send_merged(self, real: drive.RoadUsers) -> None:
        """Send what the car says that it sees, at once, with what is virtual beside it."""

        def payload(row: OutRow) -> bytes:
            virtual = without_own_twin(self._virtual.at(real.stamp_ns, now_ns=self._mono_ns()))
            one = self._merged.merged(real, virtual, self.inwards.objects)
            self.inwards.injected.note(self._out.on_lot(one.virtual), how=how_shown(row.type))
            return self._out.merged(one, row.type)

        self._send(self._out.rows("merged_objects"), payload)

    def _diagnose(self) -> None:
        if not self._due("diagnostics", _DIAGNOSTICS_NS):
            return
        stamp_ns, report = self._wall_ns(), self.report()
        levels = self._diagnostics.levels(report, gate=self.gate)
        self._send(self._out.rows("diagnostics"), lambda _: self._out.diagnostics(stamp_ns, levels))
