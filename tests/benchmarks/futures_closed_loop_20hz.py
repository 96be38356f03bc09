"""64 futures of 8 s with a planner at 20 Hz on open ground, against stepping the model in C."""

from __future__ import annotations

from sim_worker.futures import run_job
from sim_worker.stage import Stage
from sim_worker.variants import plan_variants
from sim_worker.vehicle.parameters import load_vehicle
from tests.benchmarks import scenes
from tests.benchmarks.bare_loop import simulated_seconds_per_cpu_second
from tests.benchmarks.measuring import Measurement, cpu_minimum_s

REPEATS = 12


def measure() -> Measurement:
    """Return simulated seconds per CPU second; nobody else is on the road."""
    return measure_scene(buildings=0, road_users=False)


def measure_scene(*, buildings: int, road_users: bool) -> Measurement:
    """Return simulated seconds per CPU second of whole jobs, against the bare loop."""
    world = scenes.street(buildings=buildings)
    stage = Stage(
        world, load_vehicle(), nsim=scenes.FUTURES, control_hz=scenes.CONTROL_HZ, threads=1
    )
    if stage.model.ngeom < buildings:
        raise AssertionError(f"{buildings} buildings, but the stage has {stage.model.ngeom} geoms")
    variants = plan_variants(count=scenes.FUTURES, seed=0, planners=["pure_pursuit_idm"])
    job = scenes.job(world, variants if road_users else scenes.without_road_users(variants))
    valid = run_job(job, stage).outcome.valid
    if not valid.all():
        raise AssertionError(f"{(~valid).sum()} futures diverged: their cost says nothing")

    cpu_s, baseline = float("inf"), 0.0
    for _ in range(REPEATS):
        cpu_s = min(cpu_s, cpu_minimum_s(lambda: run_job(job, stage), repeats=1))
        bare = simulated_seconds_per_cpu_second(
            stage.model, seconds=scenes.HORIZON_S, repeats=10, speed_mps=scenes.SPEED_MPS,
            joint="ego_x",
        )  # fmt: skip
        baseline = max(baseline, bare)
    return Measurement(scenes.FUTURES * scenes.HORIZON_S / cpu_s, "simulated s per CPU s", baseline)
