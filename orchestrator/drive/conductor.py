"""Carries messages between bus and core: both loops feed it what lies in the mailbox."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Literal

from foretwin.contracts import keys
from foretwin.contracts.bus import Alive, Bus, Mailbox, Received, Reply, Request
from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.guard import Refused, is_identifier
from foretwin.contracts.world import World
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.active_world import ActiveWorldNews
from foretwin.orchestrator.drive.events import EventHandler
from foretwin.orchestrator.drive.far_member import FleetTag
from foretwin.orchestrator.drive.fleet_handler import FleetHandler
from foretwin.orchestrator.drive.intake import Intake, unplaced
from foretwin.orchestrator.drive.light_link import LightLink
from foretwin.orchestrator.drive.mark_handler import MarkHandler
from foretwin.orchestrator.drive.mirror_handler import MirrorHandler
from foretwin.orchestrator.drive.mission import Mission
from foretwin.orchestrator.drive.processes import BUILDER, MIRROR, ORCHESTRATOR, expected_ids
from foretwin.orchestrator.drive.questions import ASKED_OF_SIMULATIONS, Questions
from foretwin.orchestrator.drive.refusal_handler import RefusalHandler
from foretwin.orchestrator.drive.route_handler import RouteHandler
from foretwin.orchestrator.drive.sensors_setup import TOLD_WORLDS
from foretwin.orchestrator.drive.side_by_side_handler import SideBySideHandler
from foretwin.orchestrator.drive.strangers import Strangers
from foretwin.orchestrator.drive.tuning_link import FINDINGS, TuningLink
from foretwin.orchestrator.drive.virtual_traffic_link import VirtualTrafficLink
from foretwin.orchestrator.drive.world_handler import WorldHandler
from foretwin.orchestrator.instructions import BuildWorld, Instruction, Notice, NotReady, UseWorld
from foretwin.orchestrator.other_vehicles.vehicles import OtherVehicleFeed
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.results import ResultTables
from foretwin.orchestrator.rounds.runner import RoundRunner
from foretwin.orchestrator.runtime_configuration import roles
from foretwin.orchestrator.runtime_configuration.handler import RuntimeConfiguration
from foretwin.orchestrator.tuning.by_hand import VehicleHandler

log = logging.getLogger(ORCHESTRATOR)
MAILBOX_DEPTH = 16384


class Conductor:
    """The state of one drive between its messages."""

    def __init__(self, plan: DrivePlan, bus: Bus, mission: Mission, tables: ResultTables) -> None:
        self.plan, self.bus, self.mission, self.tables = plan, bus, mission, tables
        full: Literal["block", "drop_oldest"] = "block" if plan.config.lock_step else "drop_oldest"
        self.mailbox = Mailbox(MAILBOX_DEPTH, when_full=full)
        self.intake = Intake(plan.vehicle, pace=plan.config.speed)
        self.events = EventHandler(
            bus, tables, run_id=plan.run_id, now_stamp_ns=lambda: self.intake.now_stamp_ns
        )
        self.tell = self.events.tell
        self.refusals = RefusalHandler(self.tell, plan.processes_dir)
        self.context = context = DriveContext(plan, bus, self.mailbox, tables, self.tell)
        self.worlds = WorldHandler(
            context, on_ready=self._world_ready, on_failed=self._world_failed
        )
        self.rounds = RoundRunner(
            context,
            world_of=self.worlds.world,
            on_round=lambda junction_id, count: mission.on_round(junction_id, futures=count),
        )
        self.ads = SideBySideHandler(context, self.intake, mission)
        self.alive: dict[str, float] = {}  # and when each was last heard to come, monotonic
        self.strangers = Strangers(expected_ids(plan), self.tell)
        self.questions = Questions(context, self.alive)
        self.mirror = MirrorHandler(tables, self.tell, plan.config.vehicle_id)
        self.roles = roles.RolesInForce(
            plan.config.roles,
            plan.config.correction,
            tell=lambda message: self.questions.ask(MIRROR, "use_roles", message),
        )
        self.tuning = TuningLink(context, intake=self.intake, rounds=self.rounds, alive=self.alive)
        self.traffic = VirtualTrafficLink(context, self.questions, self.intake)
        self.lights = LightLink(context, self.intake)
        self.changes = RuntimeConfiguration(
            roles.role_changes(self.roles)
            | {"vehicle": VehicleHandler(self.tuning.parameters), "virtual_traffic": self.traffic}
            | {"light": self.lights.handler}
        )
        self.beside = OtherVehicleFeed(context, lambda: self.intake.clock_offset_ns)
        self.route = RouteHandler(plan, use=mission.give_route, tell=self.tell)
        self.active_world = ActiveWorldNews(
            context, self.questions, next_stamp_ns=lambda: self.intake.next_stamp_ns
        )
        self.fleet = FleetHandler(context, self.rounds, self.tuning.parameters)
        self.worlds.on_load = self.fleet.load
        self._on_message: dict[str, Callable[[Received], object]] = {
            **dict.fromkeys(keys.TELEMETRY_CHANNELS, self.take_telemetry),
            **dict.fromkeys(FINDINGS, self.tuning.heard),
            "route": self.route.take,
            "mirror": lambda item: self.mirror.take(item.message()),
            "virtual_traffic": lambda item: self.traffic.take(item.message()),
            "event": lambda item: self.events.heard(item.message()),
        }
        self._on_reply: dict[str, Callable[[Reply], object]] = {
            **dict.fromkeys(ASKED_OF_SIMULATIONS, lambda _: self.questions.answered()),
            **dict.fromkeys(("use_vehicle", "tune"), self._tuning_reply),
            "job": self.rounds.reply,
            "build": lambda item: self.worlds.build_reply(
                item, workers=self._near, builder_up=BUILDER in self.alive
            ),
            "prepare": self.worlds.prepare_reply,
            "info": lambda item: self.beside.take_info(item.tag, item.message),
            "vehicle_clock": self.beside.take_time,
            **dict.fromkeys(("enlist", "admit", "clock"), self.fleet.reply),
        }
        self._on_question: dict[str, Callable[[Request], object]] = {
            "set": lambda item: self.changes.take(item, stamp_ns=self.intake.now_stamp_ns),
            "mark": MarkHandler(context, self.intake, mission).take,
            "join": self.beside.take_join,
            "world_file": self.worlds.give,
        }

    def join(self) -> None:
        """Subscribe to everything a drive listens to."""
        run, vehicle = self.plan.run_id, self.plan.config.vehicle_id
        live = [one.config.id for one in self.plan.beside if one.config.live]
        for one in (vehicle, *live):
            self.bus.serve("join", self.mailbox, run=run, vehicle=one)
            for channel in keys.TELEMETRY_CHANNELS:
                self.bus.subscribe(channel, self.mailbox, vehicle=one)
        self.route.join(self.bus, self.mailbox)
        self.context.subscribe("mirror", "virtual_traffic", "event")
        self.tuning.join()
        for question in ("set", "mark", *(("world_file",) if self.fleet.open else ())):
            self.bus.serve(question, self.mailbox, run=run)
        self.bus.watch_alive(keys.alive_key(run=run, process="*"), self.mailbox)

    def take_info(self, info: VehicleInfo) -> None:
        """Begin to estimate: what the vehicle says of itself is known."""
        self.intake.take_info(info)
        self.beside.begin(info)
        self.rounds.start_stamp_ns = self.mission.start_stamp_ns = info.start_stamp_ns
        self.rounds.windows.antenna_known = info.body_from_antenna_m is not None
        if info.body_from_antenna_m is None:
            self.tell(unplaced(info.reference_point))

    def handle(self, item: object) -> None:
        """Take one item of the mailbox; None, where nothing came, changes nothing.

        What others sent and cannot be used is counted and told, and never raises.
        """
        try:
            match item:
                case Received(channel=channel) if channel in self._on_message:
                    self._on_message[channel](item)
                case Reply(channel=channel) if channel in self._on_reply:
                    self.refusals.take_reply(item)
                    far = isinstance(item.tag, FleetTag)
                    (self.fleet.reply if far else self._on_reply[channel])(item)
                case Request(channel=channel) if channel in self._on_question:
                    self._on_question[channel](item)
                case Alive():
                    self._alive(item)
        except Refused as refused:
            self.refusals.take(refused)

    def _tuning_reply(self, item: Reply) -> None:
        process_id = self.tuning.reply(item)
        if process_id in self.alive and process_id not in self.rounds.dispatcher.workers:
            self._worker_up(process_id)

    def take_telemetry(self, item: Received) -> None:
        """Take one sample, and let the mission go on where it gives a new state."""
        sender = keys.vehicle_of_key(item.key)
        if sender != self.plan.config.vehicle_id:
            self.beside.take_sample(sender, item)
            return
        state = self.intake.take(item)
        if left_out := item.envelope().left_out:
            self.refusals.leave_out(item.key, left_out)
        self.ads.take(state)
        if state is None:
            return
        self.watch_telemetry(item.received_mono_ns)
        self.beside.keep_up_with(state, self.intake.road_users, self.roles.roles)
        self.bus.publish("state", state, vehicle=self.plan.config.vehicle_id)
        self.route.keep_up_with(state, self.intake.plan)
        self.lights.keep_up_with(state)
        self.rounds.take_state(state)
        self.rounds.windows.take(self.intake.surroundings, state, self.mission.way.closed_to_cars)
        self.obey(self.mission.on_state(state, mono_s=item.received_mono_ns / 1e9))
        if self.mission.road_line is not None and self.plan.config.map_aiding == "auto":
            self.intake.take_line(self.mission.road_line)

    def watch_telemetry(self, mono_ns: int) -> None:
        """Tell what newly went wrong with the telemetry; also when none comes any more."""
        for text in self.intake.warnings(mono_ns):
            self.tell(Notice("warning", text))

    def start_round(self) -> bool:
        """Start a round that was counted as due; returns whether it did."""
        started_mono_ns = time.monotonic_ns()
        with self.rounds.tally.starting():
            intent, latest = self.mission.plan_round(), self.intake.latest
            if intent is None or latest is None:
                return False
            if isinstance(intent, NotReady):
                self.rounds.tally.not_ready(world_late=intent.world_late)
                return False
            told = self.lights.among(self.intake.surroundings)
            reports = self.beside.among(told, latest.state, self.roles.roles)
            reports = self.traffic.met_in(intent, reports, latest.state)
            self.rounds.start(intent, latest, reports, started_mono_ns=started_mono_ns)
        return True

    def finish(self) -> None:
        """Compare what can still be compared and settle the counts."""
        self.rounds.finish()
        self.ads.finish()
        if self.intake.end is not None:
            self.intake.counts.settle(self.intake.end.published)

    def obey(self, instructions: list[Instruction]) -> None:
        """Carry out what the mission says."""
        for instruction in instructions:
            match instruction:
                case BuildWorld(junction_id, load):
                    self.worlds.want(junction_id, load=load, workers=self._near)
                case UseWorld(world_id):
                    self.active_world.use(world_id)
                    self.lights.use_world(self.worlds.world(world_id) if world_id else None)
                    if not self.plan.config.lock_step:
                        self.active_world.announce()
                case Notice():
                    self.tell(instruction)

    def _world_ready(self, junction_id: str, world: World) -> None:
        self.obey(self.mission.on_world(junction_id, world, mono_s=time.monotonic()))

    def _world_failed(self, junction_id: str, reason: str) -> None:
        self.obey(self.mission.on_world_failed(junction_id, reason))

    def make_changes(self) -> None:
        """Make what `foretwin set` asked for; between rounds, and from the next state on."""
        intake, between = self.intake, not self.rounds.open
        times = {"stamp_ns": intake.next_stamp_ns, "start_stamp_ns": intake.start_stamp_ns}
        for change in self.changes.make(**times, between_rounds=between):
            self.tell(Notice("info", f"set {change.text}"))
            self.tables.add("changes", [change.row()])
            self.lights.say()
        if between:
            self.tuning.hand_over()
            self.fleet.keep_up()

    @property
    def _near(self) -> tuple[str, ...]:  # those for which a World waits
        return tuple(one for one in self.rounds.dispatcher.workers if one in self.alive)

    def _alive(self, item: Alive) -> None:
        process_id = keys.process_of_alive_key(item.key)
        if not is_identifier(process_id):
            raise Refused(item.key, "a token of no plain name")
        if self.fleet.takes(process_id):
            self.fleet.alive(process_id, up=item.up)
        elif process_id != ORCHESTRATOR and not self.strangers.refuse(process_id, up=item.up):
            if item.up:
                self.alive[process_id] = item.received_mono_ns * 1e-9
            (self._process_up if item.up else self.process_down)(process_id)

    def _process_up(self, process_id: str) -> None:
        if not self.tuning.process_up(process_id):
            self._worker_up(process_id)
        self.traffic.process_up(process_id)
        if process_id == MIRROR:
            self.active_world.mirror_up()
            self.roles.announce(self.intake.now_stamp_ns)
        elif process_id == BUILDER:
            self.worlds.builder_up()
        elif process_id in TOLD_WORLDS:
            self.active_world.viewer_up()

    def _worker_up(self, process_id: str) -> None:
        """Give a worker that has the parameters in force its Worlds, and jobs."""
        self.rounds.siblings.process_up(process_id)
        if not process_id.startswith("w"):
            return
        self.rounds.worker_up(process_id)
        for world_id in self.mission.worlds_ahead():
            self.worlds.prepare(process_id, world_id)
        self.rounds.dispatcher.give_out()

    def process_down(self, process_id: str) -> None:
        """Count with a process no more: its token is gone, or it has died."""
        if process_id in self.alive:
            del self.alive[process_id]
            self.tuning.process_down(process_id)
            log.info("%s has left the bus", process_id)
            self.rounds.siblings.process_down(process_id)
            if process_id.startswith("w"):
                self.worlds.worker_down(process_id)
                self.rounds.worker_down(process_id)
