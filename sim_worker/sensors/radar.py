"""One list of a radar: who is seen from a car that drives, how far, where, and how fast nearing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Array32, Flags, Indices
from foretwin.sim_worker.sensors.base_motion import BaseMotion, SensorMotion, sensor_motion
from foretwin.sim_worker.sensors.kinds import Radar
from foretwin.sim_worker.sensors.moving_boxes import MovingBoxes
from foretwin.sim_worker.sensors.ray_world import RayWorld
from foretwin.sim_worker.sensors.sensor_file import SensorFile

_RAYS = 16
"""Evenly over the angle that a body takes; one more goes to its nearest point."""
_INSIDE_M = np.array([1.0e-3, 1.618e-3])
"""So far within a body its nearest point is aimed at: a ray that meets an edge itself may pass by,
as those at 45 degrees would were both alike."""
_GHOST_DB, _CLUTTER_DBSM = -20.0, -10.0


class RadarReturns(NamedTuple):
    """One list: `returns` (N, 5), columns as in `contracts.radar_list`, in the sensor's own axes;
    whose each is (N,) of the bodies, -1: nobody's, and which of them are ghosts (N,)."""

    sensor: SensorFile
    returns: Array32
    body: Indices
    ghost: Flags


class _SeenParts(NamedTuple):
    """Of B bodies: the share that is seen (B,), and where the nearest point of that is, as vectors
    (B, 3) from the sensor in the World's axes."""

    share: Array
    to_point_m: Array


def detect(
    rays: RayWorld,
    sensor: SensorFile,
    motion: BaseMotion,
    bodies: MovingBoxes,
    *,
    seed: int | Sequence[int] = 0,
) -> RadarReturns:
    """Measure one list at the instant of `motion` and `bodies`; the same seed, the same noise.

    A body is one return: from the nearest point of it that is seen. Its cross section counts by the
    share of it that is seen, between all that stands in the World and all other bodies.
    """
    radar = sensor.measures(Radar)
    here = sensor_motion(motion, sensor.mount)
    rays.set_bodies(bodies)
    share, to_point_m = _seen(rays, radar, here, bodies)
    range_m = np.linalg.norm(to_point_m, axis=1)
    exact = _measured(to_point_m, _velocities(bodies) - here.velocity_mps, here)
    with np.errstate(divide="ignore"):
        exact[:, 4] = 10.0 * np.log10(bodies.rcs_m2 * share)
    random = np.random.default_rng(seed)
    noise = random.normal(size=(len(exact), 4)) * _std(radar)
    draw, doubled = random.random((2, len(exact)))
    found = draw < found_share(radar, range_m, bodies.rcs_m2 * share)
    body = np.arange(len(exact))
    ghost = exact * (2.0, 1.0, 1.0, 2.0, 1.0) + (0.0, 0.0, 0.0, 0.0, _GHOST_DB)
    ghost[:, :4] += noise
    exact[:, :4] += noise
    clutter = _clutter(radar, here, random)
    twice = found & (doubled < radar.ghosts)
    returns = np.concatenate([exact[found], ghost[twice], clutter])
    whose = np.concatenate([body[found], body[twice], np.full(len(clutter), -1)])
    is_ghost = (np.arange(len(returns)) >= found.sum()) & (whose >= 0)
    if radar.elevation_std_deg is None:
        returns[:, 2] = 0.0
    kept = (returns[:, 0] >= radar.min_range_m) & (returns[:, 0] <= radar.max_range_m)
    return RadarReturns(sensor, returns[kept].astype(np.float32), whose[kept], is_ghost[kept])


def found_share(radar: Radar, range_m: Array, rcs_m2: Array) -> Array:
    """Return how likely bodies (...) of cross sections (...) at ranges (...) are found.

    Swerling's case 1, one look: P = F ** (1 / (1 + S)) for a false alarm rate F and a mean signal
    to noise ratio S (Swerling, 1954, Probability of Detection for Fluctuating Targets), which falls
    with the fourth power of the range.
    """
    least = math.log(radar.false_alarm)
    at_reference = least / math.log(radar.seen_share) - 1.0
    relative = rcs_m2 / 10.0 ** (radar.seen_rcs_dbsm / 10.0)
    with np.errstate(divide="ignore"):
        signal = at_reference * relative * (radar.seen_to_m / range_m) ** 4
    return np.where(rcs_m2 > 0.0, np.exp(least / (1.0 + signal)), 0.0)


def _seen(rays: RayWorld, radar: Radar, here: SensorMotion, bodies: MovingBoxes) -> _SeenParts:
    count = len(bodies.yaw_rad)
    bearing = _bearings(here.at_m[:2], bodies)
    way_m, outside = _way_to_outline(here.at_m[:2], bearing, bodies)
    height_m = np.clip(here.at_m[2], 0.1 * bodies.size_m[:, 2], 0.9 * bodies.size_m[:, 2])
    up_m = np.broadcast_to((height_m - here.at_m[2])[:, None], bearing.shape)
    ways = np.stack([np.cos(bearing) * way_m, np.sin(bearing) * way_m, up_m], axis=-1)
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    hits = rays.look(here.at_m, ways.reshape(-1, 3), time_s=0.0, range_m=radar.max_range_m)
    own = np.arange(count)[:, None] == hits.body.reshape(bearing.shape)
    range_m = hits.distance_m.reshape(bearing.shape)
    forward, left, up = np.moveaxis(ways @ here.world_from_sensor, -1, 0)
    across = np.abs(np.arctan2(left, forward))
    upright = np.abs(np.arctan2(up, np.hypot(forward, left)))
    own &= outside[:, None] & (range_m >= radar.min_range_m)
    own &= across <= math.radians(radar.field_of_view_deg) / 2.0
    own &= upright <= math.radians(radar.elevation_of_view_deg) / 2.0
    nearest = np.where(own, range_m, np.inf).argmin(axis=1)
    which = np.arange(count), nearest
    to_point_m = ways[which] * np.where(own[which], range_m[which], 1.0)[:, None]
    return _SeenParts(own.mean(axis=1), to_point_m)


