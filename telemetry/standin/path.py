"""The path that the stand-in's driver follows, with the speed it would like at each point."""

from __future__ import annotations

import bisect
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.anchor import Anchor, AnchorLine
from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.geometry.polyline import arc_lengths, interpolated
from foretwin.geometry.speed_profile import braked, speed_in_bends_mps
from foretwin.geometry.steering import DRIVEN_CURVATURE_PM
from foretwin.telemetry.standin.parameters import DriverParameters

_SPACING_M = 0.5
_CREEP_MPS = 1.5
_SMOOTHING_M = (1.0, 1.5, 2.0, 3.0, 4.0)


class PathPoint(NamedTuple):
    """One point of the path in the local frame."""

    x_m: float
    y_m: float
    yaw_rad: float
    curvature_pm: float


class Located(NamedTuple):
    """Points (N,) seen from a path: how far along it, how far to its left, its heading there."""

    s_m: Array
    left_m: Array
    yaw_rad: Array


class PathPiece(NamedTuple):
    """A part of a driven path: distances (N,) along all of it, points (N, 2), headings (N,)."""

    s_m: Array
    xy_m: Array
    yaw_rad: Array

    def locate(self, xy_m: Array) -> Located:
        """Return where points (M, 2) are, each by the tangent at the piece's nearest point."""
        offset_m = xy_m[:, None, :] - self.xy_m
        nearest = np.argmin((offset_m**2).sum(axis=-1), axis=1)
        offset_m = offset_m[np.arange(len(nearest)), nearest]
        yaw_rad = self.yaw_rad[nearest]
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        along_m = cos * offset_m[:, 0] + sin * offset_m[:, 1]
        left_m = cos * offset_m[:, 1] - sin * offset_m[:, 0]
        return Located(self.s_m[nearest] + along_m, left_m, yaw_rad)


