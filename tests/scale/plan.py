"""What the model says of sizes that nobody here measures: what saturates, cores, bytes, money."""

from __future__ import annotations

import functools
from typing import NamedTuple

from tests.scale.car_model import PERIOD_S, CarCosts, CarsModel, Cluster, Rounds
from tests.scale.fit import fitted_costs
from tests.scale.measured import FITTED, Measured
from tests.scale.sweep_model import SweepCosts, SweepModel, in_worlds

FUTURES_PER_JOB = 64
JOBS_PER_WORLD = 64
"""Of a large sweep: some 4,000 futures at a junction."""
HOST_CORES = 32
"""Of a machine in a cluster; each core has one seat."""
WORKERS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
CARS = (1, 10, 1000)
SEATS_PER_CAR = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.7, 1.0, 1.5, 2.0)
_ROUNDS_WANTED = 8_000
"""Of all cars together: so that one late in a hundred is told."""


class Prices(NamedTuple):
    """US dollars, list prices in us-east-1; see docs/scale.md for where they are from."""

    core_hour: float = 0.0408
    gigabyte_month: float = 0.023
    thousand_files: float = 0.005
    gigabyte_out: float = 0.09


class Throughput(NamedTuple):
    """Futures a second of a sweep, and the share of the time in which its parent was busy."""

    futures_per_s: float
    parent_use: float


class SweepAtScale(NamedTuple):
    """A sweep of so many futures, played by shards of a thousand workers at most."""

    futures: float
    core_hours: float
    stored_bytes: float
    files: float
    bus_bytes: float
    dollars: tuple[float, float, float]
    """For cores, for putting the files, and for keeping them a month."""


class CarsAtScale(NamedTuple):
    """So many cars on the fewest seats with at most one round in a hundred late."""

    cars: int
    seats: int
    rounds: Rounds
    cores: float
    """With the cars' orchestrators."""
    bus_bytes_per_s: float
    telemetry_bytes_per_s: float


def costs_of(measured: Measured) -> SweepCosts:
    """Return the costs that the held-out sweeps were predicted with."""
    return fitted_costs(measured, [run for pair in FITTED for run in measured.runs_of(*pair)])


@functools.cache
def one_parent(costs: SweepCosts, workers: int) -> Throughput:
    """Return what one parent gets of so many workers on machines of their own."""
    jobs = max(12 * workers, 128)
    shapes = in_worlds(jobs, worlds=-(-jobs // JOBS_PER_WORLD), futures=FUTURES_PER_JOB)
    model = SweepModel(
        costs,
        workers=workers,
        cores=min(workers, HOST_CORES),
        hosts=-(-workers // HOST_CORES),
        local=False,
    )
    time = model.play(shapes)
    wall_s = max(time.wall_s, time.parent_cpu_s)  # it may have answers left at the end
    return Throughput(jobs * FUTURES_PER_JOB / wall_s, time.parent_cpu_s / wall_s)


def sweep_at_scale(measured: Measured, futures: float, prices: Prices) -> SweepAtScale:
    """Return what a sweep costs in jobs of 64, one World for each 64 jobs, all cores busy."""
    costs, stored, worlds = costs_of(measured), measured.stored, measured.worlds
    jobs = futures / FUTURES_PER_JOB
    job_s = costs.job_s + costs.future_s * FUTURES_PER_JOB + costs.first_s / JOBS_PER_WORLD
    job_s += (worlds.build_cpu_s + worlds.place_cpu_s) / JOBS_PER_WORLD
    job_s *= 1.0 + costs.contention
    job_s += costs.parent_job_s + costs.parent_future_s * FUTURES_PER_JOB
    core_hours = jobs * job_s / 3600.0
    stored_bytes = futures * (stored.row_bytes + stored.part_bytes / FUTURES_PER_JOB)
    files = jobs * stored.files_per_job
    dollars = (
        core_hours * prices.core_hour,
        files / 1e3 * prices.thousand_files,
        stored_bytes / 1e9 * prices.gigabyte_month,
    )
    bus_bytes = jobs * (stored.question_bytes + stored.answer_bytes)
    return SweepAtScale(futures, core_hours, stored_bytes, files, bus_bytes, dollars)


def car_costs(measured: Measured) -> CarCosts:
    """Return what a car's rounds cost on a core whose neighbours are idle."""
    car = measured.car
    # Two workers side by side were measured.
    contention = costs_of(measured).contention
    slowed = 1.0 + contention
    return CarCosts(
        job_cpu_s=tuple(cpu_s / slowed for cpu_s in car.rounds_cpu_s),
        start_s=car.start_s / slowed,
        end_s=car.end_s / slowed,
        world_s=measured.worlds.compile_cpu_s / slowed,
        question_bytes=car.question_bytes,
        answer_bytes=car.answer_bytes,
        contention=contention,
    )


@functools.cache
def rounds_of(costs: CarCosts, cars: int, seats: int, *, away_s: float = 0.0) -> Rounds:
    """Return the rounds of so many cars on so many seats."""
    seconds = 5.0 + max(_ROUNDS_WANTED * PERIOD_S / cars, 15.0)
    cluster = Cluster(seats, min(seats, HOST_CORES), away_s=away_s)
    return CarsModel(costs, cars, cluster).drive(min(seconds, 600.0))


def cars_at_scale(measured: Measured, cars: int, *, most_late: float = 0.01) -> CarsAtScale:
    """Return the smallest of the wanted sizes of a cluster that keeps rounds in time."""
    costs, car = car_costs(measured), measured.car
    for share in SEATS_PER_CAR:
        seats = max(round(share * cars), 1)
        rounds = rounds_of(costs, cars, seats)
        if rounds.late_share <= most_late:
            break
    both = 2.0 * (car.question_bytes + car.answer_bytes) / PERIOD_S
    return CarsAtScale(
        cars=cars,
        seats=seats,
        rounds=rounds,
        cores=seats + cars * car.orchestrator_cores,
        bus_bytes_per_s=cars * both,
        telemetry_bytes_per_s=cars * car.telemetry_bytes_per_s,
    )
