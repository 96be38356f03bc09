"""A merged cloud is that of a World in which the virtual bodies are real."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array32
from foretwin.contracts.frames import LocalPose
from foretwin.sim_worker.sensors.base_motion import BaseMotion
from foretwin.sim_worker.sensors.cloud_merge import merge
from foretwin.sim_worker.sensors.kinds import Lidar
from foretwin.sim_worker.sensors.lidar import LidarScan, scan
from foretwin.sim_worker.sensors.moving_boxes import NO_BODIES, MovingBoxes
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import SensorFile, load_sensor
from tests.sim_worker.places import box, crossroads
from tests.sim_worker.sensors.test_lidar import HERE, bodies, exact

TOWN = crossroads(
    buildings=(
        box(20.0, 20.0, 8.0, 8.0, "a"), box(-20.0, 20.0, 8.0, 8.0, "b"),
        box(25.0, -3.0, 2.0, 2.0, "c"),
    )
)  # fmt: skip
VISITORS = bodies(
    (12.0, 4.0, 0.4, 4.5, 1.8, 1.5, 0.0),
    (-9.0, -2.0, 1.2, 0.5, 0.5, 1.8, 0.0),
    (40.0, -3.0, 0.0, 4.5, 1.8, 1.5, 0.0),  # hidden by c
    (15.0, 8.0, 2.0, 12.0, 2.5, 3.4, 0.0),
)


def vlp(**changes: object) -> SensorFile:
    vlp_16 = load_sensor("vlp_16")
    return msgspec.structs.replace(
        vlp_16, lidar=msgspec.structs.replace(vlp_16.measures(Lidar), **changes)
    )


def image(points: Array32, like: LidarScan) -> Array32:
    """Ranges (A, R) of a cloud by the ring and time of its points; NaN where there is none."""
    lidar = like.sensor.measures(Lidar)
    found = np.full(like.range_m.shape, np.nan, dtype=np.float32)
    mount = like.sensor.mount
    column = np.round(points[:, 5] * lidar.azimuths * lidar.rate_hz).astype(int)
    origin = [mount.forward_m, mount.left_m, mount.up_m]
    found[column, points[:, 4].astype(int)] = np.linalg.norm(points[:, :3] - origin, axis=1)
    return found


@pytest.mark.parametrize(
    "motion", [HERE, BaseMotion(LocalPose(-3.0, 1.0, 0.2), speed_mps=12.0, yaw_rate_radps=0.2)]
)
def test_a_merged_cloud_is_that_of_a_world_in_which_the_bodies_are_real(motion: BaseMotion) -> None:
    sensor, town = vlp(dropout=0.0), RayWorld(TOWN)
    wanted = scan(town, sensor, motion, VISITORS, seed=1)
    real = scan(town, sensor, motion, NO_BODIES, seed=2).points
    merged = merge(real, scan(RayWorld(), sensor, motion, VISITORS, seed=3))
    found = image(merged, wanted)

    assert np.isfinite(found).sum() == len(merged)  # nothing came twice
    both = np.isfinite(found) & np.isfinite(wanted.range_m)
    assert (np.isfinite(found) == np.isfinite(wanted.range_m)).mean() > 0.9995
    off_m = found[both] - wanted.range_m[both]
    # Two independent noises; at silhouettes, rays of one column begin a centimetre elsewhere.
    assert np.std(off_m[np.abs(off_m) < 0.2]) == pytest.approx(0.03 * 2**0.5, rel=0.03)
    assert (np.abs(off_m) < 0.2).mean() > 0.9995
    assert (wanted.body[both] >= 0).sum() > 500


def test_without_noise_it_is_the_same_ray_by_ray() -> None:
    sensor, town = vlp(dropout=0.0, range_std_m=0.0), RayWorld(TOWN)
    wanted = scan(town, sensor, HERE, VISITORS)
    merged = merge(
        scan(town, sensor, HERE, NO_BODIES).points, scan(RayWorld(), sensor, HERE, VISITORS)
    )

    np.testing.assert_allclose(image(merged, wanted), wanted.range_m, atol=1e-4)
    assert len(merged) == len(wanted.points)
    assert (wanted.body != 2).all()


def test_what_a_virtual_body_does_not_reflect_it_still_hides() -> None:
    sensor, town = vlp(dropout=0.0, range_std_m=0.0), RayWorld(TOWN)
    black: MovingBoxes = VISITORS._replace(reflectivity=np.zeros(4))
    real = scan(town, sensor, HERE, NO_BODIES).points
    merged = merge(real, scan(RayWorld(), sensor, HERE, black))

    behind = (scan(town, sensor, HERE, VISITORS).body >= 0).sum()
    assert len(real) > len(merged) > len(real) - behind - 1
    assert set(map(tuple, merged)) < set(map(tuple, real))


def test_real_points_where_the_sensor_never_looks_stay() -> None:
    car = bodies((5.0, 0.0, 0.0, 2.0, 4.0, 9.0, 0.0))
    sensor = exact()
    above = np.array([[6.0, 0.0, 8.0, 1.0, 0.0, 0.0], [30.0, 0.0, 1.5, 1.0, 2.0, 0.05]], np.float32)
    merged = merge(above, scan(RayWorld(), sensor, HERE, car))

    assert tuple(above[0]) in set(map(tuple, merged))
    assert tuple(above[1]) not in set(map(tuple, merged))


def test_a_cloud_comes_in_the_order_of_time_and_may_be_empty() -> None:
    car = bodies((5.0, 0.0, 0.0, 2.0, 4.0, 3.0, 0.0))
    seen = scan(RayWorld(), exact(turns="counter_clockwise"), HERE, car)
    nothing = np.empty((0, 6), dtype=np.float32)

    assert merge(nothing, seen) == pytest.approx(seen.points)
    assert (np.diff(merge(seen.points[::-1], seen)[:, 5]) >= 0.0).all()
