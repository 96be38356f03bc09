"""Which futures a round runs: a nominal one and a deterministic mix of what could differ.

Target speeds are stratified, so that no two futures aim at the same one; the other dimensions
follow an additive recurrence (Roberts 2018, the R-sequence), shifted by the seed.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import Future
from foretwin.contracts.numbers import MAX_EXTRA_DELAY_S
from foretwin.contracts.scenario import Scenario
from foretwin.sim_worker.scenarios.drawing import draw_cases

MIN_SPEED_FACTOR, MAX_SPEED_FACTOR = 0.5, 1.3
MAX_SPEED_OFFSET_MPS = 2.5
MIN_FRICTION_FACTOR = 0.3
MAX_SHIFT_M = 0.8

MAX_EARLY_OR_LATE_S = 2.0
"""Others come so much before or after the moment at which they would meet the car."""

_DIMENSIONS = 8
_OWN_THEMES = ("speed", "friction", "delay", "shift", "mixed")


def plan_futures(
    *, count: int, seed: int, planners: Sequence[str], scenarios: Sequence[Scenario] = ()
) -> tuple[Future, ...]:
    """Return `count` futures; index 0 is nominal and uses the first planner.

    Every other future has a target speed of its own. In every second one a scenario happens, in
    turn, if there are any; the themes of the others say what is wrong with the car. From the second
    on, planners take turns. Raises ValueError for no planner or a count below 1.
    """
    if count < 1:
        raise UserError(f"{count} futures: at least 1 is needed")
    if not planners:
        raise ValueError("no planner named")
    nominal = Future(index=0, name="nominal", planner=planners[0])
    points = _low_discrepancy(count, seed)
    strata = np.random.default_rng(seed).permutation(count - 1)
    cases = [cases_of(scenario, seed) for scenario in scenarios]
    futures = [nominal]
    for index in range(1, count):
        speed = (strata[index - 1] + 0.5) / (count - 1)
        planner = planners[index % len(planners)]
        if scenarios and index % 2:
            turn, which = divmod(index // 2, len(scenarios))
            drawn = cases[which]
            case = drawn[(turn * 7 + int(points[index, 6] * len(drawn))) % len(drawn)]
            futures.append(_happening(index, speed, points[index], planner, scenarios[which], case))
        else:
            theme = _OWN_THEMES[(index // 2 if scenarios else index) % len(_OWN_THEMES)]
            futures.append(_fault(index, speed, points[index], planner, theme))
    return tuple(futures)


@functools.cache
def cases_of(scenario: Scenario, seed: int) -> tuple[Mapping[str, float], ...]:
    """Return a scenario's cases, drawn once: rounds come back to the same scenarios."""
    return draw_cases(scenario, seed=seed)


def _low_discrepancy(count: int, seed: int) -> Array:
    """Return (count, 8) points in [0, 1)."""
    ratio = 1.5
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (_DIMENSIONS + 1))
    steps = ratio ** -np.arange(1, _DIMENSIONS + 1)
    start = np.random.default_rng([seed, 1]).random(_DIMENSIONS)
    return np.asarray((start + np.arange(count)[:, None] * steps) % 1.0)


def _fault(index: int, speed: float, point: Array, planner: str, theme: str) -> Future:
    mixed = theme == "mixed"
    aims, words = _aims(speed)
    if theme == "friction" or mixed:
        friction = round(MIN_FRICTION_FACTOR + float(point[0]) * (1.0 - MIN_FRICTION_FACTOR), 3)
        aims["friction_factor"] = friction
        words += f", friction x{friction:.2f}"
    if theme == "delay" or mixed:
        delay = aims["extra_steering_delay_s"] = round(float(point[1]) * MAX_EXTRA_DELAY_S, 3)
        words += f", delay +{delay:.2f} s"
    if theme == "shift" or mixed:
        shift = aims["lateral_shift_m"] = round((2.0 * float(point[2]) - 1.0) * MAX_SHIFT_M, 3)
        words += f", shift {shift:+z.2f} m"
    return Future(index=index, name=words, planner=planner, numbers=aims)


def _aims(speed: float) -> tuple[dict[str, float], str]:
    """Return a share from 0 to 1 of the span of target speeds as numbers, and in words."""
    factor = MIN_SPEED_FACTOR + speed * (MAX_SPEED_FACTOR - MIN_SPEED_FACTOR)
    return {
        "target_speed_factor": round(factor, 4),
        "target_speed_offset_mps": round(speed * MAX_SPEED_OFFSET_MPS, 4),
    }, f"speed x{factor:.2f}"


def _happening(
    index: int,
    speed: float,
    point: Array,
    planner: str,
    scenario: Scenario,
    case: Mapping[str, float],
) -> Future:
    """Return a future in which a case of a scenario happens, a little early or late."""
    aims, words = _aims(speed)
    late = round((2.0 * float(point[5]) - 1.0) * MAX_EARLY_OR_LATE_S, 2)
    times = {name: late for name in case if name.endswith(".arrives_after_s")}
    return Future(
        index=index,
        name=f"{scenario.id} {late:+z.2f} s, {words}",
        planner=planner,
        numbers=aims,
        scenario_id=scenario.id,
        values={**case, **times},
        place_rank=int(point[7] * 997),
    )
