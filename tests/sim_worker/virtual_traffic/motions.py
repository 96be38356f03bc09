"""Runs sources of virtual traffic beside a car, and measures what they do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.virtual_traffic.source import STEP_S, TrafficSource, VirtualUser

G_MPS2 = 9.81
Scene = tuple[VirtualUser, ...]
CarAt = Callable[[float], tuple[float, float, float, float]]
"""x, y, yaw and speed of base_link at a time."""


class Track(NamedTuple):
    """One road user at T steps: times (T,) and x, y, yaw, speed (T, 4)."""

    time_s: Array
    rows: Array

    def worst_mps2(self) -> float:
        """The largest acceleration, along and across together."""
        along = np.diff(self.rows[:, 3]) / STEP_S
        half_s = round(0.25 / STEP_S)
        yaw = np.unwrap(self.rows[:, 2])
        if len(yaw) <= 2 * half_s + 1:
            return float(np.abs(along).max(initial=0.0))
        rate = (yaw[2 * half_s :] - yaw[: -2 * half_s]) / (2 * half_s * STEP_S)
        across = rate * self.rows[half_s:-half_s, 3]
        return float(np.hypot(along[half_s:][: len(across)], across[: len(along) - half_s]).max())

    def worst_jump_m(self) -> float:
        """By how much a step of the place differs from what its speeds say."""
        way = np.hypot(*np.diff(self.rows[:, :2], axis=0).T)
        meant = 0.5 * (self.rows[1:, 3] + self.rows[:-1, 3]) * STEP_S
        return float(np.abs(way - meant).max(initial=0.0))


def still(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> CarAt:
    return lambda _: (x, y, yaw, 0.0)


def played(source: TrafficSource, car: CarAt, *, from_s: float, to_s: float) -> Iterator[Scene]:
    for k in range(round(from_s / STEP_S), round(to_s / STEP_S)):
        row = np.zeros(8)
        row[:4] = car(k * STEP_S)
        yield source.step(row, time_s=k * STEP_S, colours={})


def tracks(scenes: list[Scene]) -> dict[str, Track]:
    found: dict[str, list[tuple[float, ...]]] = {}
    for k, scene in enumerate(scenes):
        for user in scene:
            found.setdefault(user.user_id, []).append(
                (k * STEP_S, user.x_m, user.y_m, user.yaw_rad, user.speed_mps)
            )
    rows = {name: np.array(one) for name, one in found.items()}
    return {name: Track(one[:, 0], one[:, 1:]) for name, one in rows.items()}
