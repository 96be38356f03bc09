"""A real cloud into which bodies that do not exist are put, as the sensor would have seen them."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array, Array32, Flags, Indices
from foretwin.contracts.point_cloud import mount_from_base_cloud
from foretwin.sim_worker.sensors.kinds import Lidar
from foretwin.sim_worker.sensors.lidar import LidarScan
from foretwin.sim_worker.sensors.sensor_file import SensorFile


def merge(real: Array32, virtual: LidarScan) -> Array32:
    """Return a cloud (M, 6) of a real one (N, 6) and of a scan of virtual bodies alone.

    Both as measured, in base_link at each point's own time. By the angles of the sensor's rays:
    what is real and farther away than a virtual body in the same ray goes; what is virtual comes
    where nothing real is nearer. In the order of time.
    """
    column, ring, range_m, within = _rays_of(real, virtual.sensor)
    hidden = within & (range_m > virtual.hit_m[column, ring])
    nearest = np.full(virtual.hit_m.shape, np.inf)
    np.minimum.at(nearest, (column[within], ring[within]), range_m[within])
    came = virtual._replace(range_m=np.where(virtual.hit_m < nearest, virtual.range_m, np.nan))
    both = np.concatenate([np.asarray(real, dtype=np.float32)[~hidden], came.points])
    return both[np.argsort(both[:, 5], kind="stable")]


def _rays_of(points: Array32, sensor: SensorFile) -> tuple[Indices, Indices, Array, Flags]:
    """Return azimuth and ring of the ray nearest to each point (N,), its range, and whether the
    sensor looks there at all."""
    lidar = sensor.measures(Lidar)
    seen = mount_from_base_cloud(points.astype(np.float64), sensor.mount)[:, :3]
    range_m = np.linalg.norm(seen, axis=1)
    azimuth = np.arctan2(seen[:, 1], seen[:, 0])
    turned = (-azimuth if lidar.turns == "clockwise" else azimuth) + math.pi
    column = np.round(turned * lidar.azimuths / (2.0 * math.pi)).astype(np.intp) % lidar.azimuths
    elevation = np.degrees(np.arcsin(seen[:, 2] / np.maximum(range_m, 1e-9)))
    low, high = _ring_ends_deg(lidar)
    ring = np.minimum(np.searchsorted(high, elevation), len(high) - 1)
    return column, ring, range_m, (elevation >= low[0]) & (elevation <= high[-1])


def _ring_ends_deg(lidar: Lidar) -> tuple[Array, Array]:
    """Return between which elevations each ring is the nearest one (R,), (R,)."""
    rings = np.array(lidar.elevation_deg)
    between = (rings[1:] + rings[:-1]) / 2.0
    outer = np.diff(rings) / 2.0 if len(rings) > 1 else np.array([0.5])
    return (
        np.concatenate([[rings[0] - outer[0]], between]),
        np.concatenate([between, [rings[-1] + outer[-1]]]),
    )
