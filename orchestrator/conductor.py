"""Carries messages between bus and core during a drive: telemetry in, jobs out, results on.

One thread. Both loops, live and lock step, feed it what lies in the mailbox.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from typing import Any

from sim_worker.metrics.comparison import compare_plan

from contracts.bus import Alive, Bus, Mailbox, Received, Reply
from contracts.codec import SchemaMismatch
from contracts.drive import DriveEnd, PlannedTrajectory, VehicleInfo, VehicleState
from contracts.keys import TELEMETRY_CHANNELS, alive_key, process_of_alive_key
from contracts.simulation import ActiveWorld, Event, FuturesJob
from contracts.world import World
from orchestrator.bookkeeping import ComparisonCount, FuturesCount, TelemetryCount
from orchestrator.comparisons import ComparisonDesk
from orchestrator.instructions import BuildWorld, Instruction, NotReady, RoundIntent, Tell, UseWorld
from orchestrator.mission import Mission
from orchestrator.plan import DrivePlan
from orchestrator.processes import BUILDER, MIRROR, ORCHESTRATOR
from orchestrator.result_rows import (
    comparison_row,
    future_rows,
    mirror_row,
    plan_row,
    round_row,
    round_view,
)
from orchestrator.results import ResultTables
from orchestrator.rounds import RoundDesk, RoundDone, RoundOrder
from orchestrator.world_desk import WorldDesk
from sim_worker.variants import plan_variants
from telemetry.estimator import StateEstimator

log = logging.getLogger(ORCHESTRATOR)

MAILBOX_DEPTH = 16384
JOB_TIMEOUT_S = 20.0


class Conductor:
    """The state of one drive between its messages."""

    def __init__(self, plan: DrivePlan, bus: Bus, mission: Mission, tables: ResultTables) -> None:
        self.plan = plan
        self.bus = bus
        self.mission = mission
        self.tables = tables
        self.mailbox = Mailbox(
            MAILBOX_DEPTH, when_full="block" if plan.config.lock_step else "drop_oldest"
        )
        self.desk = RoundDesk()
        self.telemetry = TelemetryCount()
        self.futures = FuturesCount()
        self.comparisons = ComparisonCount()
        self.comparison_desk = ComparisonDesk(plan.drive_frame, plan.config.horizon_s)
        self.alive: set[str] = set()
        self.info: VehicleInfo | None = None
        self.end: DriveEnd | None = None
        self.state: VehicleState | None = None
        self.state_receipt_ns = 0
        self.state_count = 0
        self.worlds = WorldDesk(
            plan,
            bus,
            self.mailbox,
            on_ready=self._world_ready,
            on_failed=self._world_failed,
            on_warning=lambda text: self.tell(Tell("warning", text)),
        )
        self.not_ready_rounds = 0
        self.refused: Counter[str] = Counter()
        self.mirror_stamp_ns = 0
        self.mirror_independent: bool | None = None
        self.rtf: dict[str, float] = {}
        self._estimator: StateEstimator | None = None
        self._variants = plan_variants(
            count=plan.config.futures, seed=plan.config.seed, planners=[plan.config.planner]
        )
        self._active_world: str | None = None
        self._latest_plan: PlannedTrajectory | None = None
        self._next_round_id = 0
        self._seeds: dict[int, tuple[VehicleState, PlannedTrajectory | None, RoundIntent]] = {}

    # Joining.

    def join(self) -> None:
        """Subscribe to everything a drive listens to."""
        run, vehicle = self.plan.run_id, self.plan.config.vehicle_id
        for channel in TELEMETRY_CHANNELS:
            self.bus.subscribe(channel, self.mailbox, vehicle=vehicle)
        for channel in ("mirror", "event"):
            self.bus.subscribe(channel, self.mailbox, run=run)
        self.bus.watch_alive(alive_key(run=run, process="*"), self.mailbox)

    def take_info(self, info: VehicleInfo) -> None:
        """Begin to estimate: what the vehicle says of itself is known."""
        self.info = info
        vehicle = self.plan.vehicle
        self._estimator = StateEstimator(
            info,
            wheelbase_m=vehicle.wheelbase_m.value,
            steering_ratio=vehicle.steering_ratio.value,
            steering_offset_rad=vehicle.steering_offset_rad.value,
        )
        if info.body_from_antenna_m is None:
            self.tell(
                Tell(
                    "warning",
                    f"the source does not say where its {info.reference_point} sits on the car; "
                    "taken as base_link",
                )
            )

    # Messages.

    def handle(self, item: object) -> None:
        """Take one item of the mailbox; telemetry goes to `take_telemetry` itself."""
        match item:
            case Received(channel="mirror"):
                sample = item.message()
                self.mirror_stamp_ns = sample.stamp_ns
                self.mirror_independent = sample.independent
                self.tables.add("mirror", [mirror_row(sample)])
            case Received(channel="event"):
                event = item.message()
                if event.source != ORCHESTRATOR:
                    self._keep_event(event)
            case Received():
                self.take_telemetry(item)
            case Reply(channel="job"):
                self._job_reply(item)
            case Reply(channel="build"):
                self.worlds.build_reply(
                    item, workers=self.desk.workers, builder_up=BUILDER in self.alive
                )
            case Reply(channel="prepare"):
                self.worlds.prepare_reply(item)
            case Alive():
                self._alive(item)
            case _:
                pass

    def take_telemetry(self, item: Received) -> None:
        """Count one sample, estimate the state, and let the mission go on."""
        try:
            envelope = item.envelope()
        except SchemaMismatch as error:
            self.refused["schema"] += 1
            if self.refused["schema"] == 1:
                self.tell(Tell("error", str(error)))
            return
        message = envelope.message
        if isinstance(message, DriveEnd):
            self.end = message
            return
        age_ms = max(0.0, (time.time_ns() - envelope.sent_ns) / 1e6)
        self.telemetry.take(key=item.key, channel=item.channel, seq=envelope.seq, age_ms=age_ms)
        if isinstance(message, PlannedTrajectory):
            self._latest_plan = message
            return
        if self._estimator is None:
            return
        state = self._estimator.handle(item.channel, message)
        if state is None:
            return
        self.state, self.state_receipt_ns = state, item.received_mono_ns
        self.state_count += 1
        self.bus.publish("state", state, vehicle=self.plan.config.vehicle_id)
        for comparison in self.comparison_desk.take_state(state):
            self._keep_comparison(comparison)
        self.obey(self.mission.on_state(state, mono_s=item.received_mono_ns / 1e9))

    @property
    def skipped_invalid(self) -> int:
        """Samples refused so far: by the reader, and by the estimator."""
        by_estimator = sum(self._estimator.skipped.values()) if self._estimator else 0
        return by_estimator + (self.end.skipped_invalid if self.end else 0)

    # Worlds.

    def obey(self, instructions: list[Instruction]) -> None:
        """Carry out what the mission says."""
        for instruction in instructions:
            match instruction:
                case BuildWorld(junction_id):
                    self.worlds.build(junction_id)
                case UseWorld(world_id):
                    self._active_world = world_id
                    self.publish_active_world()
                case Tell():
                    self.tell(instruction)

    def publish_active_world(self) -> None:
        """Say which World counts; said again when the mirror comes back."""
        stamp = self.state.stamp_ns if self.state else 0
        active = ActiveWorld(stamp_ns=stamp, world_id=self._active_world)
        self.bus.publish("active_world", active, run=self.plan.run_id)

    def _world_ready(self, junction_id: str, world: World) -> None:
        self.obey(self.mission.on_world(junction_id, world, mono_s=time.monotonic()))

    def _world_failed(self, junction_id: str, reason: str) -> None:
        self.tell(Tell("error", f"no world for {junction_id}: {reason}"))
        self.obey(self.mission.on_world_failed(junction_id, mono_s=time.monotonic()))

    # Processes.

    def _alive(self, item: Alive) -> None:
        process_id = process_of_alive_key(item.key)
        if process_id == ORCHESTRATOR:
            return
        if item.up:
            self.alive.add(process_id)
            if process_id.startswith("w"):
                self.desk.worker_up(process_id)
                self._catch_up(process_id)
            elif process_id == MIRROR:
                self.publish_active_world()
            elif process_id == BUILDER:
                self.worlds.builder_up()
            return
        self.alive.discard(process_id)
        log.info("lost %s", process_id)
        if process_id.startswith("w"):
            self.desk.worker_down(process_id)
            self.worlds.worker_down(process_id)
            self.give_out()

    def _catch_up(self, worker_id: str) -> None:
        """Let a worker that comes later load what the coming rounds need."""
        for world_id in self.mission.worlds_ahead():
            self.worlds.prepare(worker_id, world_id)

    # Rounds.

    def start_round(self) -> bool:
        """Start a round where the mission wants one; returns whether it did."""
        intent = self.mission.plan_round()
        if intent is None or self.state is None:
            return False
        if isinstance(intent, NotReady):
            self.not_ready_rounds += 1
            return False
        config = self.plan.config
        round_id, self._next_round_id = self._next_round_id, self._next_round_id + 1
        size = config.futures_per_job
        jobs = tuple(
            FuturesJob(
                round_id=round_id,
                job_index=index,
                world_id=intent.world_id,
                state=self.state,
                path=intent.path,
                variants=self._variants[first : first + size],
                horizon_s=config.horizon_s,
                step_s=0.1,
                seed=config.seed,
                cruise_speed_mps=intent.cruise_speed_mps,
            )
            for index, first in enumerate(range(0, config.futures, size))
        )
        self._seeds[round_id] = (self.state, self._latest_plan, intent)
        self.desk.open(
            RoundOrder(
                round_id=round_id,
                stamp_ns=self.state.stamp_ns,
                junction_id=intent.junction_id,
                world_id=intent.world_id,
                receipt_mono_ns=self.state_receipt_ns,
                jobs=jobs,
            )
        )
        self.give_out()
        return True

    def give_out(self) -> None:
        """Send waiting jobs to idle workers."""
        for worker_id, job in self.desk.assignments():
            self.bus.request(
                "job", job, self.mailbox, tag=(worker_id, job), timeout_s=JOB_TIMEOUT_S,
                run=self.plan.run_id, process=worker_id,
            )  # fmt: skip

    def _job_reply(self, reply: Reply) -> None:
        worker_id, job = reply.tag
        if reply.message is None and reply.error != "no answer":
            self.refused["job"] += 1
            self.tell(Tell("error", f"{worker_id}: {reply.error}"))
        if reply.message is not None and reply.message.cpu_seconds > 0.0:
            self.rtf[worker_id] = reply.message.sim_seconds / reply.message.cpu_seconds
        done = self.desk.result(worker_id, job, reply.message, reply.received_mono_ns)
        if done is not None:
            self._round_done(done)
        self.give_out()

    def _round_done(self, done: RoundDone) -> None:
        order = done.order
        state, plan, intent = self._seeds.pop(order.round_id)
        for stale in [r for r in self._seeds if r < order.round_id]:
            del self._seeds[stale]
        world = self.worlds.world(order.world_id)
        view, rows, distinct = future_rows(done, self._variants)
        sha = self.futures.take(done, distinct=distinct)
        self.mission.on_round(order.junction_id, futures=len(rows))
        self.tables.add("futures", rows)
        self.tables.add(
            "rounds",
            [
                round_row(
                    done,
                    start_stamp_ns=self._start_ns,
                    distinct=distinct,
                    sha256=sha,
                    cruise_speed_mps=intent.cruise_speed_mps,
                )
            ],
        )
        drive_frame = self.plan.drive_frame
        self.bus.publish(
            "round",
            round_view(done, view, world.frame, drive_frame, self._variants),
            run=self.plan.run_id,
        )
        self.comparison_desk.take_round(done, world.frame, state)
        if plan is not None and state.stamp_ns - plan.stamp_ns < 1_000_000_000:
            compared = compare_plan(
                plan,
                done.results[0].trajectory,
                intent.path,
                world_frame=world.frame,
                round_id=order.round_id,
            )
            if compared is not None:
                self.tables.add("plan_comparisons", [plan_row(compared)])
                self.bus.publish("plan_comparison", compared, run=self.plan.run_id)

    @property
    def _start_ns(self) -> int:
        return self.info.start_stamp_ns if self.info else 0

    def _keep_comparison(self, comparison: Any) -> None:
        self.comparisons.take(comparison)
        self.tables.add("comparisons", [comparison_row(comparison)])
        self.bus.publish("comparison", comparison, run=self.plan.run_id)

    def finish(self) -> None:
        """Compare what can still be compared and settle the counts."""
        for comparison in self.comparison_desk.flush():
            self._keep_comparison(comparison)
        if self.end is not None:
            self.telemetry.settle(self.end.published)

    # Telling.

    def tell(self, tell: Tell, *, source: str = ORCHESTRATOR) -> None:
        """Log an event, publish it, and keep it."""
        stamp = self.state.stamp_ns if self.state else self._start_ns
        event = Event(stamp_ns=stamp, level=tell.level, source=source, text=tell.text)
        self.bus.publish("event", event, run=self.plan.run_id)
        self._keep_event(event)

    def _keep_event(self, event: Event) -> None:
        level = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}
        log.log(level[event.level], "%s: %s", event.source, event.text)
        self.tables.add(
            "events",
            [
                {
                    "stamp_ns": event.stamp_ns, "level": event.level, "source": event.source,
                    "text": event.text,
                }
            ],
        )  # fmt: skip
