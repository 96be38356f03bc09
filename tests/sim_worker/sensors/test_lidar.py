"""What a lidar measures: distances, what hides what, how it looks from a car that drives."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalPose
from foretwin.contracts.point_cloud import Mount, base_from_mount, origin_m
from foretwin.sim_worker.sensors.base_motion import BaseMotion
from foretwin.sim_worker.sensors.kinds import Lidar
from foretwin.sim_worker.sensors.lidar import (
    LidarScan,
    at_begin,
    azimuths_rad,
    base_from_rays,
    scan,
)
from foretwin.sim_worker.sensors.materials import back_scatter, reflectivity_of
from foretwin.sim_worker.sensors.moving_boxes import NO_BODIES, MovingBoxes
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import SensorFile, load_sensor
from tests.sim_worker.places import box, crossroads

COVERS = ("foretwin.sim_worker.sensors.materials",)
HERE = BaseMotion(LocalPose(0.0, 0.0, 0.0))


def exact(**changes: object) -> SensorFile:
    """A sensor above base_link without noise that sees everything within 100 m."""
    lidar = Lidar(
        elevation_deg=(-15.0, -5.0, 0.0, 5.0), azimuths=360, max_range_m=100.0, seen_to_m=2000.0,
        range_std_m=0.0, min_range_m=0.0,
    )  # fmt: skip
    mount = Mount(forward_m=0.0, up_m=1.5)
    return SensorFile(
        name="exact", source="drawn", mount=mount, lidar=msgspec.structs.replace(lidar, **changes)
    )


def bodies(*rows: tuple[float, ...]) -> MovingBoxes:
    """Boxes of x, y, yaw, length, width, height, speed; all give back half of the light."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    half = np.full(len(table), 0.5)
    return MovingBoxes(
        table[:, :2],
        table[:, 2],
        table[:, 3:6],
        table[:, 6],
        half,
        np.full(len(table), 10.0),
        np.tile([1.0, 0.0, 0.0], (len(table), 1)),
    )


def distances_to_boxes(origin: Array, ways: Array, boxes: MovingBoxes) -> Array:
    """(N, B) from a point along rays to boxes on the ground: slabs (Kay and Kajiya, 1986)."""
    found = np.full((len(ways), len(boxes.yaw_rad)), np.inf)
    for b, (xy, yaw, size) in enumerate(zip(boxes.xy_m, boxes.yaw_rad, boxes.size_m, strict=True)):
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        start = turn @ (origin - np.array([*xy, size[2] / 2.0]))
        along = ways @ turn.T
        with np.errstate(divide="ignore"):
            first, second = (-size / 2.0 - start) / along, (size / 2.0 - start) / along
        enters = np.minimum(first, second).max(axis=1)
        leaves = np.maximum(first, second).min(axis=1)
        found[:, b] = np.where((enters <= leaves) & (enters > 0.0), enters, np.inf)
    return found


def test_a_wall_stands_where_it_stands() -> None:
    wall = RayWorld(crossroads(buildings=(box(15.0, 0.0, 5.0, 40.0),)))
    vlp = load_sensor("vlp_16")
    on_base = msgspec.structs.replace(vlp, mount=Mount(forward_m=0.0))
    true = scan(wall, exact(), HERE, NO_BODIES).points
    noisy = scan(wall, on_base, HERE, NO_BODIES, seed=3).points

    ahead = true[(true[:, 4] == 2) & (np.abs(true[:, 1]) < 9.0) & (true[:, 0] > 0.0)]
    assert len(ahead) > 80
    assert ahead[:, 0] == pytest.approx(10.0, abs=1e-4)
    level = noisy[(np.abs(noisy[:, 2] - 1.9) < 1.0) & (np.abs(noisy[:, 1]) < 9.0)]
    level = level[level[:, 0] > 5.0]
    assert level[:, 0].mean() == pytest.approx(10.0, abs=0.01)
    assert 0.01 < level[:, 0].std() < 0.03


def test_the_ground_lies_below() -> None:
    points = scan(RayWorld(crossroads()), exact(), HERE, NO_BODIES).points

    assert set(points[:, 4]) == {0.0, 1.0}
    assert points[:, 2] == pytest.approx(0.0, abs=1e-5)
    assert np.hypot(points[:, 0], points[:, 1])[points[:, 4] == 0.0] == pytest.approx(
        1.5 / math.tan(math.radians(15.0)), rel=1e-5
    )


