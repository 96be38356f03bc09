"""Which futures a round runs: a nominal one and a deterministic mix of what could differ.

Target speeds are stratified, so that no two futures aim at the same one; the other dimensions
follow an additive recurrence (Roberts 2018, the R-sequence), shifted by the seed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contracts.arrays import Array
from contracts.simulation import ActorKind, ActorSpec, Variant

MIN_SPEED_FACTOR, MAX_SPEED_FACTOR = 0.5, 1.3
MAX_SPEED_OFFSET_MPS = 2.5
MIN_FRICTION_FACTOR = 0.3
MAX_EXTRA_DELAY_S = 0.4
MAX_SHIFT_M = 0.8

_DIMENSIONS = 8
_THEMES = ("speed", "friction", "delay", "shift", "lead", "crossing", "oncoming", "mixed")


def plan_variants(*, count: int, seed: int, planners: Sequence[str]) -> tuple[Variant, ...]:
    """Return `count` variants; index 0 is nominal and uses the first planner.

    Every other variant has a target speed of its own; its theme says what else differs. From the
    second on, planners take turns. Raises ValueError for no planner or a count below 1.
    """
    if count < 1:
        raise ValueError(f"{count} futures: at least 1 is needed")
    if not planners:
        raise ValueError("no planner named")
    nominal = Variant(index=0, name="nominal", planner=planners[0])
    points = _low_discrepancy(count, seed)
    strata = np.random.default_rng(seed).permutation(count - 1)
    return (
        nominal,
        *(
            _variant(
                index,
                (strata[index - 1] + 0.5) / (count - 1),
                points[index],
                planners[index % len(planners)],
            )
            for index in range(1, count)
        ),
    )


def _low_discrepancy(count: int, seed: int) -> Array:
    """Return (count, 8) points in [0, 1)."""
    ratio = 1.5
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (_DIMENSIONS + 1))
    steps = ratio ** -np.arange(1, _DIMENSIONS + 1)
    start = np.random.default_rng([seed, 1]).random(_DIMENSIONS)
    return np.asarray((start + np.arange(count)[:, None] * steps) % 1.0)


def _variant(index: int, speed: float, point: Array, planner: str) -> Variant:
    theme = _THEMES[index % len(_THEMES)]
    mixed = theme == "mixed"
    factor = MIN_SPEED_FACTOR + speed * (MAX_SPEED_FACTOR - MIN_SPEED_FACTOR)
    friction = delay = shift = None
    if theme == "friction" or mixed:
        friction = round(MIN_FRICTION_FACTOR + float(point[0]) * (1.0 - MIN_FRICTION_FACTOR), 3)
    if theme == "delay" or mixed:
        delay = round(float(point[1]) * MAX_EXTRA_DELAY_S, 3)
    if theme == "shift" or mixed:
        shift = round((2.0 * float(point[2]) - 1.0) * MAX_SHIFT_M, 3)
    actor = _actor(theme, point)
    words = [f"speed x{factor:.2f}"]
    words += [] if friction is None else [f"friction x{friction:.2f}"]
    words += [] if delay is None else [f"delay +{delay:.2f} s"]
    words += [] if shift is None else [f"shift {shift:+.2f} m"]
    words += [] if actor is None else [_words(actor)]
    return Variant(
        index=index,
        name=", ".join(words),
        planner=planner,
        target_speed_factor=round(factor, 4),
        target_speed_offset_mps=round(speed * MAX_SPEED_OFFSET_MPS, 4),
        lateral_shift_m=shift or 0.0,
        friction_factor=friction or 1.0,
        extra_steering_delay_s=delay or 0.0,
        actor=actor,
    )


def _actor(theme: str, point: Array) -> ActorSpec | None:
    """Place the road user of the themes that have one."""
    speed, gap, time = float(point[3]), float(point[4]), float(point[5])
    if theme == "lead":
        return ActorSpec(kind="lead", speed_mps=round(8.0 * speed, 2), gap_m=round(5 + 30 * gap, 2))
    kinds: dict[str, ActorKind] = {"crossing": "crossing", "oncoming": "oncoming"}
    if theme not in kinds:
        return None
    return ActorSpec(
        kind=kinds[theme],
        speed_mps=round(3.0 + 9.0 * speed, 2),
        time_offset_s=round(4.0 * time - 2.0, 2),
        path_rank=int(point[6] * 997),
    )


def _words(actor: ActorSpec) -> str:
    if actor.kind == "lead":
        return f"lead {actor.gap_m:.0f} m ahead at {actor.speed_mps:.1f} m/s"
    return f"{actor.kind} at {actor.speed_mps:.1f} m/s {actor.time_offset_s:+.1f} s"
