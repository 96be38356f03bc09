"""The other processes of a drive on a bus in memory: they answer when a test tells them to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.codec import read_message
from foretwin.contracts.drive import DriveEnd, GnssFix, VehicleInfo, VehicleState
from foretwin.contracts.frames import local_from_geo, local_from_geo_yaw
from foretwin.contracts.futures import FuturesResult, Job, Outcome, Trajectory
from foretwin.contracts.keys import alive_key
from foretwin.contracts.mailbox import Mailbox, Request
from foretwin.contracts.runner import JobAnswer
from foretwin.contracts.simulation import BuildReply, BuildRequest, PrepareReply, PrepareRequest
from foretwin.contracts.world import World
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.results import ResultTables
from foretwin.world_gen.world_store import WorldStore
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.futures_rounds import nobody
from tests.orchestrator.trip import START_NS, states_along, town, town_line, town_plan, town_world

INFO = VehicleInfo(
    vehicle_id="ego", time_base="log", start_stamp_ns=START_NS, body_from_antenna_m=(0.0, 0.0, 0.0)
)


def straight_futures(job: Job, world: World, worker_id: str) -> FuturesResult:
    """Futures that go straight on at the car's speed, each future 3 % slower than the last."""
    position, speed = job.state.position, job.state.speed_mps
    xy = local_from_geo(world.frame, position.lat_deg, position.lon_deg)
    yaw = float(
        local_from_geo_yaw(world.frame, job.state.yaw_rad, position.lat_deg, position.lon_deg)
    )
    time_s = np.arange(round(job.horizon_s / job.step_s) + 1) * job.step_s
    states = np.zeros((len(job.futures), len(time_s), 8), dtype=np.float32)
    for row, future in zip(states, job.futures, strict=True):
        way_m = speed * (1.0 - 0.03 * future.index) * time_s
        row[:, 0], row[:, 1], row[:, 2] = (
            xy[0] + way_m * np.cos(yaw),
            xy[1] + way_m * np.sin(yaw),
            yaw,
        )
        row[:, 3] = speed
    count = len(job.futures)
    return FuturesResult(
        round_id=job.round_id, job_index=job.job_index, worker_id=worker_id,
        world_id=job.world_id, future_indices=tuple(v.index for v in job.futures),
        trajectory=Trajectory(stamp_ns=job.state.stamp_ns, time_s=time_s, states=states),
        road_users=nobody(count, len(time_s)),
        metrics={}, accidents=(), left_out=("",) * count,
        outcome=Outcome(
            collided=np.zeros(count, dtype=bool), collision_time_s=np.full(count, np.nan),
            collision_with=np.zeros(count, dtype=np.int64),
            min_clearance_m=np.full(count, np.nan), progress_m=states[:, -1, 0].astype(float),
            valid=np.ones(count, dtype=bool),
        ),
        sim_seconds=8.0 * count, cpu_seconds=0.1 * count, wall_seconds=0.1,
    )  # fmt: skip


class AtOnce:
    """Takes the place of a mailbox: what is put in is handled there and then."""

    def __init__(self, handle: Callable[[Any], None]) -> None:
        self.put = handle


class Process:
    """A process that serves channels; dead, it answers nothing any more.

    `at_once` makes it answer within the question, otherwise `answer` does when a test calls it.
    """

    def __init__(
        self,
        plan: DrivePlan,
        bus: MemoryBus,
        process_id: str,
        channels: tuple[str, ...],
        *,
        at_once: bool = False,
    ) -> None:
        self.plan = plan
        self.process_id = process_id
        self.requests: Any = AtOnce(self.answer_one) if at_once else Mailbox(64)
        self._bus = bus
        for channel in channels:
            bus.serve(channel, self.requests, run=plan.run_id, process=process_id)
        bus.declare_alive(alive_key(run=plan.run_id, process=process_id))

    def take(self) -> list[Request]:
        """What it has been asked since the last time."""
        taken = []
        while (item := self.requests.take()) is not None:
            taken.append(item)
        return taken

    def answer(self) -> None:
        """Answer whatever has been asked."""
        for request in self.take():
            self.answer_one(request)

    def answer_one(self, request: Request) -> None:
        raise NotImplementedError

    def die(self) -> None:
        """Vanish with everything that was asked."""
        self.requests.close()
        self.take()
        self._bus.lose(alive_key(run=self.plan.run_id, process=self.process_id))


class Builder(Process):
    """Builds the town's Worlds in earnest."""

    def __init__(self, plan: DrivePlan, bus: MemoryBus, *, at_once: bool = False) -> None:
        self.asked: list[str] = []
        self.refuses: tuple[str, ...] = ()
        super().__init__(plan, bus, "builder", ("build",), at_once=at_once)

    def answer_one(self, request: Request) -> None:
        wanted: BuildRequest = request.message()
        self.asked.append(wanted.intersection_id)
        if wanted.intersection_id in self.refuses:
            request.refuse("the map is torn there")
            return
        world = town_world(wanted.intersection_id)
        WorldStore(Path(self.plan.worlds_dir)).save(world)
        request.reply(
            BuildReply(
                intersection_id=wanted.intersection_id, world_id=world.id, seconds=0.1,
                cached=False,
            )
        )  # fmt: skip


