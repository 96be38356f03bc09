"""16 cars under commands known beforehand, against stepping the model in C."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.benchmarks import scenes
from tests.benchmarks.bare_loop import bare_loop
from tests.benchmarks.measuring import Measurement, cpu_seconds

FUTURES = 16
REPEATS = 40
SECONDS = FUTURES * scenes.HORIZON_S


def measure() -> Measurement:
    """Return simulated seconds per CPU second where commands change once a second.

    `ratio_at_20hz` is for commands, and so tyre stiffness and force limits, that change as often
    as those of a planner.
    """
    seldom, often = (stage_of(None, futures=FUTURES, control_hz=hz) for hz in (1.0, 20.0))
    seldom_s = often_s = bare_s = float("inf")
    with bare_loop(seldom.model, seconds=SECONDS, speed_mps=scenes.SPEED_MPS) as bare:
        for _ in range(REPEATS):
            seldom_s = min(seldom_s, cpu_seconds(lambda: drive(seldom)))
            often_s = min(often_s, cpu_seconds(lambda: drive(often)))
            bare_s = min(bare_s, bare())
    return Measurement(
        SECONDS / seldom_s, "simulated s per CPU s", SECONDS / bare_s,
        {"ratio_at_20hz": bare_s / often_s},
    )  # fmt: skip


def stage_of(
    world: World | None, *, futures: int, control_hz: float = scenes.CONTROL_HZ
) -> BatchSimulation:
    """Return a stage of `futures` cars, ready for `drive`."""
    return BatchSimulation(world, load_vehicle(), nsim=futures, control_hz=control_hz, threads=1)


def drive(stage: BatchSimulation) -> None:
    """Let all cars of a stage start anew and drive straight on at 10 m/s for 8 s."""
    count = stage.nsim
    starts = np.zeros((count, 8))
    starts[:, 3] = scenes.SPEED_MPS
    stage.seed(starts, steering_delay_s=np.zeros(count), friction_factor=np.ones(count))
    controls = Controls(np.full(count, 0.3), np.linspace(-0.002, 0.002, count))
    for _ in range(round(scenes.HORIZON_S / stage.control_dt_s)):
        stage.step(controls)
    if stage.diverged().any():
        raise AssertionError("cars diverged: their cost says nothing")
