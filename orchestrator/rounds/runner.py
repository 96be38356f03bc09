"""Runs rounds: cuts an intent into jobs, sends them to workers, and takes complete rounds apart."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import NamedTuple

from foretwin.contracts.bus import Reply
from foretwin.contracts.drive import PlannedTrajectory, VehicleState
from foretwin.contracts.runner import Answer
from foretwin.contracts.simulation import Comparison, PlanComparison
from foretwin.contracts.trace import since, traced
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.orchestrator.agreement.known_windows import into_table
from foretwin.orchestrator.agreement.verdict_rows import judged_row
from foretwin.orchestrator.agreement.windows import OpenWindows
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.instructions import LatestReports, LatestState, RoundIntent
from foretwin.orchestrator.record.bookkeeping import ComparisonCount, FuturesCount, PlanCount
from foretwin.orchestrator.record.forecast_count import ForecastCount
from foretwin.orchestrator.record.ledger import RoundTally
from foretwin.orchestrator.record.result_rows import plan_row, round_futures, round_row
from foretwin.orchestrator.record.run_folder import VehicleKeeper
from foretwin.orchestrator.rounds.comparisons import OpenComparisons, plan_compared
from foretwin.orchestrator.rounds.jobs import RoundPlanner
from foretwin.orchestrator.rounds.news import RoundNews
from foretwin.orchestrator.rounds.pace import Pace, Played, RoundPace
from foretwin.orchestrator.rounds.progress_forecasts import ProgressForecasts
from foretwin.orchestrator.rounds.siblings import SIBLING, SiblingRounds
from foretwin.orchestrator.rounds.views import round_view
from foretwin.orchestrator.runner.bus_dispatcher import NO_ANSWER, BusDispatcher
from foretwin.orchestrator.runner.open_rounds import OpenRounds, RoundDone, RoundGivenUp, RoundOrder
from foretwin.sim_worker.futures.columns import row_of
from foretwin.sim_worker.futures.job_tables import job_row, road_user_rows

log = logging.getLogger("orchestrator")

GIVEN_UP_AFTER_S = 10.0
"""A live round that is not complete after so long is given up, and its jobs with it."""


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
        context: DriveContext,
        *,
        world_of: Callable[[str], World],
        on_round: Callable[[str, int], None],
    ) -> None:
        self.open = OpenRounds()
        plan = context.plan
        self._expected = frozenset(f"w{number}" for number in range(plan.config.workers))
        self.dispatcher = BusDispatcher(
            context.bus, context.mailbox, run_id=plan.run_id, expected=self._expected
        )
        self.tally, self.futures = RoundTally(), FuturesCount()
        self.comparisons, self.plans = ComparisonCount(), PlanCount()
        self.rtf: dict[str, float] = {}
        self.next_round_id = self.failed_jobs = self.start_stamp_ns = 0
        self._context, self._plan = context, plan
        self._tables = context.tables
        self.on_other: Callable[[Answer], None] = lambda _: None  # of a task that is no round's
        self._world_of, self._on_round = world_of, on_round
        self._open_comparisons = OpenComparisons(plan.drive_frame, plan.config.horizon_s)
        keep = into_table(context.tables.add, plan.vehicle)
        self.windows = OpenWindows(plan.vehicle, horizon_s=plan.config.horizon_s, on_window=keep)
        self._planner = RoundPlanner(plan.config, plan.vehicle)
        self.draw_cases = self._planner.draw_cases
        self._vehicles = VehicleKeeper(plan.folder, plan.vehicle)
        self.pace = RoundPace(
            most=plan.config.futures,
            least=plan.config.fewest_futures,
            period_s=1.0 / plan.config.rate_hz,
        )
        self._seeds: dict[int, _Seed] = {}
        self._news = RoundNews(context.tell)
        self.siblings = SiblingRounds(context)
        self.forecast_count = ForecastCount()
        self.progress = None
        if plan.progress is not None:
            self.progress = ProgressForecasts(plan.progress, horizon_s=plan.config.horizon_s)

    def start(
        self,
        intent: RoundIntent,
        latest: LatestState,
        reports: LatestReports,
        *,
        started_mono_ns: int,
    ) -> None:
        """Open a round and give its jobs out."""
        self._vehicles.write()
        self.futures.off_lanes_rounds += intent.off_lanes_m > 0.0
        round_id, self.next_round_id = self.next_round_id, self.next_round_id + 1
        pace, lock_step = self.pace.now, self._plan.config.lock_step
        period_ns = round(1e9 / self._plan.config.rate_hz)
        jobs = self._planner.plan(
            round_id,
            intent,
            latest.state,
            reports,
            self._world_of(intent.world_id),
            start_stamp_ns=self.start_stamp_ns,
            count=pace.futures,
            progress=self.progress,
        )
        self._seeds[round_id] = _Seed(latest.state, reports.plan, intent, pace)
        order = RoundOrder(
            round_id=round_id,
            stamp_ns=latest.state.stamp_ns,
            junction_id=intent.junction_id,
            world_id=intent.world_id,
            receipt_mono_ns=latest.receipt_mono_ns,
            started_mono_ns=started_mono_ns,
            jobs=jobs,
            # In lock step nothing hurries; a drive that stands still ends by itself.
            deadline_mono_ns=None if lock_step else started_mono_ns + pace.one_of * period_ns,
        )
        within_s = None if lock_step else GIVEN_UP_AFTER_S
        for task in order.tasks:
            self.dispatcher.submit(task, within_s=within_s, due_s=order.due_s)
        self.dispatcher.give_out()
        self.open.open(order)  # last: what raises before is no round

    def use_vehicle(self, vehicle: VehicleParameters, version: int) -> None:
        """Plan rounds for these parameters from now on, which workers have as `version`."""
        self._planner.use_vehicle(vehicle, version)
        self._vehicles.add(vehicle)

    def next_is_due(self) -> None:
        """Give up the round that is open as another is due, if nobody will or can complete it."""
        for order in self.open.orders:
            for named in order.recorded:
                self._take(self.dispatcher.without_takers(named.sha256))
        for order in self.open.orders:
            if order.age_s > GIVEN_UP_AFTER_S:
                self.open.drop()
                self._fail(order, f"not complete within {GIVEN_UP_AFTER_S:g} s")

    def close(self) -> None:
        """End what the drive's end finds open."""
        for order in self.open.drop():
            log.info("round %d is open at the drive's end", order.round_id)
            self.tally.cut_off += 1
        self.dispatcher.close()

    def never_again(self, worker_id: str) -> None:
        """A worker is not started any more: nothing waits for it."""
        self._expected -= {worker_id}
        self._take(self.dispatcher.expect(self._expected))

    def enroll(self, worker_id: str) -> None:
        """Count with a worker that nobody has started here."""
        self._expected |= {worker_id}
        self._take(self.dispatcher.expect(self._expected))

    def worker_up(self, worker_id: str) -> None:
        """A worker can take jobs, as soon as these are given out."""
        self._take(self.dispatcher.worker_up(worker_id))

    def worker_down(self, worker_id: str) -> None:
        """A worker is gone: its job goes to another."""
        self._take(self.dispatcher.worker_down(worker_id))
        self.dispatcher.give_out()

    def reply(self, reply: Reply) -> None:
        """Take a worker's answer; one that does not fit its job counts as refused."""
        worker_id, task = reply.tag
        if worker_id == SIBLING:
            self.siblings.reply(reply)
            return
        if reply.message is not None:
            misfit = self.open.misfit(task.key, reply.message.result)
            if misfit:
                reply = reply._replace(message=None, error=f"answer of no use: {misfit}")
        if reply.message is None:
            self.failed_jobs += 1
            if reply.error != NO_ANSWER:
                log.warning("%s refuses a job: %s", worker_id, reply.error)
        elif (result := reply.message.result).cpu_seconds > 0.0:
            self.rtf[worker_id] = result.sim_seconds / result.cpu_seconds
        answers = self.dispatcher.reply(reply)
        self._news.health(self.dispatcher.dispatch.sickness.sick)
        self._take(answers)
        if reply.message is not None and reply.message.leaving:
            self.never_again(worker_id)
        self.dispatcher.give_out()

    def _take(self, answers: list[Answer]) -> None:
        for answer in answers:
            match self.open.take(answer):
                case None:
                    self.on_other(answer)
                case RoundDone() as done:
                    self._take_apart(done)
                case RoundGivenUp(order):
                    self._fail(order, answer.failure)

    def _fail(self, order: RoundOrder, reason: str) -> None:
        """Cancel the jobs of a round that is given up; was it slow, the next are smaller."""
        self._news.given_up(order, reason)
        self.tally.fail(reason)
        for named in order.recorded:
            self.dispatcher.cancel(named.sha256)
        pace = self._seeds.pop(order.round_id).pace
        if order.age_s >= GIVEN_UP_AFTER_S:
            self._take_time(pace, math.inf)

    @traced("comparisons due")
    def take_state(self, state: VehicleState) -> None:
        """Add where the car is: comparisons fall due."""
        for comparison in self._open_comparisons.take_state(state):
            self._keep(comparison)
        if self.progress is not None:
            settled = self.progress.take_state(state, self.start_stamp_ns)
            self.forecast_count.take(settled)
            if settled:
                self._tables.add("forecasts", [row_of(one) for one in settled])

    def finish(self) -> None:
        """Compare what can still be compared at the drive's end."""
        for comparison in self._open_comparisons.flush():
            self._keep(comparison)

    def judge(self) -> None:
        """Judge the same seconds simulated and driven, which takes some 40 ms for each window."""
        start_ns, found = self.start_stamp_ns, self.windows.finish()
        self._tables.add("agreement", [judged_row(one, start_stamp_ns=start_ns) for one in found])

    @traced("take a round apart")
    def _take_apart(self, done: RoundDone) -> None:
        order = done.order
        since("round", order.receipt_mono_ns, id=order.round_id, futures=len(order.futures))
        seed = self._seeds.pop(order.round_id)
        self._seeds = {r: later for r, later in self._seeds.items() if r > order.round_id}
        self._take_time(seed.pace, done.seconds, done.played_by)
        self.tally.run += 1
        world = self._world_of(order.world_id)
        futures, rows, distinct = round_futures(done, vehicle=self._plan.vehicle.name)
        self._on_round(order.junction_id, len(rows))
        # What others name first: the writer may write, and be killed, between any two.
        for job, recorded in zip(order.jobs, order.recorded, strict=True):
            self._tables.add("jobs", [job_row(job, recorded)])
            self._tables.add("road_users", road_user_rows(job, recorded.sha256))
        self._tables.add("futures", rows)
        row = round_row(
            done,
            start_stamp_ns=self.start_stamp_ns,
            distinct=distinct,
            sha256=self.futures.take(done, distinct=distinct),
            cruise_speed_mps=seed.intent.cruise_speed_mps,
        )
        self._tables.add("rounds", [row])
        view = round_view(done, futures, world, self._plan.vehicle, self._plan.drive_frame)
        self._context.publish("round", view)
        self._planner.take_worst(order.futures, view.criticality)
        self._news.planners(done)
        if self.progress is not None:
            self.progress.take_round(done)
        if futures.valid[0]:  # a nominal future that diverged says nothing of anything
            self._open_comparisons.take_round(done, world.frame, seed.state, futures.likelihood)
            self.windows.take_round(done, seed.intent.path, world)
            self.siblings.take_round(done, futures, rows)
            self._keep_plan(
                done, plan_compared(done, seed.plan, seed.state, seed.intent.path, world)
            )

    def _take_time(self, pace: Pace, seconds: float, by: tuple[Played, ...] = ()) -> None:
        """Count how long a round took, and tell where the next ones have another pace."""
        if self.pace.take(pace, seconds, by):
            self._news.pace(self.pace.short_of, rate_hz=self._plan.config.rate_hz)

    def _keep_plan(self, done: RoundDone, compared: PlanComparison | None) -> None:
        if compared is None:
            return
        self.plans.take(compared)
        self._tables.add("plan_comparisons", [plan_row(compared)])
        if not done.late:
            self._context.publish("plan_comparison", compared)

    def _keep(self, comparison: Comparison) -> None:
        self.comparisons.take(comparison)
        self.siblings.take_comparison(comparison)
        self._tables.add("comparisons", [row_of(comparison)])
        self._context.publish("comparison", comparison)
