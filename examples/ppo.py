"""Teaches a roundabout entry by stable-baselines3's PPO as it comes, in some minutes of CPU time.

    pip install 'foretwin[gym]' stable-baselines3
    python examples/ppo.py [--seed N] [--control free] [--steps N] [--world FILE]

The environment is the default one and so are all numbers of the learner; eight cars learn side by
side. Scores are those of 128 episodes whose cases the learner never saw, driven without its noise.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

from foretwin import JunctionVectorEnv, drawn_town

CARS, HELD_OUT, STEPS = 8, 128, 500_000
ENDS = "collided", "off_road", "arrived"


class CarsForLearner(VecEnv):
    """A `JunctionVectorEnv` as stable-baselines3 wants it: what is over begins anew at once."""

    def __init__(self, envs: JunctionVectorEnv) -> None:
        self.envs, self.metadata, self.render_mode = envs, envs.metadata, None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Any:
        """Begin in all rows, by the seed that `seed` was given."""
        found, _ = self.envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return found

    def step_async(self, actions: Any) -> None:
        """Keep what is to be done."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Drive on by a tick; of what is over `infos` tell the end and whether time was."""
        seen, rewards, terminated, truncated, info = self.envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated):
            infos[row] = {
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row]),
            }
        return seen, rewards.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """There is nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """All rows have the same attributes."""
        return [getattr(self.envs, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """No row has attributes of its own."""
        raise NotImplementedError(attr_name)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **given: Any) -> Any:
        """No row has methods of its own."""
        raise NotImplementedError(method_name)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No row is wrapped."""
        return [False] * self.num_envs


def score(model: PPO, envs: JunctionVectorEnv) -> dict[str, float]:
    """Return the shares of episodes, one in each row, that end in each way."""
    seen, _ = envs.reset(seed=10_000)
    over = np.zeros(envs.num_envs, dtype=bool)
    ends = {name: np.zeros(envs.num_envs, dtype=bool) for name in ENDS}
    while not over.all():
        actions, _ = model.predict(seen, deterministic=True)
        seen, _, terminated, truncated, infos = envs.step(actions)
        for name, ended in ends.items():
            ended |= infos[name] & ~over
        over |= terminated | truncated
    return {name: float(ended.mean()) for name, ended in ends.items()}


def learn(world: Any, *, seed: int, steps: int, **settings: Any) -> list[dict[str, float]]:
    """Return the scores on cases never seen before learning and after it."""
    envs = JunctionVectorEnv(CARS, world, autoreset_mode=AutoresetMode.SAME_STEP, **settings)
    held_out = JunctionVectorEnv(HELD_OUT, world, cases=HELD_OUT, cases_seed=1, **settings)
    model = PPO("MlpPolicy", CarsForLearner(envs), seed=seed, device="cpu")
    before = score(model, held_out)
    model.learn(steps)
    return [before, score(model, held_out)]


def main(arguments: Sequence[str] | None = None) -> list[dict[str, float]]:
    """Learn, and print how 128 unseen episodes end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--control", choices=("along_path", "free"), default="along_path")
    parser.add_argument("--world", type=Path, help="a World's file; else the drawn town's")
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)
    town = drawn_town()
    world = chosen.world or town.world(
        next(one.id for one in town.intersections if one.kind == "roundabout")
    )
    began_s = time.process_time()
    scores = learn(world, seed=chosen.seed, steps=chosen.steps, control=chosen.control)
    for name, found in zip(("before", "after"), scores, strict=True):
        ends = ", ".join(f"{end} {share:.1%}" for end, share in found.items())
        print(f"seed {chosen.seed}, {chosen.control}, {name:>6}: {ends}")
    print(f"{time.process_time() - began_s:.0f} s of CPU time for {chosen.steps} steps")
    return scores


if __name__ == "__main__":
    main()
