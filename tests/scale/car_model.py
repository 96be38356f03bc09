"""Cars whose rounds are played on shared seats: how long a round takes, and how many come late."""

from __future__ import annotations

import functools
from collections import OrderedDict, deque
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from tests.scale.engine import Call, Clock, Host, Thread

KEPT_WORLDS = 8
"""A live worker's `kept_worlds`."""
PERIOD_S = 0.5
JUNCTION_S = 20.0
"""So long a car's rounds are about one World: some 200 m at 10 m/s."""


class CarCosts(msgspec.Struct, frozen=True, kw_only=True):
    """What a car's rounds cost; CPU seconds of a core whose neighbours are idle."""

    job_cpu_s: tuple[float, ...]
    """Of the jobs of a round together, as rounds were measured."""
    start_s: float
    """What the orchestrator takes to start a round and give its jobs out."""
    end_s: float
    """What it takes to take a round apart, before it is shown."""
    world_s: float
    """What a seat takes to compile a World that it does not hold."""
    question_bytes: float
    answer_bytes: float
    """Of one job."""
    contention: float


class Cluster(NamedTuple):
    """Who plays the rounds of all cars: `seats` on hosts of `cores`, behind one switch or router
    that passes `bytes_per_s`, `away_s` from the cars one way."""

    seats: int
    cores: int
    bytes_per_s: float = 1.25e9
    away_s: float = 0.0
    jobs_per_round: int = 2


class Rounds(NamedTuple):
    """Seconds (N,) from each round's state to its view, and how many were never begun since the one
    before was not done."""

    taken_s: Array
    missed: int
    core_use: float
    """Of the seats' cores, the share that was busy."""
    link_use: float

    @property
    def late_share(self) -> float:
        """Return the share of rounds that were later than the next is due, or missed."""
        late = int((self.taken_s > PERIOD_S).sum()) + self.missed
        return late / max(len(self.taken_s) + self.missed, 1)

    def percentile_s(self, percent: float) -> float:
        """Return what so many percent of the rounds took at most."""
        return float(np.percentile(self.taken_s, percent))


class _Seat:
    def __init__(self, host: Host) -> None:
        self.host, self.free = host, True
        self.worlds: OrderedDict[int, None] = OrderedDict()


class _Job(NamedTuple):
    car: int
    number: int
    work_s: float
    world: int


class CarsModel:
    """So many cars with two rounds a second each, on a cluster."""

    def __init__(self, costs: CarCosts, cars: int, cluster: Cluster, *, seed: int = 0) -> None:
        self._clock, self._costs, self._cluster = Clock(), costs, cluster
        self._random = np.random.default_rng(seed)
        hosts = -(-cluster.seats // cluster.cores)
        self._hosts = [
            Host(self._clock, cluster.cores, contention=costs.contention) for _ in range(hosts)
        ]
        self._free = deque(_Seat(self._hosts[n % hosts]) for n in range(cluster.seats))
        """In the order in which they became free; those that are not any more are passed over."""
        self._holders: dict[int, list[_Seat]] = {}
        """Who holds a World."""
        self._waiting: deque[_Job] = deque()
        self._link = Thread(Host(self._clock, 1))
        self._own = [Thread(Host(self._clock, 1)) for _ in range(cars)]
        """Each car has an orchestrator with a core of its own."""
        self._open: dict[int, int] = {}
        self._began_s: dict[int, float] = {}
        self._taken_s: list[float] = []
        self._missed = 0
        self._settled_s = 0.0

    def drive(self, seconds: float, *, settled_s: float = 5.0) -> Rounds:
        """Let all cars drive so long and return their rounds after a beginning."""
        self._settled_s = settled_s
        for car in range(len(self._own)):
            first_s = float(self._random.uniform(0.0, PERIOD_S))
            for number in range(int((seconds - first_s) / PERIOD_S)):
                self._clock.after(first_s + number * PERIOD_S, self._due(car))
        self._clock.run()
        busy_s = sum(host.busy_core_s for host in self._hosts)
        passed_s = self._clock.now_s
        return Rounds(
            taken_s=np.array(self._taken_s),
            missed=self._missed,
            core_use=busy_s / (passed_s * self._cluster.seats),
            link_use=self._link.work_s / passed_s,
        )

    def _due(self, car: int) -> Call:
        return functools.partial(self._begin, car)

    def _begin(self, car: int) -> None:
        if car in self._open:
            self._missed += self._clock.now_s >= self._settled_s
            return
        costs, parts = self._costs, self._cluster.jobs_per_round
        self._open[car] = parts
        self._began_s[car] = self._clock.now_s
        work_s = float(self._random.choice(costs.job_cpu_s)) / parts
        shifted_s = self._clock.now_s + JUNCTION_S * car / len(self._own)
        world = car * 1_000_000 + int(shifted_s / JUNCTION_S)

        def given() -> None:
            for number in range(parts):
                job = _Job(car, number, work_s, world)
                self._travel(costs.question_bytes, functools.partial(self._come, job))

        self._own[car].do(costs.start_s, given)

    def _travel(self, size: float, then: Call) -> None:
        """Pass the switch after all that came before, and be there some time later."""
        seconds = size / self._cluster.bytes_per_s
        self._link.do(seconds, lambda: self._clock.after(self._cluster.away_s, then))

    def _come(self, job: _Job) -> None:
        self._waiting.append(job)
        self._give_out()

    def _give_out(self) -> None:
        while self._waiting and (seat := self._seat_for(self._waiting[0].world)) is not None:
            job = self._waiting.popleft()
            seat.free = False
            work_s = job.work_s + (0.0 if self._held(seat, job.world) else self._costs.world_s)
            seat.host.run(work_s, functools.partial(self._played, job, seat))

    def _seat_for(self, world: int) -> _Seat | None:
        """Return a free seat, one that holds the World if there is one."""
        for seat in self._holders.get(world, ()):
            if seat.free:
                return seat
        while self._free and not self._free[0].free:
            self._free.popleft()
        return self._free.popleft() if self._free else None

    def _held(self, seat: _Seat, world: int) -> bool:
        """Let a seat hold a World; returns whether it did already."""
        held = world in seat.worlds
        seat.worlds[world] = None
        seat.worlds.move_to_end(world)
        if not held:
            self._holders.setdefault(world, []).append(seat)
        while len(seat.worlds) > KEPT_WORLDS:
            left, _ = seat.worlds.popitem(last=False)
            self._holders[left].remove(seat)
        return held

    def _played(self, job: _Job, seat: _Seat) -> None:
        seat.free = True
        self._free.append(seat)
        self._travel(self._costs.answer_bytes, functools.partial(self._answered, job.car))
        self._give_out()

    def _answered(self, car: int) -> None:
        self._open[car] -= 1
        if not self._open[car]:
            self._own[car].do(self._costs.end_s, functools.partial(self._shown, car))

    def _shown(self, car: int) -> None:
        del self._open[car]
        if self._began_s[car] >= self._settled_s:
            self._taken_s.append(self._clock.now_s - self._began_s[car])
