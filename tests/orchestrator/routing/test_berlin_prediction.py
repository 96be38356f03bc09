"""Path and cruise speed together against the real drive, with a point that follows the path."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.routing.cruise import CruiseSpeed
from foretwin.orchestrator.routing.driving_path import driving_path
from foretwin.orchestrator.routing.line_matching import match_line
from foretwin.orchestrator.routing.route import extend_most_probable
from tests.orchestrator.berlin import Drive, berlin

pytestmark = pytest.mark.real_data

STEP_S = 0.1
STEPS = 80
MAX_ACCEL_MPS2 = 1.5
DECEL_MPS2 = 2.0


class Scene(NamedTuple):
    """The drive beside its path: rounds every 0.5 s up to 254 s, and where the car then was."""

    drive: Drive
    path: FrenetPath
    arc_m: np.ndarray
    offset_m: np.ndarray
    rounds: np.ndarray
    truth: np.ndarray


@pytest.fixture(scope="module")
def scene(data_dir: Path) -> Scene:
    drive = berlin(data_dir)
    (route,) = match_line(drive.graph, drive.lat_lon_deg[: drive.until(262.0)]).routes
    route = extend_most_probable(drive.graph, route, until_m=route.end_m + 200.0)
    geometry = driving_path(route, s_from_m=0.0, s_to_m=route.end_m)
    path = FrenetPath(geometry.xy_m, geometry.speed_limit_mps)
    count = drive.until(263.0)
    arc, offset = np.zeros(count), np.zeros(count)
    for i in range(count):
        near = arc[i - 1 : i] if i else None
        place = path.locate(drive.xy_m[i : i + 1], near_arc_m=near)
        arc[i], offset[i] = place.arc_m[0], place.offset_m[0]
    rounds = np.array([drive.until(t) - 1 for t in np.arange(0.5, 254.01, 0.5)])
    times = drive.time_s[rounds, None] + STEP_S * np.arange(1, STEPS + 1)
    truth = np.stack([np.interp(times, drive.time_s, drive.xy_m[:, k]) for k in (0, 1)], axis=-1)
    return Scene(drive, path, arc, offset, rounds, truth)


def mean_errors(scene: Scene, xy: np.ndarray) -> tuple[float, float]:
    """Mean displacement up to 4 s and up to 8 s, over all rounds."""
    away = np.hypot(*np.moveaxis(xy - scene.truth, -1, 0))
    return float(away[:, :40].mean()), float(away.mean())


def straight_on(scene: Scene, *, turning: bool) -> np.ndarray:
    drive, start = scene.drive, scene.rounds
    rate = drive.yaw_rate_radps[start, None] if turning else 0.0
    time = STEP_S * (np.arange(STEPS) + 0.5)
    yaw = drive.yaw_rad[start, None] + rate * time
    step = STEP_S * drive.speed_mps[start, None]
    moved = np.stack([step * np.cos(yaw), step * np.sin(yaw)], axis=-1)
    return drive.xy_m[start, None] + np.cumsum(moved, axis=1)


def followed(scene: Scene, aim: np.ndarray) -> np.ndarray:
    """Follow the path with the nominal planner's free-road law and curve speeds."""
    curves = scene.path.speed_profile(lateral_accel_mps2=2.5, decel_mps2=DECEL_MPS2)
    arc = scene.arc_m[scene.rounds].copy()
    speed = np.maximum(scene.drive.speed_mps[scene.rounds], 0.0)
    points = []
    for _ in range(STEPS):
        ratio = speed / np.maximum(aim, 0.1)
        above = -DECEL_MPS2 * (1.0 - np.maximum(ratio, 1.0) ** (-4.0 * MAX_ACCEL_MPS2 / DECEL_MPS2))
        free = np.where(ratio <= 1.0, MAX_ACCEL_MPS2 * (1.0 - ratio**4), above)
        free = np.where(aim < 0.05, -DECEL_MPS2, free)
        bend = (scene.path.at_nodes(curves, arc + 0.5 * speed) - speed) / 0.5
        faster = np.maximum(0.0, speed + STEP_S * np.minimum(free, bend))
        arc = arc + STEP_S * (speed + faster) / 2.0
        speed = faster
        points.append(scene.path.point_at(arc, scene.offset_m[scene.rounds]))
    return np.stack(points, axis=1)


def aims(scene: Scene) -> np.ndarray:
    cruise = CruiseSpeed()
    limits = scene.path.at_nodes(scene.path.speed_limit_mps, scene.arc_m)
    result = np.zeros(len(limits))
    for i, limit in enumerate(limits):
        cruise.update(int(scene.drive.time_s[i] * 1e9), float(scene.drive.speed_mps[i]))
        result[i] = cruise.aim_mps(float(limit))
    return result[scene.rounds]


def test_following_the_path_at_cruise_speed_beats_both_baselines(scene: Scene) -> None:
    velocity = mean_errors(scene, straight_on(scene, turning=False))
    turn_rate = mean_errors(scene, straight_on(scene, turning=True))
    nominal = mean_errors(scene, followed(scene, aims(scene)))

    for short_m, long_m in (velocity, turn_rate):
        assert nominal[0] < 0.8 * short_m
        assert nominal[1] < 0.8 * long_m


def test_the_path_alone_beats_a_straight_line_at_the_same_speed(scene: Scene) -> None:
    speed = scene.drive.speed_mps[scene.rounds]
    on_path = mean_errors(scene, followed(scene, speed))
    straight = mean_errors(scene, straight_on(scene, turning=False))

    assert on_path[0] < straight[0]
    assert on_path[1] < straight[1]


def test_the_paths_heading_is_the_cars(scene: Scene) -> None:
    moving = scene.drive.speed_mps[: len(scene.arc_m)] > 2.0
    heading = scene.path.pose_at(scene.arc_m).yaw_rad
    error = scene.drive.yaw_rad[: len(scene.arc_m)] - heading
    error = np.degrees(np.abs((error + np.pi) % (2.0 * np.pi) - np.pi)[moving])

    assert np.median(error) < 3.0
    assert np.percentile(error, 95) < 15.0


def test_the_lateral_offset_hardly_changes_over_8_s(scene: Scene) -> None:
    spans = [np.ptp(scene.offset_m[i : i + 40]) for i in range(0, len(scene.offset_m) - 40, 5)]

    assert np.median(spans) < 2.0
    assert np.max(spans) < 5.0
