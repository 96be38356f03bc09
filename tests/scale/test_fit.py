"""Costs are found again in sweeps that were made of them, and a sweep that differs is noticed."""

from __future__ import annotations

import msgspec
import pytest

from tests.scale.fit import fitted_costs, predictions
from tests.scale.measured import FITTED, HELD_OUT, Car, Dispatched, Measured, Stored, Worlds
from tests.scale.sweep_model import JobShape, SweepCosts, SweepModel
from tests.scale.sweep_runs import PARTS, PlayedJob, SweepRun

COSTS = SweepCosts(
    job_s=0.08, future_s=0.0015, first_s=0.06, parent_job_s=0.004, parent_future_s=0.0001,
    between_s=0.0, contention=0.1,
)  # fmt: skip
CORES = 2


def shapes(size: int) -> tuple[tuple[str, int], ...]:
    """Six jobs in each of four Worlds, those of one half as large."""
    return tuple((f"w{n // 6}", size // 2 if n < 6 else size) for n in range(24))


def sweep(
    workers: int, size: int, *, vehicles: int = 1, slower: float = 1.0, others: float = 0.0
) -> SweepRun:
    """Return a sweep that takes what the costs say, each worker its own share of the Worlds, while
    others take so many cores."""
    jobs, at_s, known = [], [0.0] * workers, [set[str]() for _ in range(workers)]
    own = [JobShape._make(one) for one in shapes(size) * vehicles]
    slowed = slower * (1.0 + COSTS.contention * min(workers - 1.0, 1.0))
    for number, shape in enumerate(own):
        place = number % workers
        first = shape.world not in known[place]
        known[place].add(shape.world)
        cpu_s = slowed * (COSTS.job_s + COSTS.future_s * shape.futures + COSTS.first_s * first)
        # More workers than cores that are left: each waits for one of them.
        ready_s = cpu_s * max(workers / (CORES - others) - 1.0, 0.0)
        ended_s = at_s[place] + cpu_s + ready_s
        jobs.append(PlayedJob(f"w{place}", *shape, first, at_s[place], ended_s, cpu_s, ready_s))
        at_s[place] = ended_s
    futures = sum(shape.futures for shape in own)
    parent_s = 0.05 + COSTS.parent_job_s * len(own) + COSTS.parent_future_s * futures
    return SweepRun(
        workers=workers, futures_per_job=size, vehicles=vehicles, futures=futures,
        jobs=tuple(jobs), parts_s=dict.fromkeys((*PARTS, "other"), 0.01), wall_s=max(at_s),
        parent_cpu_s=parent_s * (1.0 + COSTS.contention * min(workers - 1.0, 1.0)),
        summary_cpu_s=0.1, starting_cpu_s=0.9, answer_bytes=1e5, others_cores=others,
    )  # fmt: skip


def measured(runs: list[SweepRun]) -> Measured:
    """Return them with all else that a model is fed with, of no account here."""
    car = Car(
        rounds_cpu_s=(0.1, 0.12), start_s=0.008, end_s=0.004, latency_s=(0.1,),
        orchestrator_cores=0.1, others_cores=0.0, samples_per_s=300.0, sample_cpu_s=2e-4,
        question_bytes=2e4, answer_bytes=9e4, telemetry_bytes_per_s=5e4,
        recorded_bytes_per_s=8e4,
    )  # fmt: skip
    return Measured(
        day="2026-11-23", processor="drawn", cores=CORES, load=(0.0, 0.0),
        runs=tuple(runs),
        shapes={str(size): shapes(size) for size in (16, 32, 64)},
        dispatched=(Dispatched(2, 1e-5), Dispatched(256, 1e-5)),
        worlds=Worlds(0.1, 0.3, 0.01, 4e4), stored=Stored(6400.0, 700.0, 3.0, 2e4, 1e5), car=car,
    )  # fmt: skip


def all_runs(*, slower: float = 1.0, others: float = 0.0) -> list[SweepRun]:
    """Return two repeats of each configuration; held-out ones may be slower, or beside others."""
    runs = [sweep(*pair) for pair in FITTED for _ in range(2)]
    runs += [sweep(*pair, slower=slower, others=others) for pair in HELD_OUT for _ in range(2)]
    return [*runs, sweep(2, 16, vehicles=3)]


def test_nothing_that_is_held_out_is_fitted() -> None:
    assert set(FITTED).isdisjoint(HELD_OUT)


def test_costs_are_found_again() -> None:
    told = measured(all_runs(slower=2.0))
    found = fitted_costs(told, [run for pair in FITTED for run in told.runs_of(*pair)])
    for name in (
        "job_s", "future_s", "first_s", "parent_job_s", "parent_future_s", "contention",
    ):  # fmt: skip
        assert getattr(found, name) == pytest.approx(getattr(COSTS, name), rel=0.01), name


def test_sweeps_of_the_same_costs_are_predicted() -> None:
    for one in predictions(measured(all_runs())):
        # Who plays which job is told by the program's state machine, here by turns.
        assert abs(one.median_error) < 0.15, one


def test_what_others_take_is_known_to_the_model_and_no_error_of_it() -> None:
    quiet, busy = (predictions(measured(all_runs(others=others))) for others in (0.0, 0.8))
    for one, beside in zip(quiet, busy, strict=True):
        assert abs(beside.median_error) < 0.15, beside
        if one.what == "wall, as it was":
            assert beside.predicted_s[0] == pytest.approx(one.predicted_s[0] / 0.6, rel=0.05)


def test_a_sweep_that_takes_half_as_long_again_is_not() -> None:
    for one in predictions(measured(all_runs(slower=1.5))):
        assert one.median_error < -0.15, one


def test_a_model_of_two_workers_knows_their_contention() -> None:
    jobs = [JobShape._make(one) for one in shapes(16)]
    alone = SweepModel(msgspec.structs.replace(COSTS, contention=0.0), workers=2, cores=2)
    assert SweepModel(COSTS, workers=2, cores=2).play(jobs).wall_s == pytest.approx(
        1.1 * alone.play(jobs).wall_s, rel=0.03
    )


def test_two_workers_that_take_less_than_one_have_no_contention() -> None:
    told = measured([sweep(1, 16), sweep(1, 64), sweep(2, 16, slower=0.5)])
    assert fitted_costs(told, told.runs).contention == 0.0


def test_time_without_a_processor_is_no_work_and_no_idleness() -> None:
    run = sweep(3, 64)
    assert run.share_of_core == pytest.approx(2.0 / 3.0)
    assert run.unhindered_s == pytest.approx(run.makespan_s * 2.0 / 3.0, rel=0.05)
    two = sweep(2, 64)
    assert two.idle_share == pytest.approx(0.0, abs=0.05)