def test_in_100_drawn_scenes_the_nearest_body_hides_the_others() -> None:
    random, rays, sensor = np.random.default_rng(7), RayWorld(), exact(azimuths=240)
    ways = base_from_rays(sensor.measures(Lidar), sensor.mount).reshape(-1, 3)
    hidden = 0
    for case in range(100):
        count = int(random.integers(2, 13))
        bearing, away = random.uniform(-1.2, 1.2, count), random.uniform(7.0, 40.0, count)
        drawn = bodies(
            *np.column_stack(
                [
                    away * np.cos(bearing), away * np.sin(bearing), random.uniform(-3, 3, count),
                    random.uniform(0.4, 9.0, count), random.uniform(0.4, 2.5, count),
                    random.uniform(1.0, 4.0, count), np.zeros(count),
                ]
            )
        )  # fmt: skip
        found = scan(rays, sensor, HERE, drawn)
        wanted = distances_to_boxes(origin_m(sensor.mount), ways, drawn)
        nearest = wanted.min(axis=1)
        met = np.isfinite(nearest)
        hidden += int((np.isfinite(wanted).sum(axis=1) > 1).sum())
        np.testing.assert_allclose(found.hit_m.ravel(), nearest, atol=1e-6, err_msg=str(case))
        assert (found.body.ravel()[met] == wanted[met].argmin(axis=1)).all(), case
        assert (found.body.ravel()[~met] == -1).all(), case
    assert hidden > 1000


def test_bodies_are_put_anew_at_each_look() -> None:
    rays = RayWorld()
    for size in (1, 40, 3):
        row = [(10.0 + 2.0 * k, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0) for k in range(size)]
        found = scan(rays, exact(), HERE, bodies(*row))
        assert np.nanmin(found.range_m) == pytest.approx(9.5)
        assert set(np.unique(found.body)) == {-1, 0}
    assert np.isnan(scan(rays, exact(), HERE, NO_BODIES).range_m).all()


def test_a_turn_begins_behind_and_goes_round_once() -> None:
    clockwise, against = exact().measures(Lidar), exact(turns="counter_clockwise").measures(Lidar)

    assert np.degrees(azimuths_rad(clockwise)[[0, 90, 180]]) == pytest.approx([180, 90, 0])
    assert np.degrees(azimuths_rad(against)[[0, 90, 180]]) == pytest.approx([-180, -90, 0])
    points = scan(RayWorld(crossroads()), exact(), HERE, NO_BODIES).points
    ahead = points[np.argmin(np.abs(np.arctan2(points[:, 1], points[:, 0])))]
    assert ahead[5] == pytest.approx(0.05)


def test_mounts_turn_left_nose_down_and_left_side_up() -> None:
    x, y = np.eye(3)[0], np.eye(3)[1]

    assert base_from_mount(Mount(yaw_deg=90.0)) @ x == pytest.approx([0, 1, 0], abs=1e-12)
    assert base_from_mount(Mount(pitch_deg=90.0)) @ x == pytest.approx([0, 0, -1], abs=1e-12)
    assert base_from_mount(Mount(roll_deg=90.0)) @ y == pytest.approx([0, 0, 1], abs=1e-12)
    wall = RayWorld(crossroads(buildings=(box(15.0, 0.0, 5.0, 40.0),)))
    tilted = msgspec.structs.replace(exact(), mount=Mount(yaw_deg=30.0, pitch_deg=10.0))
    points = scan(wall, tilted, HERE, NO_BODIES).points
    seen = points[(points[:, 2] > 0.5) & (points[:, 0] > 0.0) & (np.abs(points[:, 1]) < 30.0)]
    assert len(seen) > 50
    assert seen[:, 0] == pytest.approx(10.0, abs=1e-4)


def test_a_car_that_drives_sees_a_skewed_wall_and_de_skewing_straightens_it() -> None:
    wall = RayWorld(crossroads(buildings=(box(0.0, 35.0, 140.0, 5.0),)))
    motion = BaseMotion(LocalPose(-10.0, 5.0, 0.3), speed_mps=20.0, yaw_rate_radps=0.4)
    points = scan(wall, exact(), motion, NO_BODIES).points
    points = points[points[:, 4] == 2]
    straight = at_begin(points, motion)

    def wall_y(cloud: Array) -> Array:
        return np.asarray(5.0 + math.sin(0.3) * cloud[:, 0] + math.cos(0.3) * cloud[:, 1])

    assert np.abs(wall_y(points) - 30.0).max() > 0.5
    assert wall_y(straight) == pytest.approx(30.0, abs=0.02)


