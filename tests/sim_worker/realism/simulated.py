"""The cars of a window as the program foresees them: all law-abiding, each on its own line."""

from __future__ import annotations

import copy
import functools
from collections.abc import Sequence

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import DECIDE_EVERY_S
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.manners import SPREADS, Spreads, key_of
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.right_of_way import PathRules
from foretwin.sim_worker.road_users.traffic import Traffic
from tests.sim_worker.realism.recordings import STEP_S
from tests.sim_worker.realism.windows import NOBODY, Driver, Seen, Window

_TICK_S = 0.05
_HALF_GROUND_M = 2.5
_CROSSES_COS = 0.94
_AWAY = FrenetPath(np.array([[9e3, 9e3], [9.1e3, 9e3]]))


def simulated(
    window: Window,
    *,
    limit_mps: float,
    draws: int,
    steps: int,
    spreads: Spreads = SPREADS,
    replayed: Sequence[int] = (),
) -> tuple[Seen, ...]:
    """Return futures of a window's cars, `steps` long; those `replayed` do what they did."""
    players = [
        Player(
            name=car.track.name,
            kind="car",
            path=limited(car.path, limit_mps),
            start_arc_m=float(car.arc_m[window.begin - car.track.first]),
            speed_mps=float(car.motion.speed_mps[window.begin - car.track.first]),
            conduct="law_abiding",
            known=True,
            size_m=car.track.size_m,
        )
        for car in window.cars
    ]
    keys = [key_of(window.begin, draw) for draw in range(draws)]
    crowd = casting([players] * draws, ego_path=_AWAY, keys=keys, spreads=spreads)
    traffic = Traffic(crowd.crowd, PathTable(crowd.paths), _rules(window.cars), crowd.paces)
    every, decides = round(STEP_S / _TICK_S), round(DECIDE_EVERY_S / _TICK_S)
    poses, arcs = [], []
    ego = NOBODY._replace(
        poses=np.repeat(NOBODY.poses, draws, 0), speed_mps=np.zeros(draws),
        arc_m=np.full(draws, -9e3),
    )  # fmt: skip
    rows = list(replayed)
    was_m = (
        np.stack([_arcs(window.cars[r], window.begin, steps + 1) for r in rows]) if rows else None
    )
    for tick in range(steps * every):
        if was_m is not None and tick % every == 0:
            now_m, next_m = was_m[:, tick // every : tick // every + 2].T
            traffic.arc_m[:, rows], traffic.speed_mps[:, rows] = now_m, (next_m - now_m) / STEP_S
            traffic.step(time_s=tick * _TICK_S, dt_s=0.0)
        if tick % every == 0:
            poses.append(traffic.poses[..., :2].copy())
            arcs.append(traffic.arc_m.copy())
        if tick % decides == 0:
            traffic.decide(ego, _red(window, tick * _TICK_S))
        traffic.step(time_s=tick * _TICK_S, dt_s=_TICK_S)
    xy, arc = np.stack(poses, axis=2), np.stack(arcs, axis=2)
    return tuple(Seen(*one) for one in zip(xy, arc, strict=True))


def _arcs(car: Driver, begin: int, count: int) -> Array:
    """Return where a car was on its line from a step of the recording on, at its end for long."""
    steps = np.minimum(begin - car.track.first + np.arange(count), len(car.arc_m) - 1)
    return car.arc_m[steps]


@functools.cache
def limited(path: FrenetPath, limit_mps: float) -> FrenetPath:
    """Return a path with a speed limit."""
    path = copy.copy(path)
    path.speed_limit_mps = np.full(len(path.arc_m), limit_mps)
    return path


def _red(window: Window, time_s: float) -> Array:
    """Return (P, 1) the lines at which cars wait now for what is not of their making."""
    step = window.begin + round(time_s / STEP_S)
    lines = [car.waits_at_m if step < car.waits_until else np.inf for car in window.cars]
    return np.array([[np.inf], *([line] for line in lines)])


@functools.cache
def _rules(cars: tuple[Driver, ...]) -> PathRules:
    """Return who waits for whom where lines cross: who passed there last."""
    count = len(cars) + 1
    meetings = np.full((count, count, 4), np.nan)
    for p, mine in enumerate(cars):
        for q, other in enumerate(cars):
            met = meeting(mine, other) if p != q else None
            if met is not None and met[2] > met[3]:
                a, b = met[:2]
                spans = (
                    a - _HALF_GROUND_M,
                    a + _HALF_GROUND_M,
                    b - _HALF_GROUND_M,
                    b + _HALF_GROUND_M,
                )
                meetings[p + 1, q + 1] = spans
    none = np.full((count, 1), np.inf)
    return PathRules(meetings, none, np.zeros((count, 1), np.intp), ())


def meeting(one: Driver, other: Driver) -> tuple[float, float, float, float] | None:
    """Return where the lines of two cars cross, as arc lengths on either, and the steps of the
    recording at which they came by; infinite where they did not. None where they do not cross."""
    lines = [
        shapely.LineString(car.path.point_at(np.arange(0.0, car.path.length_m, 1.0)))
        for car in (one, other)
    ]
    if not lines[0].intersects(lines[1]):
        return None
    point = shapely.get_coordinates(shapely.intersection(*lines))[:1]
    arcs = [float(car.path.locate(point).arc_m[0]) for car in (one, other)]
    yaws = [
        float(car.path.pose_at(np.array([arc])).yaw_rad[0])
        for car, arc in zip((one, other), arcs, strict=True)
    ]
    if abs(np.cos(yaws[0] - yaws[1])) > _CROSSES_COS:
        return None
    passed = [
        car.track.first + float(np.argmax(car.arc_m > arc)) if (car.arc_m > arc).any() else np.inf
        for car, arc in zip((one, other), arcs, strict=True)
    ]
    return arcs[0], arcs[1], passed[0], passed[1]
