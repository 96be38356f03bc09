"""Runs rounds: cuts an intent into jobs, sends them to workers, and takes complete rounds apart."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from foretwin.contracts.bus import Bus, Mailbox, Reply
from foretwin.contracts.drive import PlannedTrajectory, VehicleState
from foretwin.contracts.simulation import Comparison
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.orchestrator.agreement.verdict_rows import judged_row
from foretwin.orchestrator.agreement.windows import WindowDesk
from foretwin.orchestrator.drive.intake import LatestReports, LatestState
from foretwin.orchestrator.drive.plan import DrivePlan
from foretwin.orchestrator.instructions import RoundIntent, Tell
from foretwin.orchestrator.record.bookkeeping import ComparisonCount, FuturesCount, PlanCount
from foretwin.orchestrator.record.job_tables import job_row, keep_vehicles, road_user_rows
from foretwin.orchestrator.record.result_rows import (
    comparison_row,
    plan_row,
    round_futures,
    round_row,
)
from foretwin.orchestrator.record.results import ResultTables
from foretwin.orchestrator.rounds.comparisons import ComparisonDesk
from foretwin.orchestrator.rounds.dispatch import RoundDesk, RoundDone, RoundOrder
from foretwin.orchestrator.rounds.jobs import PLAN_FRESH_NS, RoundPlanner
from foretwin.orchestrator.rounds.pace import Pace, RoundPace
from foretwin.orchestrator.rounds.views import round_view
from foretwin.sim_worker.metrics.comparison import compare_plan

JOB_TIMEOUT_S = 20.0


class _Seed(NamedTuple):
    """What a round was started from."""

    state: VehicleState
    plan: PlannedTrajectory | None
    intent: RoundIntent
    pace: Pace


class RoundRunner:
    """Everything between an intent and the rows of a round."""

    def __init__(
        self,
        plan: DrivePlan,
        bus: Bus,
        mailbox: Mailbox,
        tables: ResultTables,
        *,
        world_of: Callable[[str], World],
        on_round: Callable[[str, int], None],
        tell: Callable[[Tell], None],
    ) -> None:
        self.desk = RoundDesk()
        self.futures = FuturesCount()
        self.comparisons = ComparisonCount()
        self.plans = PlanCount()
        self.rtf: dict[str, float] = {}
        self.failed_jobs = 0
        self.start_stamp_ns = 0
        self._plan = plan
        self._bus = bus
        self._mailbox = mailbox
        self._tables = tables
        self._world_of = world_of
        self._on_round = on_round
        self._tell = tell
        self._comparison_desk = ComparisonDesk(plan.drive_frame, plan.config.horizon_s)
        self.windows = WindowDesk(plan.vehicle, horizon_s=plan.config.horizon_s)
        self._planner = RoundPlanner(plan.config, plan.vehicle)
        self.draw_cases = self._planner.draw_cases
        keep_vehicles(plan.folder, [plan.vehicle])
        self.pace = RoundPace(
            most=plan.config.futures,
            least=plan.config.fewest_futures,
            period_s=1.0 / plan.config.rate_hz,
        )
        self._next_round_id = 0
        self._seeds: dict[int, _Seed] = {}
        self._told_slow = False
        self._told_planners: set[str] = set()

    @property
    def short_of(self) -> str:
        """What is run of what was asked for; empty where it is all."""
        if not self.pace.slowed:
            return ""
        now = self.pace.now
        rarely = "" if now.one_of == 1 else f" in 1 of {now.one_of} rounds"
        return f"{now.futures} of {self._plan.config.futures} futures{rarely}"

    def start(
        self,
        intent: RoundIntent,
        latest: LatestState,
        said: LatestReports,
        *,
        started_mono_ns: int,
    ) -> None:
        """Open a round and give its jobs out."""
        round_id, self._next_round_id = self._next_round_id, self._next_round_id + 1
        pace = self.pace.now
        jobs = self._planner.plan(
            round_id,
            intent,
            latest.state,
            said,
            self._world_of(intent.world_id),
            start_stamp_ns=self.start_stamp_ns,
            count=pace.futures,
        )
        self._seeds[round_id] = _Seed(latest.state, said.plan, intent, pace)
        self.desk.open(
            RoundOrder(
                round_id=round_id,
                stamp_ns=latest.state.stamp_ns,
                junction_id=intent.junction_id,
                world_id=intent.world_id,
                receipt_mono_ns=latest.receipt_mono_ns,
                started_mono_ns=started_mono_ns,
                jobs=jobs,
            )
        )
        self.give_out()

    def use_vehicle(self, vehicle: VehicleParameters, version: int) -> None:
        """Plan rounds for these parameters from now on, which workers have as `version`."""
        self._planner.use_vehicle(vehicle, version)
        keep_vehicles(self._plan.folder, [vehicle])

    def drop(self) -> None:
        """Give up the open rounds: they take too long."""
        for round_id in self.desk.open_rounds:
            self._take_time(self._seeds.pop(round_id).pace, math.inf)
        self.desk.drop()

    def give_out(self) -> None:
        """Send waiting jobs to idle workers."""
        for worker_id, job in self.desk.assignments():
            self._bus.request(
                "job",
                job,
                self._mailbox,
                tag=(worker_id, job),
                timeout_s=JOB_TIMEOUT_S,
                run=self._plan.run_id,
                process=worker_id,
            )

    def reply(self, reply: Reply) -> None:
        """Take a worker's answer."""
        worker_id, job = reply.tag
        refused = reply.message is None and reply.error != "no answer"
        if reply.message is None:
            self.failed_jobs += 1
            if refused:
                self._tell(Tell("error", f"{worker_id}: {reply.error}"))
        elif reply.message.cpu_seconds > 0.0:
            self.rtf[worker_id] = reply.message.sim_seconds / reply.message.cpu_seconds
        done = self.desk.result(
            worker_id, job, reply.message, reply.received_mono_ns, refused=refused
        )
        if done is not None:
            self._take_apart(done)
        self.give_out()

    def take_state(self, state: VehicleState) -> None:
        """Add where the car is: comparisons fall due."""
        for comparison in self._comparison_desk.take_state(state):
            self._keep(comparison)

    def finish(self) -> None:
        """Compare what can still be compared at the drive's end."""
        for comparison in self._comparison_desk.flush():
            self._keep(comparison)
        rows = [judged_row(o, start_stamp_ns=self.start_stamp_ns) for o in self.windows.finish()]
        self._tables.add("agreement", rows)

    def _take_apart(self, done: RoundDone) -> None:
        order = done.order
        seed = self._seeds.pop(order.round_id)
        for expired in [r for r in self._seeds if r < order.round_id]:
            del self._seeds[expired]
        self._take_time(seed.pace, done.seconds)
        world = self._world_of(order.world_id)
        futures, rows, distinct = round_futures(done, vehicle=self._plan.vehicle.name)
        sha = self.futures.take(done, distinct=distinct)
        self._on_round(order.junction_id, len(rows))
        self._tables.add("futures", rows)
        for job, recorded in zip(order.jobs, order.recorded, strict=True):
            self._tables.add("jobs", [job_row(job, recorded)])
            self._tables.add("road_users", road_user_rows(job, recorded.sha256))
        row = round_row(
            done,
            start_stamp_ns=self.start_stamp_ns,
            distinct=distinct,
            sha256=sha,
            cruise_speed_mps=seed.intent.cruise_speed_mps,
        )
        self._tables.add("rounds", [row])
        view = round_view(done, futures, world.frame, self._plan.drive_frame)
        self._bus.publish("round", view, run=self._plan.run_id)
        self._tell_of_planners(done)
        if futures.valid[0]:  # a nominal future that diverged says nothing of anything
            self._comparison_desk.take_round(done, world.frame, seed.state)
            self.windows.take_round(done, seed.intent.path, world)
            self._compare_plans(done, seed, world)

    def _tell_of_planners(self, done: RoundDone) -> None:
        """Say once of each planner that it failed, or that another one had to act for it."""
        planners = iter(future.planner for future in done.order.futures)
        for result in done.results:
            failures, remarks = result.outcome.failures, result.outcome.remarks
            for place, planner in zip(range(len(result.future_indices)), planners, strict=False):
                words = (failures[place] if failures else "") or (remarks[place] if remarks else "")
                if words and planner not in self._told_planners:
                    self._told_planners.add(planner)
                    self._tell(Tell("warning", f"a future driven by {planner}: {words}"))

    def _take_time(self, pace: Pace, seconds: float) -> None:
        """Count how long a round took, and tell where the next ones have another pace."""
        if not self.pace.take(pace, seconds):
            return
        if not self.pace.slowed:
            self._tell(Tell("info", "the machine keeps up: all futures in every round again"))
            return
        text = (
            f"{self.short_of} from now on: the machine is too slow for all at "
            f"{self._plan.config.rate_hz:g} Hz"
        )
        self._tell(Tell("info" if self._told_slow else "warning", text))
        self._told_slow = True

    def _compare_plans(self, done: RoundDone, seed: _Seed, world: World) -> None:
        if seed.plan is None or seed.state.stamp_ns - seed.plan.stamp_ns > PLAN_FRESH_NS:
            return
        compared = compare_plan(
            seed.plan,
            done.results[0].trajectory,
            seed.intent.path,
            world_frame=world.frame,
            round_id=done.order.round_id,
        )
        if compared is not None:
            self.plans.take(compared)
            self._tables.add("plan_comparisons", [plan_row(compared)])
            self._bus.publish("plan_comparison", compared, run=self._plan.run_id)

    def _keep(self, comparison: Comparison) -> None:
        self.comparisons.take(comparison)
        self._tables.add("comparisons", [comparison_row(comparison)])
        self._bus.publish("comparison", comparison, run=self._plan.run_id)
