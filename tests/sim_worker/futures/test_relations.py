"""Futures of one drive told in another way are the same: no truth is needed to see that."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable

import msgspec
import numpy as np
import pytest

import foretwin as ft
from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import FuturesResult, Job, SeenRoadUser
from foretwin.contracts.numbers import NEUTRAL
from foretwin.contracts.world import World
from foretwin.sim_worker.futures.run_job import run_alone
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.mirrored_world import image, mirrored_job, mirrored_world

replace = msgspec.structs.replace
CAR = load_vehicle()
PLANNERS = ("pure_pursuit_idm", "gap_acceptance", "frenet_lattice")
HAPPENING = ("ltap_od", "scp", "cpta", "lead_stopping", "roundabout_entry", "occluded_pedestrian")
RELATIVE = ("driving_score", "epdms")
"""Of one future to the others of its job."""
FAR_M = 5000.0


@pytest.fixture(scope="module")
def worlds() -> tuple[World, ...]:
    town = ft.drawn_town()
    return tuple(town.world(name, radius_m=80.0) for name in ("n11", "n57"))


_KEPT: dict[tuple[str, str], tuple[Job, FuturesResult]] = {}
"""By World and planner: nobody changes them."""


def played_in(world: World, planner: str) -> tuple[Job, FuturesResult]:
    """A round of futures on a way through a World, among road users in its other lanes."""
    if (world.id, planner) not in _KEPT:
        through = ft.ways_through(world)[0]
        state = ft.state_on(world, through, before_m=30.0)
        planned = ft.run_futures(
            world, through, state, count=12, planner=planner, scenarios=HAPPENING, horizon_s=0.1
        )
        job = replace(planned.job, horizon_s=4.0, road_users=tuple(users_in(world)))
        _KEPT[world.id, planner] = job, run_alone(job, world, CAR)
    return _KEPT[world.id, planner]


def users_in(world: World) -> Iterable[SeenRoadUser]:
    for number, lane in enumerate(world.lanes[::3]):
        (x, y), (then_x, then_y) = lane.centerline[:2].tolist()
        yaw = math.atan2(then_y - y, then_x - x)
        yield user(str(number), x, y, yaw_rad=yaw, speed_mps=5.0 + number)


def user(name: str, x_m: float, y_m: float, *, yaw_rad: float, speed_mps: float) -> SeenRoadUser:
    return SeenRoadUser(
        user_id=name, kind="car", x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, speed_mps=speed_mps,
        length_m=4.5, width_m=1.8,
    )  # fmt: skip


def check_same(
    found: FuturesResult, expected: FuturesResult, rows: list[int] | None = None
) -> None:
    """Check that all drive the same way to the bit; `rows` of what is expected are found.

    Sums of metrics are rounded by how many futures are measured at once.
    """
    kept = list(range(len(expected.future_indices))) if rows is None else rows
    assert np.array_equal(found.trajectory.states, expected.trajectory.states[kept])
    assert found.outcome.collided.tolist() == expected.outcome.collided[kept].tolist()
    for name, values in found.metrics.items():
        if name not in RELATIVE:
            assert alike(values, np.asarray(expected.metrics[name])[kept], within=1e-9), name


def alike(one: Array, other: Array, *, within: float) -> bool:
    return np.allclose(one, other, rtol=within, atol=within, equal_nan=True)


@pytest.mark.parametrize("planner", PLANNERS)
def test_who_is_detected_matters_and_not_in_which_order(
    worlds: tuple[World, ...], planner: str
) -> None:
    for world in worlds:
        job, expected = played_in(world, planner)
        shuffled = list(job.road_users)
        random.Random(1).shuffle(shuffled)
        found = run_alone(replace(job, road_users=tuple(shuffled)), world, CAR)
        check_same(found, expected)


def test_who_is_far_away_changes_nothing(worlds: tuple[World, ...]) -> None:
    far = user("far", FAR_M, FAR_M, yaw_rad=0.3, speed_mps=8.0)
    for world in worlds:
        job, expected = played_in(world, PLANNERS[0])
        more = replace(job, road_users=(far, *job.road_users))
        found = run_alone(more, world, CAR)
        assert np.array_equal(found.trajectory.states, expected.trajectory.states)
        assert np.array_equal(found.outcome.min_clearance_m, expected.outcome.min_clearance_m)


@pytest.mark.parametrize("planner", PLANNERS)
def test_futures_do_not_hang_on_which_others_are_played(
    worlds: tuple[World, ...], planner: str
) -> None:
    for world in worlds:
        job, whole = played_in(world, planner)
        for rows in ([0], [11, 2, 0, 7, 5]):
            some = replace(job, futures=tuple(job.futures[row] for row in rows))
            check_same(run_alone(some, world, CAR), whole, rows)


def test_numbers_that_change_nothing_are_the_nominal_future(worlds: tuple[World, ...]) -> None:
    neutral = (*({name: value} for name, value in NEUTRAL.items()), dict(NEUTRAL))
    job, _ = played_in(worlds[0], PLANNERS[0])
    nominal = run_alone(replace(job, futures=job.futures[:1]), worlds[0], CAR)
    futures = tuple(replace(job.futures[0], numbers=numbers) for numbers in neutral)
    found = run_alone(replace(job, futures=futures), worlds[0], CAR)
    check_same(found, nominal, [0] * len(futures))


@pytest.mark.parametrize("planner", PLANNERS)
def test_mirrored_futures_have_mirrored_states_and_the_same_metrics(
    worlds: tuple[World, ...], planner: str
) -> None:
    for world in worlds:
        job, expected = played_in(world, planner)
        found = run_alone(mirrored_job(job, world.frame), mirrored_world(world), CAR)
        assert found.left_out == expected.left_out
        assert found.outcome.collided.tolist() == expected.outcome.collided.tolist()
        way = image(found.trajectory.states[..., :2].astype(float))
        assert np.abs(way - expected.trajectory.states[..., :2]).max() < 1e-4
        for name, values in found.metrics.items():
            if name != "off_road_share":  # of a raster
                assert alike(values, expected.metrics[name], within=1e-4), name
