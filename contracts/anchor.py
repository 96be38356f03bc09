"""Where a vehicle that is really on one place of the Earth drives in the World: the anchor.

A test car drives on an empty lot, while the World is a junction kilometres away. Everything inside
foretwin lives in the World; only who speaks with the vehicle itself knows of its lot. Both are
planes of `contracts.frames`; between them lies a turn, a scale and, on request, a mirroring across
the lot's axis.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import (
    GeoPoint,
    GeoPose,
    LocalFrame,
    geo_from_local,
    geo_from_local_yaw,
    geo_pose,
    local_from_geo,
    local_from_geo_yaw,
    local_pose,
    wrap_angle,
)

_MOST_SCALE = 100.0


class AnchorLine(NamedTuple):
    """Positions (N,) in degrees and the yaws (N,) there from true east."""

    lat_deg: Array
    lon_deg: Array
    yaw_rad: Array


class AnchorPose(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One point and one direction, on the lot or in the World."""

    lat_deg: float
    """Of the point."""
    lon_deg: float
    """Of the point."""
    alt_m: float = 0.0
    """Above the ellipsoid."""
    yaw_deg: float
    """Of the direction, counter-clockwise from true east."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        if not (abs(self.lat_deg) < 90.0 and abs(self.lon_deg) <= 180.0):
            raise ValueError(f"lat_deg, lon_deg {self.lat_deg}, {self.lon_deg}: degrees")
        if not all(map(math.isfinite, (self.alt_m, self.yaw_deg))):
            raise ValueError("alt_m, yaw_deg: finite numbers")

    @property
    def frame(self) -> LocalFrame:
        """The plane around the point."""
        return LocalFrame(GeoPoint(self.lat_deg, self.lon_deg, self.alt_m))

    @property
    def yaw_rad(self) -> float:
        """The direction, from the plane's x axis."""
        return math.radians(self.yaw_deg)


class Anchor(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The same point and direction twice, on the lot and in the World.

    A length of 1 m on the lot is one of `scale` m in the World; times are the same in both, so that
    speeds and accelerations go with lengths, and yaw rates stay.
    """

    lot: AnchorPose
    """Where the vehicle really is."""
    world: AnchorPose
    """Where that is in the World."""
    scale: float = 1.0
    """Metres in the World for a metre on the lot: 10 for a car of 1:10."""
    mirrored: bool = False
    """Whether left on the lot is right in the World, for traffic of the other side."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        self.lot.validate()
        self.world.validate()
        if not 1.0 / _MOST_SCALE <= self.scale <= _MOST_SCALE:
            raise ValueError(f"scale {self.scale}: from 0.01 to 100")

    @property
    def side(self) -> float:
        """What a length to the left, a yaw rate or a steering angle is multiplied by."""
        return -1.0 if self.mirrored else 1.0

    @property
    def turned_round(self) -> Anchor:
        """The anchor of who lives in the World, and says all as on the lot."""
        return Anchor(
            lot=self.world, world=self.lot, scale=1.0 / self.scale, mirrored=self.mirrored
        )

    def world_from_lot(self, position: GeoPoint, yaw_rad: float) -> GeoPose:
        """Return in the World what is a position and a yaw (true east) on the lot."""
        return _moved(self.lot, self.world, self.scale, self.side, position, yaw_rad)

    def lot_from_world(self, position: GeoPoint, yaw_rad: float) -> GeoPose:
        """Return on the lot what is a position and a yaw (true east) in the World."""
        return _moved(self.world, self.lot, 1.0 / self.scale, self.side, position, yaw_rad)

    def world_from_lot_line(self, line: AnchorLine) -> AnchorLine:
        """Return in the World what is a line on the lot."""
        return _moved_line(self.lot, self.world, self.scale, self.side, line)

    def lot_from_world_line(self, line: AnchorLine) -> AnchorLine:
        """Return on the lot what is a line in the World."""
        return _moved_line(self.world, self.lot, 1.0 / self.scale, self.side, line)


def _moved_line(
    source: AnchorPose, target: AnchorPose, scale: float, side: float, line: AnchorLine
) -> AnchorLine:
    lat_deg, lon_deg = np.asarray(line.lat_deg), np.asarray(line.lon_deg)
    yaw_rad = local_from_geo_yaw(source.frame, line.yaw_rad, lat_deg, lon_deg)
    along_left = local_from_geo(source.frame, lat_deg, lon_deg) @ _turn(source.yaw_rad)
    xy_m = (along_left * (scale, scale * side)) @ _turn(target.yaw_rad).T
    lat_lon_deg = geo_from_local(target.frame, xy_m)
    turned_rad = target.yaw_rad + side * wrap_angle(yaw_rad - source.yaw_rad)
    there_rad = geo_from_local_yaw(target.frame, turned_rad, xy_m)
    return AnchorLine(lat_lon_deg[:, 0], lat_lon_deg[:, 1], there_rad)


def _turn(yaw_rad: float) -> Array:
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[cos, -sin], [sin, cos]])


def _moved(
    source: AnchorPose,
    target: AnchorPose,
    scale: float,
    side: float,
    position: GeoPoint,
    yaw_rad: float,
) -> GeoPose:
    x_m, y_m, yaw = local_pose(source.frame, position, yaw_rad)
    cos, sin = math.cos(source.yaw_rad), math.sin(source.yaw_rad)
    along_m = scale * (cos * x_m + sin * y_m)
    left_m = scale * side * (cos * y_m - sin * x_m)
    turned_rad = target.yaw_rad + side * float(wrap_angle(yaw - source.yaw_rad))
    cos, sin = math.cos(target.yaw_rad), math.sin(target.yaw_rad)
    return geo_pose(
        target.frame,
        cos * along_m - sin * left_m,
        sin * along_m + cos * left_m,
        float(wrap_angle(np.float64(turned_rad))),
        alt_m=target.alt_m + scale * (position.alt_m - source.alt_m),
    )