def test_a_body_that_drives_moves_on_during_a_turn() -> None:
    oncoming = bodies((20.0, 0.0, math.pi, 4.0, 2.0, 1.6, 20.0))
    points = scan(RayWorld(), exact(), HERE, oncoming).points

    # Straight ahead is half a turn from the rear: 0.05 s, in which it comes 1 m nearer.
    assert points[points[:, 4] == 2][:, 0] == pytest.approx(17.0, abs=0.1)


def test_who_comes_from_the_side_is_seen_where_it_is_when_the_rays_are() -> None:
    from_left = bodies((0.0, 20.0, -math.pi / 2.0, 4.0, 2.0, 1.6, 20.0))
    points = scan(RayWorld(), exact(), HERE, from_left).points
    level = points[(points[:, 4] == 2) & (np.abs(points[:, 0]) < 0.5)]

    # To the left is a quarter of a turn from the rear: 0.025 s, in which it comes 0.5 m nearer.
    assert len(level) > 2
    assert level[:, 1] == pytest.approx(17.5, abs=0.05)


def test_how_far_is_seen_goes_by_the_square_root_of_the_light() -> None:
    sensor = exact(elevation_deg=(0.0,), seen_to_m=50.0, seen_reflectivity=0.5)
    for away_m, seen in ((34.0, True), (37.0, False)):
        grey = bodies((away_m + 0.5, 0.0, 0.0, 1.0, 60.0, 3.0, 0.0))
        grey = grey._replace(reflectivity=np.array([0.25]))
        found = scan(RayWorld(), sensor, HERE, grey)
        assert np.isfinite(found.range_m[180, 0]) == seen


def test_the_darker_and_the_more_slanting_a_surface_the_nearer_it_must_be() -> None:
    sensor = exact(elevation_deg=(0.0,), seen_to_m=50.0, seen_reflectivity=0.5)
    dark = bodies((45.0, 0.0, 0.0, 1.0, 60.0, 3.0, 0.0))
    black = dark._replace(reflectivity=np.array([0.1]))

    assert np.isfinite(scan(RayWorld(), sensor, HERE, dark).range_m[180, 0])
    assert np.isnan(scan(RayWorld(), sensor, HERE, black).range_m[180, 0])
    assert scan(RayWorld(), sensor, HERE, dark).intensity[180, 0] == pytest.approx(50.0)
    assert back_scatter(np.array([1.0, 0.5, 0.0])) == pytest.approx([1.0, 0.829, 0.439], abs=1e-3)
    assert reflectivity_of("pedestrian") < reflectivity_of("car")


def test_what_a_world_is_made_of_shows_in_the_light() -> None:
    wall = RayWorld(crossroads(buildings=(box(15.0, 0.0, 5.0, 40.0),)))
    points = scan(wall, exact(), HERE, NO_BODIES).points

    facing = points[(points[:, 4] == 2) & (np.abs(points[:, 1]) < 0.5)]
    assert facing[0, 3] == pytest.approx(24.0, abs=0.1)
    assert points[points[:, 0] < 0.0][:, 3].max() < 17.0


def test_noise_and_losses_are_those_of_the_sensor_and_of_the_seed() -> None:
    rays, sensor = RayWorld(crossroads()), exact(range_std_m=0.02, dropout=0.1)

    def one(seed: int) -> LidarScan:
        return scan(rays, sensor, HERE, NO_BODIES, seed=seed)

    first, again, other = one(1), one(1), one(2)
    assert np.array_equal(first.range_m, again.range_m, equal_nan=True)
    assert not np.array_equal(first.range_m, other.range_m, equal_nan=True)
    met = np.isfinite(first.hit_m)
    assert np.isnan(first.range_m[met]).mean() == pytest.approx(0.1, abs=0.04)
    assert np.nanstd(first.range_m[met] - first.hit_m[met]) == pytest.approx(0.02, rel=0.1)


def test_nothing_is_measured_too_near_or_too_far() -> None:
    sensor = exact(min_range_m=5.0, max_range_m=12.0, elevation_deg=(0.0,))
    found = scan(
        RayWorld(), sensor, HERE,
        bodies(
            (4.0, 0.0, 0.0, 1.0, 1.0, 3.0, 0.0),
            (0.0, 9.0, 0.0, 1.0, 1.0, 3.0, 0.0),
            (0.0, -13.0, 0.0, 1.0, 1.0, 3.0, 0.0),
        ),
    )  # fmt: skip
    points = found.points
    assert len(points)
    assert points[:, 1] == pytest.approx(8.5, abs=1e-4)
