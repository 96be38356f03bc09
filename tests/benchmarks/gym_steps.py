"""Steps of 64 learners' cars at a roundabout, against stepping their stage and nothing else."""

from __future__ import annotations

import numpy as np

from foretwin.sim_worker.batch.batch_simulation import Controls
from foretwin.sim_worker.gym import JunctionEnv, JunctionVectorEnv
from tests.benchmarks.measuring import Measurement, cpu_seconds
from tests.sim_worker.scenarios.worlds import ring

ROWS, STEPS, REPEATS = 64, 100, 5


def measure() -> Measurement:
    """Return environment steps per CPU second; cars keep their speed, and begin anew if need be."""
    envs = JunctionVectorEnv(ROWS, ring(), control="along_path")
    envs.reset(seed=0)
    stage, nothing = envs.course.rows.stage, np.zeros(ROWS)

    def drive() -> None:
        for _ in range(STEPS):
            envs.step(np.zeros((ROWS, 1), np.float32))

    def step_alone() -> None:
        for _ in range(STEPS):
            stage.step(Controls(nothing, nothing))

    drive()
    env_s = bare_s = float("inf")
    for _ in range(REPEATS):
        envs.reset(seed=0)
        env_s = min(env_s, cpu_seconds(drive))
        envs.reset(seed=0)
        bare_s = min(bare_s, cpu_seconds(step_alone))
    steps = ROWS * STEPS
    return Measurement(
        steps / env_s, "steps per CPU s", steps / bare_s, more={"one_car": _one_car()}
    )


def _one_car() -> float:
    """Return steps per CPU second of an environment with one car."""
    env = JunctionEnv(ring(), control="along_path")
    env.reset(seed=0)

    def drive() -> None:
        for _ in range(STEPS):
            _, _, terminated, truncated, _ = env.step(np.zeros(1, np.float32))
            if terminated or truncated:
                env.reset()

    drive()
    return STEPS / min(cpu_seconds(drive) for _ in range(REPEATS))
