"""Finds a driver for a roundabout entry by the cross-entropy method, in a minute of CPU time.

    pip install 'foretwin[gym]'
    python examples/cross_entropy.py [--iterations N] [--world FILE]

The driver is linear: its acceleration is a weighted sum of what it sees, steering is path tracking.
It begins with weights of zero, which keep the speed whatever happens. Each iteration draws drivers
around the present one, lets them all drive the same cases side by side in one stage, and moves to
the mean of the best (de Boer, Kroese, Mannor, Rubinstein 2005, A Tutorial on the Cross-Entropy
Method). Scores are those of cases that the search never saw.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin import JunctionVectorEnv, World, drawn_town

Weights = npt.NDArray[np.float64]

INPUTS = (
    "below the speed aimed at",
    "too fast for the bend",
    "nearness of who is ahead",
    "nearness of the line to wait at",
    "nearness of ground that others cross",
    "speed there",
    "nearness of the next road user",
)
"""What the driver weighs; each is 0 where nothing is to be done. The environment shows more."""
DRIVERS, BEST, CASES_EACH = 40, 6, 8
ITERATIONS = 13
SPREAD, LEAST_SPREAD = 2.0, 0.1
HELD_OUT, SCORED_HORIZON_S = 128, 32.0
SETTINGS: dict[str, Any] = {
    "scenario": "roundabout_entry",
    "control": "along_path",
    "horizon_s": 26.0,
    "early_or_late_s": 3.0,
}


class Score(NamedTuple):
    """How one driver does: its mean return, and shares of episodes that end in each way."""

    mean_return: float
    collided: float
    left_road: float
    arrived: float


class Found(NamedTuple):
    """Scores on held-out cases before and after, the weights, and what it took."""

    before: Score
    after: Score
    weights: Weights
    cpu_s: float


def town_roundabout() -> World:
    """Return the World around the roundabout of the drawn town."""
    town = drawn_town()
    return town.world(next(one.id for one in town.intersections if one.kind == "roundabout"))


def inputs(seen: npt.NDArray[np.float32], names: Sequence[str]) -> Weights:
    """Return (S, D) what drivers weigh, of what they see."""
    at = {name: seen[:, k].astype(np.float64) for k, name in enumerate(names)}
    speed, ground = at["speed"], 1.0 - at["ground0_enter"]
    away = np.hypot(at["user0_ahead"], at["user0_left"])
    return np.column_stack(
        [
            4.0 * (at["target_speed"] - speed),
            4.0 * np.minimum(at["bend_speed"] - speed, 0.0),
            1.0 - at["lead_gap"],
            1.0 - at["wait_line"],
            ground,
            4.0 * ground * speed,
            np.where(at["user0_present"] > 0.0, np.maximum(1.0 - away, 0.0), 0.0),
        ]
    )


def drive(envs: JunctionVectorEnv, drivers: Weights, seeds: list[int]) -> tuple[Weights, ...]:
    """Let each of (S, D) drivers drive one episode, begun by its seed.

    Returns (S,) returns, and whether it collided, left the road and arrived.
    """
    seen, _ = envs.reset(seed=seeds)
    returns, over = np.zeros(len(drivers)), np.zeros(len(drivers), dtype=bool)
    ends = {name: np.zeros(len(drivers)) for name in ("collided", "off_road", "arrived")}
    while not over.all():
        wanted = (drivers * inputs(seen, envs.course.features)).sum(axis=1)
        actions = np.clip(wanted, -1.0, 1.0).astype(np.float32)[:, None]
        seen, rewards, terminated, truncated, infos = envs.step(actions)
        returns += np.where(over, 0.0, rewards)
        for name, ended in ends.items():
            ended[infos[name] & ~over] = 1.0
        over |= terminated | truncated
    return returns, *ends.values()


def score(envs: JunctionVectorEnv, weights: Weights) -> Score:
    """Return how a driver does on as many cases as there are rows."""
    rows = envs.num_envs
    results = drive(envs, np.tile(weights, (rows, 1)), list(range(10_000, 10_000 + rows)))
    return Score(*(float(values.mean()) for values in results))


def search(world: World, *, iterations: int = ITERATIONS, seed: int = 0) -> Found:
    """Search, and score the first and the last driver on cases that the search never saw."""
    began_s = time.process_time()
    rng = np.random.default_rng(seed)
    envs = JunctionVectorEnv(DRIVERS * CASES_EACH, world, cases=256, cases_seed=seed, **SETTINGS)
    mean, spread = np.zeros(len(INPUTS)), np.full(len(INPUTS), SPREAD)
    first = mean.copy()
    for iteration in range(iterations):
        drivers = mean + spread * rng.standard_normal((DRIVERS, len(mean)))
        drivers[0] = mean
        # All drive the same cases, so that luck does not choose.
        seeds = [CASES_EACH * iteration + case for case in range(CASES_EACH)] * DRIVERS
        returns, *_ = drive(envs, np.repeat(drivers, CASES_EACH, axis=0), seeds)
        worth = returns.reshape(DRIVERS, CASES_EACH).mean(axis=1)
        best = drivers[np.argsort(-worth, kind="stable")[:BEST]]
        mean = best.mean(axis=0)
        spread = np.maximum(best.std(axis=0), LEAST_SPREAD)
        print(f"iteration {iteration + 1:3}: best {worth.max():7.2f}, mean {worth.mean():7.2f}")
    cpu_s = time.process_time() - began_s
    # Scored with time enough for the slowest to arrive; the search is cut off earlier.
    unseen = {**SETTINGS, "cases": 256, "cases_seed": seed + 1, "horizon_s": SCORED_HORIZON_S}
    held_out = JunctionVectorEnv(HELD_OUT, world, **unseen)
    return Found(score(held_out, first), score(held_out, mean), mean, cpu_s)


def main() -> None:
    """Search on the roundabout of the drawn town, or on that of a given World."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--iterations", type=int, default=ITERATIONS)
    parser.add_argument("--world", type=Path, help="a World's file; else the drawn town's")
    chosen = parser.parse_args()
    found = search(chosen.world or town_roundabout(), iterations=chosen.iterations)
    for name, value in (("before", found.before), ("after", found.after)):
        print(
            f"{name:>6}: return {value.mean_return:7.2f}, collided {value.collided:4.0%}, "
            f"left the road {value.left_road:4.0%}, arrived {value.arrived:4.0%} "
            f"of {HELD_OUT} unseen episodes"
        )
    for name, weight in zip(INPUTS, found.weights, strict=True):
        print(f"{name:>36} {weight:6.2f}")
    print(f"{found.cpu_s:.0f} s of CPU time to search")


if __name__ == "__main__":
    main()