class DrivenPath:
    """A smooth path of base_link, sampled every half metre, in a frame at its first point.

    `speed_mps` respects the given speeds, lateral acceleration and comfortable braking before
    bends; stops are apart, in `stops_m`: the driver brakes for the next one only.
    """

    def __init__(
        self,
        lat_deg: Array,
        lon_deg: Array,
        speed_mps: Array,
        *,
        driver: DriverParameters,
        altitude_m: Array | None = None,
    ) -> None:
        """Take positions (N,) in degrees with wished speeds (N,); 0 asks for a stop there.

        Without `altitude_m` (N,) the road is flat.

        Raises UserError for arrays of other sizes, numbers that are not finite, or less than 5 m.
        """
        if not (len(lat_deg) == len(lon_deg) == len(speed_mps) >= 2):
            raise UserError(
                f"path of {len(lat_deg)} latitudes, {len(lon_deg)} longitudes and "
                f"{len(speed_mps)} speeds; three lists of one length, at least 2, are needed"
            )
        if not np.isfinite(np.concatenate([lat_deg, lon_deg, speed_mps])).all():
            raise UserError("path holds a number that is not finite")
        if np.any(speed_mps < 0.0):
            raise UserError("path holds a negative speed; the stand-in drives forwards")
        self.frame = LocalFrame(GeoPoint(float(lat_deg[0]), float(lon_deg[0])))
        xy = local_from_geo(self.frame, lat_deg, lon_deg)
        given_s = arc_lengths(xy)
        if given_s[-1] < 5.0:
            raise UserError(f"path is {given_s[-1]:.1f} m long; at least 5 m are needed")
        fresh = np.concatenate([[True], np.diff(given_s) > 1e-6])
        count = max(11, int(given_s[-1] / _SPACING_M) + 1)
        even_s = np.linspace(0.0, given_s[-1], count)
        dense = interpolated(even_s, given_s[fresh], xy[fresh])
        for sigma_m in _SMOOTHING_M:
            self.xy_m = _smoothed(dense, sigma_m / (even_s[1] - even_s[0]))
            self.s_m: Array = arc_lengths(self.xy_m)
            tangent = np.gradient(self.xy_m, self.s_m, axis=0)
            self.yaw_rad: Array = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
            self.curvature_pm: Array = np.gradient(self.yaw_rad, self.s_m)
            if np.abs(self.curvature_pm).max() <= DRIVEN_CURVATURE_PM:
                break
        self.length_m = float(self.s_m[-1])
        self.altitude_m: Array | None = None
        if altitude_m is not None:
            if len(altitude_m) != len(lat_deg) or not np.isfinite(altitude_m).all():
                raise UserError(f"path of {len(lat_deg)} points needs as many finite altitudes")
            self.altitude_m = np.interp(even_s, given_s[fresh], altitude_m[fresh])
        moving = fresh & (speed_mps > 0.0)
        if not moving.any():
            raise UserError("path holds no speed above 0")
        # The smoothing shortens the path a little: stretch the given distances to it.
        along = given_s * self.length_m / given_s[-1]
        wished = np.interp(self.s_m, along[moving], speed_mps[moving])
        bend = speed_in_bends_mps(self.curvature_pm, driver.lateral_accel_mps2)
        lowest = np.maximum(np.minimum(wished, bend), _CREEP_MPS)
        self.speed_mps = braked(lowest, self.xy_m, driver.comfort_decel_mps2)
        standing = speed_mps == 0.0
        begins = standing & ~np.concatenate([[False], standing[:-1]])
        between = along[begins & (along > 5.0) & (along < self.length_m - 5.0)]
        self.stops_m: tuple[float, ...] = (*between.tolist(), self.length_m - 2.0)
        self._along_m: list[float] = self.s_m.tolist()
        self._speeds_mps: list[float] = self.speed_mps.tolist()
        self._points: list[list[float]] = [
            row.tolist() for row in (*self.xy_m.T, self.yaw_rad, self.curvature_pm)
        ]

    def _between(self, s_m: float, known: list[float]) -> float:
        """Return what `np.interp` would, to the last bit: for one number that takes ten times as
        long."""
        along_m = self._along_m
        if s_m >= along_m[-1]:
            return known[-1]
        row = bisect.bisect_right(along_m, s_m) - 1
        if row < 0 or s_m == along_m[row]:
            return known[max(row, 0)]
        rise = (known[row + 1] - known[row]) / (along_m[row + 1] - along_m[row])
        return rise * (s_m - along_m[row]) + known[row]

    def at(self, s_m: float) -> PathPoint:
        """Return the point at a distance along the path, held at its ends."""
        return PathPoint(*[self._between(s_m, known) for known in self._points])

    def altitude_at(self, s_m: float) -> float:
        """Return the road's height at a distance along the path, 0 on a flat one."""
        return 0.0 if self.altitude_m is None else float(np.interp(s_m, self.s_m, self.altitude_m))

    def grade_at(self, s_m: float) -> float:
        """Return the rise over run at a distance along the path."""
        if self.altitude_m is None:
            return 0.0
        return (self.altitude_at(s_m + 1.0) - self.altitude_at(s_m - 1.0)) / 2.0

    def speed_at(self, s_m: float) -> float:
        """Return the wished speed at a distance along the path, without regard to stops."""
        return self._between(s_m, self._speeds_mps)

    def piece(self, first_m: float, last_m: float) -> PathPiece | None:
        """Return the points between two distances along the path; None where there are none."""
        first, end = np.searchsorted(self.s_m, first_m), np.searchsorted(self.s_m, last_m, "right")
        if first >= end:
            return None
        some = slice(int(first), int(end))
        return PathPiece(self.s_m[some], self.xy_m[some], self.yaw_rad[some])

    def locate(self, x_m: float, y_m: float, *, near_s_m: float) -> float:
        """Return how far along the path a point is, looking a few metres around `near_s_m`."""
        first = max(0, int(np.searchsorted(self.s_m, near_s_m - 3.0)) - 1)
        offset_m = np.array([x_m, y_m]) - self.xy_m[first : first + 24]
        nearest = int(np.argmin((offset_m**2).sum(axis=1)))
        forward_m, left_m = offset_m[nearest].tolist()
        yaw_rad = self.yaw_rad[first + nearest]
        s_m: float = self._along_m[first + nearest]
        s_m += float(np.cos(yaw_rad)) * forward_m + float(np.sin(yaw_rad)) * left_m
        return min(max(s_m, 0.0), self.length_m)


def _smoothed(xy_m: Array, sigma: float) -> Array:
    """Blur points (N, 2) along the path by a Gaussian of `sigma` points; the ends stay."""
    half = min(int(4 * sigma) + 1, len(xy_m) - 1)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(xy_m, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack([np.convolve(padded[:, k], kernel, mode="valid") for k in (0, 1)], axis=1)


def read_path(file: Path, *, driver: DriverParameters, anchor: Anchor | None = None) -> DrivenPath:
    """Read a JSON object with lists lat_deg, lon_deg, speed_mps, and altitude_m on a hilly road.

    With an `anchor` the path is one of the World, and driven on the lot, which is flat.

    Raises UserError naming the file and what is wrong, FileNotFoundError without a file.
    """
    try:
        given = json.loads(file.read_text(encoding="utf-8"))
        lat, lon, speed = (
            np.asarray(given[name], dtype=np.float64)
            for name in ("lat_deg", "lon_deg", "speed_mps")
        )
        height = given.get("altitude_m")
        altitude_m = None if height is None else np.asarray(height, dtype=np.float64)
        if anchor is not None:
            line = anchor.lot_from_world_line(AnchorLine(lat, lon, np.zeros(len(lat))))
            lat, lon, speed, altitude_m = line.lat_deg, line.lon_deg, speed / anchor.scale, None
        return DrivenPath(lat, lon, speed, driver=driver, altitude_m=altitude_m)
    except KeyError as missing:
        raise UserError(f"{file}: no list {missing}; lat_deg, lon_deg, speed_mps needed") from None
    except (ValueError, TypeError) as problem:
        raise UserError(f"{file}: {problem}") from problem
