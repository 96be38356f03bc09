"""Conversions between geographic positions and local frames; nothing else in foretwin converts.

A local frame is a transverse Mercator projection centred on its origin (scale 1, WGS84):
metres, x east, y north, yaw counter-clockwise from the x axis. Never UTM, whose scale is off
by up to 0.4 m per kilometre.
"""

from __future__ import annotations

import math
import threading
from functools import lru_cache
from typing import NamedTuple

import msgspec
import numpy as np
import pyproj

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError

METRES_PER_DEG = 111_195.0
"""Of latitude, on a sphere of the Earth's mean radius, 6371 km (IUGG): for margins, not places."""


class GeoPoint(msgspec.Struct, frozen=True):
    """A position on WGS84; `alt_m` is above the ellipsoid and 0 where unknown."""

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0

    def validate(self) -> GeoPoint:
        """Return self, or raise UserError where the position is not on Earth or not finite."""
        if not (np.isfinite(self.lat_deg) and np.isfinite(self.lon_deg)):
            raise UserError(f"position ({self.lat_deg}, {self.lon_deg}) is not finite")
        if not (-90.0 <= self.lat_deg <= 90.0 and -180.0 <= self.lon_deg <= 180.0):
            raise UserError(
                f"position ({self.lat_deg}, {self.lon_deg}) is outside latitude ±90, longitude ±180"
            )
        return self


class LocalFrame(msgspec.Struct, frozen=True):
    """A plane of metres around `origin`: x east, y north, z up."""

    origin: GeoPoint


class LocalPoses(NamedTuple):
    """Positions (N, 2) in metres and yaws (N,) in radians in one local frame."""

    xy_m: Array
    yaw_rad: Array


class LocalPose(NamedTuple):
    """One position in metres and yaw in radians in a local frame."""

    x_m: float
    y_m: float
    yaw_rad: float


class GeoPose(NamedTuple):
    """One position on Earth and the yaw there from true east."""

    position: GeoPoint
    yaw_rad: float


def wrap_angle(angle_rad: Array | float) -> Array:
    """Return angles in radians, any shape, wrapped into [-π, π]."""
    if isinstance(angle_rad, float):
        return np.asarray((angle_rad + math.pi) % math.tau - math.pi)
    return (np.asarray(angle_rad, dtype=np.float64) + np.pi) % (2.0 * np.pi) - np.pi


class _Projections(threading.local):
    """The projections of one thread: pyproj's objects must not be shared between threads."""

    def __init__(self) -> None:
        self.local = lru_cache(maxsize=256)(_new_projection)
        self.place = lru_cache(maxsize=4)(self._place)
        """One state's place is asked for by several, one after the other."""
        self.geodetic_from_ecef = lru_cache(maxsize=1)(_new_geodetic_from_ecef)

    def _place(self, frame: LocalFrame, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        x_m, y_m = self.local(frame.origin.lat_deg, frame.origin.lon_deg)(lon_deg, lat_deg)
        return x_m, y_m


def _new_projection(lat_deg: float, lon_deg: float) -> pyproj.Proj:
    return pyproj.Proj(
        proj="tmerc", lat_0=lat_deg, lon_0=lon_deg, k_0=1.0, x_0=0.0, y_0=0.0, ellps="WGS84"
    )


def _new_geodetic_from_ecef() -> pyproj.Transformer:
    return pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)


_projections = _Projections()


def _projection_of(frame: LocalFrame) -> pyproj.Proj:
    return _projections.local(frame.origin.lat_deg, frame.origin.lon_deg)


def local_from_geo(frame: LocalFrame, lat_deg: Array | float, lon_deg: Array | float) -> Array:
    """Project positions in degrees, shape (N,) or scalar, to (N, 2) or (2,) metres in `frame`."""
    if isinstance(lat_deg, float) and isinstance(lon_deg, float):
        # One position is asked for at every sample: as an array it would cost five times as much.
        return np.array(_projections.place(frame, lat_deg, lon_deg))
    x_m, y_m = _projection_of(frame)(
        np.asarray(lon_deg, dtype=np.float64), np.asarray(lat_deg, dtype=np.float64)
    )
    return np.stack([np.asarray(x_m), np.asarray(y_m)], axis=-1)


def geo_from_local(frame: LocalFrame, xy_m: Array) -> Array:
    """Return (N, 2) or (2,) latitude, longitude in degrees of metres in `frame`."""
    xy = np.asarray(xy_m, dtype=np.float64)
    if xy.shape == (2,):
        lon, lat = _projection_of(frame)(float(xy[0]), float(xy[1]), inverse=True)
        return np.array([lat, lon])
    lon_deg, lat_deg = _projection_of(frame)(xy[..., 0], xy[..., 1], inverse=True)
    return np.stack([np.asarray(lat_deg), np.asarray(lon_deg)], axis=-1)


