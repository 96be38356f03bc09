"""One turn of a lidar: what it measures of a World and its road users from a car that drives."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Array32, Indices
from foretwin.contracts.frames import LocalPose
from foretwin.contracts.point_cloud import POINT_COLUMNS, Mount, base_from_mount, origin_m
from foretwin.sim_worker.sensors.base_motion import BaseMotion, poses_after
from foretwin.sim_worker.sensors.kinds import Lidar
from foretwin.sim_worker.sensors.materials import back_scatter
from foretwin.sim_worker.sensors.moving_boxes import MovingBoxes
from foretwin.sim_worker.sensors.ray_world import RayHits, RayWorld
from foretwin.sim_worker.sensors.sensor_file import SensorFile

_STEP_M = 0.02
"""Rays of one instant begin at one point: sensor and road users have moved by at most half of this
from there, less than lidars measure."""


class LidarScan(NamedTuple):
    """One turn, (A, R) for azimuths and rings in the order of firing.

    `range_m` is what was measured, NaN where nothing came back; `hit_m` what the ray met in truth,
    infinite where nothing; `intensity` percent of the light; `body` which of the bodies, -1: none.
    """

    sensor: SensorFile
    range_m: Array
    hit_m: Array
    intensity: Array
    body: Indices

    @property
    def points(self) -> Array32:
        """The cloud (N, 6), `POINT_COLUMNS`, of what came back."""
        lidar = self.sensor.measures(Lidar)
        column, ring = np.nonzero(np.isfinite(self.range_m))
        ways = base_from_rays(lidar, self.sensor.mount)[column, ring]
        found = np.empty((len(column), len(POINT_COLUMNS)), dtype=np.float32)
        found[:, :3] = ways * self.range_m[column, ring][:, None] + origin_m(self.sensor.mount)
        found[:, 3] = self.intensity[column, ring]
        found[:, 4] = ring
        found[:, 5] = column / (lidar.azimuths * lidar.rate_hz)
        return found


def scan(
    rays: RayWorld,
    sensor: SensorFile,
    motion: BaseMotion,
    bodies: MovingBoxes,
    *,
    seed: int | Sequence[int] = 0,
) -> LidarScan:
    """Measure one turn, which begins with `motion` and `bodies`; the same seed, the same noise.

    A surface is seen where it gives back as much light as one of `seen_reflectivity` at
    `seen_to_m`: light falls with the square of the distance (Wagner, 2010, Radiometric calibration
    of small-footprint full-waveform airborne laser scanner measurements, equation 1).
    """
    lidar = sensor.measures(Lidar)
    rays.set_bodies(bodies)
    hits = _turn(rays, sensor, motion, bodies)
    shape = lidar.azimuths, len(lidar.elevation_deg)
    hit_m = hits.distance_m.reshape(shape)
    light = (hits.reflectivity * back_scatter(hits.cos_incidence)).reshape(shape)
    random = np.random.default_rng(seed)
    range_m = hit_m + random.normal(0.0, lidar.range_std_m, shape)
    seen_to_m = lidar.seen_to_m * np.sqrt(light / lidar.seen_reflectivity)
    lost = random.random(shape) < lidar.dropout
    lost |= (hit_m > seen_to_m) | (range_m < lidar.min_range_m) | (range_m > lidar.max_range_m)
    return LidarScan(
        sensor=sensor,
        range_m=np.where(lost, np.nan, range_m),
        hit_m=hit_m,
        intensity=np.minimum(100.0 * light, 100.0),
        body=hits.body.reshape(shape),
    )


def at_begin(points: Array32, motion: BaseMotion) -> Array32:
    """Return a cloud (N, 6) with all points in base_link as the turn began: without its skew."""
    time_s = points[:, 5].astype(np.float64)
    x_m, y_m, yaw = poses_after(motion._replace(pose=LocalPose(0.0, 0.0, 0.0)), time_s)
    cos, sin = np.cos(yaw), np.sin(yaw)
    found = points.copy()
    found[:, 0] = x_m + cos * points[:, 0] - sin * points[:, 1]
    found[:, 1] = y_m + sin * points[:, 0] + cos * points[:, 1]
    return found


def azimuths_rad(lidar: Lidar) -> Array:
    """Return (A,) where firings of a turn point in the sensor's plane, from its x axis."""
    turned = 2.0 * math.pi * np.arange(lidar.azimuths) / lidar.azimuths - math.pi
    return -turned if lidar.turns == "clockwise" else turned


def base_from_rays(lidar: Lidar, mount: Mount) -> Array:
    """Return (A, R, 3) where rays point, of length 1 in base_link."""
    azimuth = azimuths_rad(lidar)[:, None]
    elevation = np.radians(lidar.elevation_deg)[None]
    flat, up = np.cos(elevation), np.broadcast_to(np.sin(elevation), (len(azimuth), elevation.size))
    rays = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=-1)
    return np.asarray(rays @ base_from_mount(mount).T)


def _turn(rays: RayWorld, sensor: SensorFile, motion: BaseMotion, bodies: MovingBoxes) -> RayHits:
    """Return what the rays of a turn meet (A · R,), the car and all bodies moving meanwhile."""
    lidar, lever_m = sensor.measures(Lidar), origin_m(sensor.mount)
    time_s = np.arange(lidar.azimuths) / (lidar.azimuths * lidar.rate_hz)
    x_m, y_m, yaw = poses_after(motion, time_s)
    cos, sin = np.cos(yaw), np.sin(yaw)
    ways = base_from_rays(lidar, sensor.mount)
    world = ways.copy()
    world[..., 0] = cos[:, None] * ways[..., 0] - sin[:, None] * ways[..., 1]
    world[..., 1] = sin[:, None] * ways[..., 0] + cos[:, None] * ways[..., 1]
    swing_mps = abs(motion.yaw_rate_radps) * math.hypot(lever_m[0], lever_m[1])
    fastest = np.abs(bodies.speed_mps).max(initial=0.0)
    moved_m = (abs(motion.speed_mps) + swing_mps + fastest) / lidar.rate_hz
    instants = min(max(math.ceil(moved_m / _STEP_M), 1), lidar.azimuths)
    ends = np.linspace(0, lidar.azimuths, instants + 1).round().astype(int).tolist()
    found = []
    for begin, end in itertools.pairwise(ends):
        k = (begin + end - 1) // 2
        origin = np.array(
            [
                x_m[k] + cos[k] * lever_m[0] - sin[k] * lever_m[1],
                y_m[k] + sin[k] * lever_m[0] + cos[k] * lever_m[1],
                lever_m[2],
            ]
        )
        part = world[begin:end].reshape(-1, 3)
        found.append(rays.look(origin, part, time_s=time_s[k], range_m=lidar.max_range_m))
    return RayHits(*map(np.concatenate, zip(*found, strict=True)))