class Worker(Process):
    """Loads Worlds and answers jobs with futures that go straight on."""

    def __init__(
        self, plan: DrivePlan, bus: MemoryBus, worker_id: str, *, at_once: bool = False
    ) -> None:
        self.prepared: list[str] = []
        self.jobs = 0
        self.remark = ""
        """What its planners say of each future."""
        self.spoil: Callable[[FuturesResult], FuturesResult] = lambda result: result
        """What a sick worker makes of its results."""
        self.cpu_s = 0.0
        """What it says that it has taken until now."""
        self.diverges = False
        """Whether its simulations end in numbers that are none."""
        super().__init__(plan, bus, worker_id, ("prepare", "job"), at_once=at_once)

    def answer_one(self, request: Request) -> None:
        message = request.message()
        if isinstance(message, PrepareRequest):
            self.prepared.append(message.world_id)
            request.reply(
                PrepareReply(world_id=message.world_id, worker_id=self.process_id, seconds=0.1)
            )
            return
        self.jobs += 1
        job = message.decoded()
        world = read_message(self.plan.worlds_dir / f"{job.world_id}.world", World)
        futures = straight_futures(job, world, self.process_id)
        if self.remark:
            remarks = (self.remark,) * len(job.futures)
            outcome = msgspec.structs.replace(futures.outcome, remarks=remarks)
            futures = msgspec.structs.replace(futures, outcome=outcome)
        if self.diverges:
            futures.trajectory.states[:, 1:] = np.nan
            futures.outcome.valid[:] = False
        request.reply(JobAnswer(result=self.spoil(futures), cpu_s=self.cpu_s))


class House:
    """A conductor with its builder, its workers and a car that drives through the town."""

    def __init__(
        self,
        folder: Path,
        *,
        at_once: bool = False,
        plan: DrivePlan | None = None,
        **settings: Any,
    ) -> None:
        """`plan` is that of a drive to go on with."""
        given = {"futures": 6, "futures_per_job": 3, **settings}
        # However slow the machine is that tests run on, rounds are of one size.
        self.plan = plan or town_plan(folder, **{"least_futures": given["futures"], **given})
        self.bus = MemoryBus()
        inputs = town()
        self.mission = Mission(inputs.way_ahead(), MissionSettings())
        self.tables = ResultTables(self.plan.folder / "results", {"run_id": self.plan.run_id})
        self.conductor = Conductor(self.plan, self.bus, self.mission, self.tables)
        self.conductor.join()
        self.builder = Builder(self.plan, self.bus, at_once=at_once)
        self.workers = [
            Worker(self.plan, self.bus, f"w{number}", at_once=at_once)
            for number in range(self.plan.config.workers)
        ]
        self.conductor.take_info(INFO)
        self.seen = Mailbox(4096)
        """What those who watch receive."""
        for channel in ("event", "active_world", "world", "round", "comparison", "plan_comparison"):
            self.bus.subscribe(channel, self.seen, run=self.plan.run_id)
        self.states = states_along(inputs.graph.frame, town_line())
        self._sent = 0
        self.settle()

    def settle(self) -> None:
        """Let the conductor handle everything that lies in its mailbox."""
        while (item := self.conductor.mailbox.take()) is not None:
            self.conductor.handle(item)

    def work(self) -> None:
        """Let everybody answer until nobody is asked anything."""
        before = -1
        while before != len(self.builder.asked) + sum(
            w.jobs + len(w.prepared) for w in self.workers
        ):
            before = len(self.builder.asked) + sum(w.jobs + len(w.prepared) for w in self.workers)
            self.builder.answer()
            self.settle()
            for worker in self.workers:
                worker.answer()
            self.settle()

    def send(self, state: VehicleState) -> None:
        """Let the car publish where it is."""
        fix = GnssFix(stamp_ns=state.stamp_ns, position=state.position)
        self.bus.publish("gnss", fix, vehicle="ego")
        self._sent += 1

    def drive(self, until: int, *, working: bool = True, round_every: int = 0) -> None:
        """Let the car drive to its state number `until`, everybody at work on the way."""
        for number in range(self._sent, until):
            self.send(self.states[number])
            self.settle()
            if working:
                self.work()
            if round_every and number % round_every == 0:
                self.conductor.start_round()
                if working:
                    self.work()

    def end(self) -> None:
        """Let the car say its last word, and write everything."""
        stamp_ns = self.states[self._sent - 1].stamp_ns
        end = DriveEnd(stamp_ns=stamp_ns, published={"gnss": self._sent})
        self.bus.publish("end", end, vehicle="ego")
        self.settle()
        self.conductor.finish()
        self.conductor.rounds.judge()
        self.tables.close()

    def watched(self, channel: str) -> list[Any]:
        """Messages on a channel since the last time."""
        found = []
        while (item := self.seen.take()) is not None:
            if item.channel == channel:
                found.append(item.message())
        return found
