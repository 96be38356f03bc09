"""The boundary of a vehicle on a lot: its messages into the World, and ours back to its lot.

Who speaks for the vehicle applies it, and nobody else does: all that is on the bus lives in the
World. Lengths, speeds and accelerations go with the anchor's scale, yaw rates and tyre angles stay;
mirrored, whatever points to the left points to the right. Times, lights and modes are the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
from msgspec.structs import replace

from foretwin.contracts import drive
from foretwin.contracts.anchor import Anchor, AnchorLine
from foretwin.contracts.frames import GeoPoint, GeoPose
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.radar_list import RadarList
from foretwin.contracts.towards_vehicle import VehicleCommand

Message = TypeVar("Message", bound=msgspec.Struct)
_Move = Callable[[GeoPoint, float], GeoPose]
_OTHER_SIDE: dict[drive.Indicator, drive.Indicator] = {"left": "right", "right": "left"}


def world_from_lot_message(anchor: Anchor | None, message: Message) -> Message:
    """Return in the World what a vehicle says of itself and its surroundings on its lot.

    A heading that comes without a position is turned as at the anchor's own point: 500 m away that
    is wrong by less than 2e-4 rad.
    """
    return message if anchor is None else _from_lot(anchor, message)


def lot_from_world_message(anchor: Anchor | None, message: Message) -> Message:
    """Return on the lot what goes to the vehicle: a state, road users, or a command."""
    return message if anchor is None else _from_world(anchor, message)


def world_from_lot_info(anchor: Anchor | None, info: drive.VehicleInfo) -> drive.VehicleInfo:
    """Return what a vehicle is in the World, with its antenna in its place."""
    if anchor is None or info.body_from_antenna_m is None:
        return info
    x, y, z = (anchor.scale * one for one in info.body_from_antenna_m)
    return replace(info, body_from_antenna_m=(x, anchor.side * y, z))


def _from_lot(anchor: Anchor, message: Any) -> Any:
    scale, side = anchor.scale, anchor.side
    match message:
        case drive.GnssFix():
            position, _ = anchor.world_from_lot(message.position, 0.0)
            return replace(message, position=position, std_m=_times(scale, message.std_m))
        case drive.HeadingSample():
            _, yaw_rad = anchor.world_from_lot(anchor.lot.frame.origin, message.yaw_rad)
            rate = _times(side, message.yaw_rate_radps)
            return replace(message, yaw_rad=yaw_rad, yaw_rate_radps=rate)
        case drive.ImuSample():
            # Gravity is the same everywhere; rates are axial: a mirror across x-z keeps the pitch.
            (ax, ay, az), (roll, pitch, yaw) = message.accel_mps2, message.rate_radps
            return replace(
                message,
                accel_mps2=(scale * ax, scale * side * ay, az),
                rate_radps=(side * roll, pitch, side * yaw),
            )
        case drive.SpeedSample():
            return replace(message, speed_mps=scale * message.speed_mps)
        case drive.SteeringSample():
            return _steered(side, message)
        case drive.ControlCommand():
            return replace(_steered(side, message), accel_mps2=scale * message.accel_mps2)
        case drive.VehicleStatus() if anchor.mirrored:
            other = _OTHER_SIDE.get(message.indicator, message.indicator)
            return replace(message, indicator=other)
        case drive.PlannedTrajectory():
            there = anchor.world_from_lot_line(
                AnchorLine(message.lat_deg, message.lon_deg, message.yaw_rad)
            )
            return replace(message, **there._asdict(), speed_mps=scale * message.speed_mps)
        case drive.RoadUsers():
            return _users(message, anchor.world_from_lot, scale)
        case drive.RouteToGoal():
            start, goal = (
                drive.RoutePose(*anchor.world_from_lot(one.position, one.yaw_rad))
                for one in (message.start, message.goal)
            )
            return replace(message, start=start, goal=goal)
        case PointCloud():
            return _cloud(message, scale, side)
    return message


def _from_world(anchor: Anchor, message: Any) -> Any:
    scale, side = 1.0 / anchor.scale, anchor.side
    match message:
        case drive.VehicleState():
            at = anchor.lot_from_world(message.position, message.yaw_rad)
            return replace(
                _steered(side, message),
                position=at.position,
                yaw_rad=at.yaw_rad,
                speed_mps=scale * message.speed_mps,
                yaw_rate_radps=side * message.yaw_rate_radps,
                accel_mps2=scale * message.accel_mps2,
                position_std_m=_times(scale, message.position_std_m),
                speed_std_mps=_times(scale, message.speed_std_mps),
                map_shift_m=None,
            )
        case drive.RoadUsers():
            return _users(message, anchor.lot_from_world, scale)
        case PointCloud():
            return _cloud(message, scale, side)
        case RadarList():
            return _radar_list(message, scale, side)
        case VehicleCommand():
            return replace(
                message,
                tire_angle_rad=side * message.tire_angle_rad,
                accel_mps2=scale * message.accel_mps2,
                speed_mps=scale * message.speed_mps,
            )
    raise TypeError(f"{type(message).__name__} does not go to a vehicle")


def _users(message: drive.RoadUsers, move: _Move, scale: float) -> drive.RoadUsers:
    def moved(user: drive.RoadUser) -> drive.RoadUser:
        at = move(user.position, user.yaw_rad)
        return replace(
            user,
            position=at.position,
            yaw_rad=at.yaw_rad,
            speed_mps=scale * user.speed_mps,
            length_m=scale * user.length_m,
            width_m=scale * user.width_m,
        )

    return replace(message, users=tuple(map(moved, message.users)))


def _cloud(message: PointCloud, scale: float, side: float) -> PointCloud:
    """The same in a sensor's axes: those of a mirrored car's sensor are mirrored with it."""
    points = message.points.copy()
    points[:, :3] *= (scale, scale * side, scale)
    return replace(message, points=points)


def _radar_list(message: RadarList, scale: float, side: float) -> RadarList:
    """The same in a sensor's own axes, which go with the car: heights and sizes stay in proportion,
    amplitudes as they are."""
    factors = (scale, side, 1.0, scale, 1.0)
    mount = message.mount
    return replace(
        message,
        returns=(message.returns * factors).astype(message.returns.dtype),
        mount=replace(
            mount,
            forward_m=scale * mount.forward_m,
            left_m=scale * side * mount.left_m,
            up_m=scale * mount.up_m,
            yaw_deg=side * mount.yaw_deg,
            roll_deg=side * mount.roll_deg,
        ),
    )


def _steered(side: float, message: Any) -> Any:
    return replace(
        message,
        steering_wheel_rad=_times(side, message.steering_wheel_rad),
        tire_angle_rad=_times(side, message.tire_angle_rad),
    )


def _times(factor: float, value: float | None) -> float | None:
    return None if value is None else factor * value
