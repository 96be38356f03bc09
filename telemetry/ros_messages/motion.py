"""Plans, routes and states as ROS 2 messages, and back; the table stands in ros_messages.table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foretwin.contracts import drive, frames
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.odometry import is_of_base
from foretwin.telemetry.ros_messages.parts import (
    MAP_FRAME,
    covariance,
    header_from,
    ros_message,
    stamp_ns_of,
    within_float32,
    yaw_of,
)

_ONE_PLACE_M = 0.01
"""Points of a plan so near to each other are one place, which may be at one time."""


def trajectory_from_plan(message: drive.PlannedTrajectory, frame: LocalFrame | None) -> Any:
    """Return the Autoware Trajectory of a plan in the local frame `frame`."""
    assert frame is not None
    lat, lon = np.asarray(message.lat_deg), np.asarray(message.lon_deg)
    columns = zip(
        np.round(message.time_from_stamp_s * 1e9).astype(np.int64).tolist(),
        frames.local_from_geo(frame, lat, lon).tolist(),
        frames.local_from_geo_yaw(frame, message.yaw_rad, lat, lon).tolist(),
        message.speed_mps.tolist(),
        strict=True,
    )
    points = [
        ros_message(
            "autoware_planning_msgs/msg/TrajectoryPoint",
            time_from_start=parts.duration_from(offset_ns),
            pose=parts.pose_from(x_m, y_m, 0.0, yaw_rad),
            longitudinal_velocity_mps=within_float32(speed_mps),
        )
        for offset_ns, (x_m, y_m), yaw_rad, speed_mps in columns
    ]
    header = header_from(message.stamp_ns, MAP_FRAME)
    return ros_message(parts.TRAJECTORY, header=header, points=points)


def with_times(plan: drive.PlannedTrajectory, frame: LocalFrame) -> drive.PlannedTrajectory:
    """Return a plan whose times rise; where they do not, by the distances over the mean speeds.

    Its first pose is then at its stamp, and it ends where it stands still. Raises ValueError where
    that is at its beginning.
    """
    xy_m = frames.local_from_geo(frame, plan.lat_deg, plan.lon_deg)
    distance_m = np.hypot(*np.diff(xy_m, axis=0).T)
    moves, passed_s = distance_m > _ONE_PLACE_M, np.diff(plan.time_from_stamp_s)
    if ((passed_s > 0.0) | ((passed_s == 0.0) & ~moves)).all():
        return plan
    speed_mps = np.abs(plan.speed_mps)
    mean_mps = 0.5 * (speed_mps[:-1] + speed_mps[1:])
    reached = int(np.argmax(np.append(moves & (mean_mps <= 0.0), True)))
    steps_s = np.divide(distance_m, mean_mps, out=np.zeros_like(distance_m), where=mean_mps > 0.0)
    if not steps_s[:reached].any():
        raise ValueError("a plan without times, which stands still")
    return drive.PlannedTrajectory(
        stamp_ns=plan.stamp_ns,
        time_from_stamp_s=np.append(0.0, np.cumsum(steps_s[:reached])),
        lat_deg=plan.lat_deg[: reached + 1],
        lon_deg=plan.lon_deg[: reached + 1],
        yaw_rad=plan.yaw_rad[: reached + 1],
        speed_mps=plan.speed_mps[: reached + 1],
    )


def plan_from_trajectory(ros: Any, frame: LocalFrame) -> drive.PlannedTrajectory:
    """Return the plan of an Autoware Trajectory in `map`, whose plane is `frame`.

    Raises ValueError for another frame.
    """
    _check_frame("plan", ros)
    points = ros.points
    xy_m = np.array([(p.pose.position.x, p.pose.position.y) for p in points]).reshape(-1, 2)
    yaw = np.array([yaw_of(p.pose.orientation) for p in points])
    geo = frames.geo_from_local(frame, xy_m)
    return drive.PlannedTrajectory(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        time_from_stamp_s=np.array([stamp_ns_of(p.time_from_start) / 1e9 for p in points]),
        lat_deg=geo[:, 0],
        lon_deg=geo[:, 1],
        yaw_rad=frames.geo_from_local_yaw(frame, yaw, xy_m),
        speed_mps=np.array([p.longitudinal_velocity_mps for p in points]),
    )


def route_from_lanelets(ros: Any, frame: LocalFrame | None) -> drive.RouteToGoal:
    """Return where a LaneletRoute begins and ends; its lanelets mean nothing without their map.

    `frame` is that of `map`. Raises ValueError without it, for another frame, and for poses that
    are not finite.
    """
    if frame is None or ros.header.frame_id.lstrip("/") != MAP_FRAME:
        raise ValueError("a route in a frame whose origin is not known")
    return drive.RouteToGoal(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        start=_route_pose(ros.start_pose, frame),
        goal=_route_pose(ros.goal_pose, frame),
        segments=len(ros.segments),
    )


def _route_pose(pose: Any, frame: LocalFrame) -> drive.RoutePose:
    at = frames.geo_pose(frame, pose.position.x, pose.position.y, yaw_of(pose.orientation))
    if not np.isfinite([at.position.lat_deg, at.position.lon_deg, at.yaw_rad]).all():
        raise ValueError("a route from or to nowhere")
    return drive.RoutePose(at.position, at.yaw_rad)


def odometry_from_state(message: drive.VehicleState, frame: LocalFrame | None) -> Any:
    """Return the Odometry of a state in the local frame `frame`."""
    assert frame is not None
    x_m, y_m, yaw_rad = frames.local_pose(frame, message.position, message.yaw_rad)
    z_m = message.position.alt_m - frame.origin.alt_m
    position, heading = message.position_std_m or 0.0, message.yaw_std_rad or 0.0
    return ros_message(
        parts.ODOMETRY,
        header=header_from(message.stamp_ns, MAP_FRAME),
        child_frame_id=parts.BASE_FRAME,
        pose=ros_message(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=parts.pose_from(x_m, y_m, z_m, yaw_rad),
            covariance=covariance(6, d0=position**2, d1=position**2, d5=heading**2),
        ),
        twist=ros_message(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=parts.twist_from(message.speed_mps, message.yaw_rate_radps),
            covariance=covariance(6, d0=(message.speed_std_mps or 0.0) ** 2),
        ),
    )


def state_from_odometry(
    ros: Any, frame: LocalFrame, *, vehicle_id: str, stamp_ns: int
) -> drive.VehicleState:
    """Return the state of an Odometry of base_link in `map`, whose plane is `frame`.

    Standard deviations are those of its covariances, None where they are 0; acceleration is not in
    an Odometry and is named as estimated. Raises ValueError for another frame or body.
    """
    _check_frame("odometry", ros)
    if not is_of_base(ros):
        raise ValueError(f"odometry of {ros.child_frame_id!r}; readable: {parts.BASE_FRAME!r}")
    pose, twist = ros.pose.pose, ros.twist.twist
    alt_m = frame.origin.alt_m + pose.position.z
    at = frames.geo_pose(
        frame, pose.position.x, pose.position.y, yaw_of(pose.orientation), alt_m=alt_m
    )
    variances = np.asarray(ros.pose.covariance).reshape(6, 6).diagonal()
    return drive.VehicleState(
        vehicle_id=vehicle_id,
        stamp_ns=stamp_ns,
        position=at.position,
        yaw_rad=at.yaw_rad,
        speed_mps=float(twist.linear.x),
        yaw_rate_radps=float(twist.angular.z),
        accel_mps2=0.0,
        position_std_m=_std(0.5 * float(variances[0] + variances[1])),
        yaw_std_rad=_std(float(variances[5])),
        speed_std_mps=_std(float(ros.twist.covariance[0])),
        estimated=("accel_mps2",),
    )


def _check_frame(what: str, ros: Any) -> None:
    if ros.header.frame_id.lstrip("/") != MAP_FRAME:
        raise ValueError(f"{what} in frame {ros.header.frame_id!r}; readable: {MAP_FRAME!r}")


def _std(variance: float) -> float | None:
    return math.sqrt(variance) if variance > 0.0 else None