def geo_from_ecef(xyz_m: Array) -> Array:
    """Return (N, 3) latitude, longitude (degrees), altitude (m) of (N, 3) ECEF metres."""
    xyz = np.asarray(xyz_m, dtype=np.float64)
    lon_deg, lat_deg, alt_m = _projections.geodetic_from_ecef().transform(
        xyz[..., 0], xyz[..., 1], xyz[..., 2]
    )
    return np.stack([np.asarray(lat_deg), np.asarray(lon_deg), np.asarray(alt_m)], axis=-1)


def grid_convergence(frame: LocalFrame, lat_deg: Array | float, lon_deg: Array | float) -> Array:
    """Return the angle in radians from true to grid directions, positive counter-clockwise.

    Spherical transverse Mercator: the tangent of the convergence is tan(lon - lon0) sin(lat)
    (Snyder, 1987, Map Projections, chapter 8). Within 100 km the ellipsoid changes it by less
    than 1e-6 rad.
    """
    if (
        isinstance(lat_deg, float)
        and isinstance(lon_deg, float)
        and math.isfinite(lat_deg + lon_deg)
    ):
        east = math.tan(math.radians(lon_deg - frame.origin.lon_deg))
        return np.asarray(math.atan(east * math.sin(math.radians(lat_deg))))
    dlon = np.radians(np.asarray(lon_deg, dtype=np.float64) - frame.origin.lon_deg)
    lat = np.radians(np.asarray(lat_deg, dtype=np.float64))
    return np.asarray(np.arctan(np.tan(dlon) * np.sin(lat)))


def local_from_geo_yaw(
    frame: LocalFrame,
    yaw_rad: Array | float,
    lat_deg: Array | float,
    lon_deg: Array | float,
) -> Array:
    """Turn yaws from true east at their own position into yaws from the x axis of `frame`."""
    convergence_rad = grid_convergence(frame, lat_deg, lon_deg)
    if isinstance(yaw_rad, float) and convergence_rad.ndim == 0:
        return wrap_angle(yaw_rad + float(convergence_rad))
    return wrap_angle(np.asarray(yaw_rad) + convergence_rad)


def geo_from_local_yaw(frame: LocalFrame, yaw_rad: Array | float, xy_m: Array) -> Array:
    """Turn yaws from the x axis of `frame` at (N, 2) `xy_m` into yaws from true east there."""
    geo = geo_from_local(frame, xy_m)
    return wrap_angle(np.asarray(yaw_rad) - grid_convergence(frame, geo[..., 0], geo[..., 1]))


def geo_pose(
    frame: LocalFrame, x_m: float, y_m: float, yaw_rad: float, *, alt_m: float = 0.0
) -> GeoPose:
    """Return a pose in `frame` as one on Earth, at the altitude given."""
    xy_m = np.array([[x_m, y_m]])
    ((lat_deg, lon_deg),) = geo_from_local(frame, xy_m).tolist()
    (yaw,) = geo_from_local_yaw(frame, np.array([yaw_rad]), xy_m).tolist()
    return GeoPose(GeoPoint(lat_deg, lon_deg, alt_m), yaw)


def local_pose(frame: LocalFrame, position: GeoPoint, yaw_rad: float) -> LocalPose:
    """Return a pose on Earth, its yaw from true east, as one in `frame`."""
    lat_deg, lon_deg = position.lat_deg, position.lon_deg
    x_m, y_m = local_from_geo(frame, lat_deg, lon_deg).tolist()
    return LocalPose(x_m, y_m, float(local_from_geo_yaw(frame, yaw_rad, lat_deg, lon_deg)))


def target_from_source(
    target: LocalFrame, source: LocalFrame, xy_m: Array, yaw_rad: Array | float
) -> LocalPoses:
    """Move poses, (N, 2) metres and (N,) radians, from frame `source` into frame `target`."""
    if target == source:
        return LocalPoses(np.asarray(xy_m, dtype=np.float64), np.asarray(yaw_rad, dtype=np.float64))
    lat, lon = geo_from_local(source, xy_m).T
    true_yaw = wrap_angle(np.asarray(yaw_rad) - grid_convergence(source, lat, lon))
    return LocalPoses(
        local_from_geo(target, lat, lon), local_from_geo_yaw(target, true_yaw, lat, lon)
    )


def target_from_source_m(target: LocalFrame, source: LocalFrame, xy_m: Array) -> Array:
    """Move positions, (N, 2) metres, from frame `source` into frame `target`."""
    if target == source:
        return np.asarray(xy_m, dtype=np.float64)
    lat, lon = geo_from_local(source, xy_m).T
    return local_from_geo(target, lat, lon)


def base_from_sensor(
    xy_m: Array, yaw_rad: Array | float, body_from_sensor_m: tuple[float, float, float]
) -> Array:
    """Return base_link positions (N, 2) of sensors seen at (N, 2) `xy_m` with body yaw (N,).

    `body_from_sensor_m` is the sensor's position in body axes (x forward, y left, z up).
    """
    yaw = np.asarray(yaw_rad, dtype=np.float64)
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, _ = body_from_sensor_m
    lever = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    return np.asarray(xy_m, dtype=np.float64) - lever
