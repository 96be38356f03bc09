"""A junction with 200 buildings where everybody drives: the scene of the full-scene benchmarks."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from foretwin.contracts.beside_road import Building
from foretwin.contracts.futures import Job, SeenRoadUser
from foretwin.contracts.world import World
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.metrics.table import METRICS
from tests.benchmarks import scenes
from tests.sim_worker.metrics.junction import junction
from tests.sim_worker.places import box, job

BUILDINGS = 200
ROAD_USERS = 20
_BEFORE_M = (113.0, 88.0, 61.0, 32.0, -16.0)
"""Where on each of the four ways others drive, before the centre of the junction."""


def world() -> World:
    """Return the junction, with rows of buildings along all of its streets."""
    houses: list[Building] = []
    for place in range(BUILDINGS // 8):
        along = 16.0 + 5.0 * place
        for side in (-15.0, 15.0):
            for end in (-1.0, 1.0):
                name = f"{place} {side} {end}"
                houses.append(box(end * along, side, 2.0, 4.0, f"ew {name}"))
                houses.append(box(side, end * along, 4.0, 2.0, f"ns {name}"))
    return msgspec.structs.replace(junction(lights=False), buildings=tuple(houses))


def busy_job() -> Job:
    """Return a job of 64 futures in which 20 others drive lawfully, and everything is measured."""
    names = [name for name, row in METRICS.items() if "reference" not in row.needs]
    return msgspec.structs.replace(
        job(plan_futures(count=scenes.FUTURES, seed=0, planners=["pure_pursuit_idm"])),
        horizon_s=scenes.HORIZON_S,
        road_users=_road_users(),
        metrics=tuple(name for name in names if not METRICS[name].series),
    )


def _road_users() -> tuple[SeenRoadUser, ...]:
    found = []
    for arm in range(4):
        yaw = arm * math.pi / 2.0
        ahead = np.array([math.cos(yaw), math.sin(yaw)])
        right = np.array([ahead[1], -ahead[0]])
        for before_m in _BEFORE_M:
            # The car itself comes from the west, 50 m before the centre.
            x, y = 1.5 * right - (before_m + 3.0 * arm) * ahead
            found.append(
                SeenRoadUser(
                    kind="car", x_m=float(x), y_m=float(y), yaw_rad=yaw, speed_mps=8.0,
                    length_m=4.5, width_m=1.8,
                )
            )  # fmt: skip
    return tuple(found)