def _bearings(at_m: Array, bodies: MovingBoxes) -> Array:
    """Return (B, N) bearings evenly over each body, and that of its nearest point at the end."""
    half = bodies.size_m[:, None, :2] / 2.0
    corners = _in_world(half * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]), bodies) - at_m
    middle = bodies.xy_m - at_m
    to_middle = np.arctan2(middle[:, 1], middle[:, 0])[:, None]
    aside = np.arctan2(corners[..., 1], corners[..., 0]) - to_middle
    aside = (aside + math.pi) % (2.0 * math.pi) - math.pi
    low, high = aside.min(axis=1)[:, None], aside.max(axis=1)[:, None]
    even = to_middle + low + (high - low) * (np.arange(_RAYS) + 0.5) / _RAYS
    inner = np.maximum(half - _INSIDE_M, 0.0)[:, 0]
    nearest = np.clip(_in_body(at_m, bodies), -inner, inner)
    to_nearest = _in_world(nearest[:, None], bodies)[:, 0] - at_m
    return np.column_stack([even, np.arctan2(to_nearest[:, 1], to_nearest[:, 0])])


def _way_to_outline(at_m: Array, bearing: Array, bodies: MovingBoxes) -> tuple[Array, Flags]:
    """Return how far it is to each body along bearings (B, N), and whether the sensor is outside
    (B,): by slabs (Kay and Kajiya, 1986, Ray tracing complex scenes)."""
    start, half = _in_body(at_m, bodies), bodies.size_m[:, :2] / 2.0
    turned = bearing - bodies.yaw_rad[:, None]
    along = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    along = np.where(np.abs(along) < 1e-12, 1e-12, along)
    enters = (-np.sign(along) * half[:, None] - start[:, None]) / along
    outside = np.asarray((np.abs(start) > half).any(axis=1))
    return np.maximum(enters.max(axis=-1), 1e-6), outside


def _in_body(at_m: Array, bodies: MovingBoxes) -> Array:
    """Return (B, 2) where a place is in the axes of each body."""
    x, y = (at_m - bodies.xy_m).T
    cos, sin = np.cos(bodies.yaw_rad), np.sin(bodies.yaw_rad)
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=1)


def _in_world(places: Array, bodies: MovingBoxes) -> Array:
    """Return (B, N, 2) where places in the axes of each body are."""
    cos, sin = np.cos(bodies.yaw_rad)[:, None], np.sin(bodies.yaw_rad)[:, None]
    x, y = places[..., 0], places[..., 1]
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    return np.asarray(turned + bodies.xy_m[:, None])


def _velocities(bodies: MovingBoxes) -> Array:
    """Return (B, 3): road users do not say how they turn, and go straight on."""
    yaw = bodies.yaw_rad
    flat = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))], axis=1)
    return np.asarray(bodies.speed_mps[:, None] * flat)


def _measured(to_point_m: Array, relative_mps: Array, here: SensorMotion) -> Array:
    """Return (N, 5) without noise and strength: range rates are those along the line of sight."""
    range_m = np.maximum(np.linalg.norm(to_point_m, axis=1), 1e-9)
    x, y, z = (to_point_m @ here.world_from_sensor).T
    rate_mps = np.einsum("ij,ij->i", to_point_m, relative_mps) / range_m
    up, strength = np.arctan2(z, np.hypot(x, y)), np.zeros(len(range_m))
    return np.stack([range_m, np.arctan2(y, x), up, rate_mps, strength], axis=1)


def _std(radar: Radar) -> Array:
    up_deg = radar.elevation_std_deg
    angles = np.radians([radar.azimuth_std_deg, 0.0 if up_deg is None else up_deg])
    return np.array([radar.range_std_m, *angles, radar.range_rate_std_mps])


def _clutter(radar: Radar, here: SensorMotion, random: np.random.Generator) -> Array:
    """Return (N, 5) things that stand evenly over the ground in view, and are not there."""
    count = int(random.poisson(radar.clutter))
    azimuth, squared = random.random((2, count))
    azimuth = np.radians(radar.field_of_view_deg) * (azimuth - 0.5)
    near, far = radar.min_range_m**2, radar.max_range_m**2
    range_m = np.sqrt(near + (far - near) * squared)
    flat = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    to_point_m = range_m[:, None] * flat @ here.world_from_sensor.T
    found = _measured(to_point_m, np.broadcast_to(-here.velocity_mps, (count, 3)), here)
    found[:, 4] = _CLUTTER_DBSM
    found[:, :4] += random.normal(size=(count, 4)) * _std(radar)
    return found
