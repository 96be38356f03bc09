"""Commands, plans and states as ROS 2 messages, and back; the table stands in ros_messages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    geo_from_local_yaw,
    local_from_geo,
    local_from_geo_yaw,
)
from foretwin.telemetry.ros_messages.parts import (
    ACKERMANN,
    BASE_FRAME,
    MAP_FRAME,
    ODOMETRY,
    STRING,
    TRAJECTORY,
    Parts,
    covariance,
    header_from,
    json_string,
    point_from,
    ros_type,
    stamp_ns_of,
    turn_from,
    twist_from,
    within_float32,
    yaw_of,
)


def ros_from_control(message: drive.ControlCommand, _frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one control message."""
    tire = math.nan if message.tire_angle_rad is None else message.tire_angle_rad
    command = ros_type("ackermann_msgs/msg/AckermannDrive")(
        steering_angle=within_float32(tire),
        steering_angle_velocity=0.0,
        speed=0.0,
        acceleration=within_float32(message.accel_mps2),
        jerk=0.0,
    )
    stamped = ros_type(ACKERMANN)(header=header_from(message.stamp_ns, BASE_FRAME), drive=command)
    return [("control", ACKERMANN, stamped), ("control_json", STRING, json_string(message))]


def ros_from_plan(message: drive.PlannedTrajectory, frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one plan message."""
    assert frame is not None
    lat, lon = np.asarray(message.lat_deg), np.asarray(message.lon_deg)
    xy_m = local_from_geo(frame, lat, lon).tolist()
    yaw = local_from_geo_yaw(frame, message.yaw_rad, lat, lon).tolist()
    offsets_ns = np.round(message.time_from_stamp_s * 1e9).astype(np.int64).tolist()
    point, pose = (
        ros_type("autoware_planning_msgs/msg/TrajectoryPoint"),
        ros_type("geometry_msgs/msg/Pose"),
    )
    duration = ros_type("builtin_interfaces/msg/Duration")
    points = [
        point(
            time_from_start=duration(sec=offset // 10**9, nanosec=offset % 10**9),
            pose=pose(position=point_from(x, y, 0.0), orientation=turn_from(heading)),
            longitudinal_velocity_mps=within_float32(speed),
            lateral_velocity_mps=0.0,
            acceleration_mps2=0.0,
            heading_rate_rps=0.0,
            front_wheel_angle_rad=0.0,
            rear_wheel_angle_rad=0.0,
        )
        for offset, (x, y), heading, speed in zip(
            offsets_ns, xy_m, yaw, message.speed_mps.tolist(), strict=True
        )
    ]
    header = header_from(message.stamp_ns, MAP_FRAME)
    return [("plan", TRAJECTORY, ros_type(TRAJECTORY)(header=header, points=points))]


def plan_from_trajectory(ros: Any, frame: LocalFrame | None) -> drive.PlannedTrajectory:
    """Return the plan of an Autoware Trajectory whose frame is `frame`."""
    if frame is None:
        raise ValueError("a trajectory needs the origin of its frame")
    points = ros.points
    xy_m = np.array([(p.pose.position.x, p.pose.position.y) for p in points]).reshape(-1, 2)
    yaw = np.array([yaw_of(p.pose.orientation) for p in points])
    geo = geo_from_local(frame, xy_m)
    return drive.PlannedTrajectory(
        stamp_ns=stamp_ns_of(ros.header.stamp),
        time_from_stamp_s=np.array([stamp_ns_of(p.time_from_start) / 1e9 for p in points]),
        lat_deg=geo[:, 0],
        lon_deg=geo[:, 1],
        yaw_rad=geo_from_local_yaw(frame, yaw, xy_m),
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
    xy_m = np.array([[pose.position.x, pose.position.y]])
    yaw = geo_from_local_yaw(frame, np.array([yaw_of(pose.orientation)]), xy_m)
    lat_deg, lon_deg = geo_from_local(frame, xy_m)[0].tolist()
    if not np.isfinite([lat_deg, lon_deg, yaw[0]]).all():
        raise ValueError("a route from or to nowhere")
    return drive.RoutePose(GeoPoint(lat_deg, lon_deg), float(yaw[0]))


def ros_from_state(message: drive.VehicleState, frame: LocalFrame | None) -> Parts:
    """Return the ROS 2 messages of one state message."""
    assert frame is not None
    lat, lon = message.position.lat_deg, message.position.lon_deg
    x_m, y_m = local_from_geo(frame, lat, lon).tolist()
    z_m = message.position.alt_m - frame.origin.alt_m
    yaw = float(local_from_geo_yaw(frame, message.yaw_rad, lat, lon))
    position, heading = message.position_std_m or 0.0, message.yaw_std_rad or 0.0
    pose = ros_type("geometry_msgs/msg/Pose")(
        position=point_from(x_m, y_m, z_m), orientation=turn_from(yaw)
    )
    odometry = ros_type(ODOMETRY)(
        header=header_from(message.stamp_ns, MAP_FRAME),
        child_frame_id=BASE_FRAME,
        pose=ros_type("geometry_msgs/msg/PoseWithCovariance")(
            pose=pose,
            covariance=covariance(6, d0=position**2, d1=position**2, d5=heading**2),
        ),
        twist=ros_type("geometry_msgs/msg/TwistWithCovariance")(
            twist=twist_from(message.speed_mps, message.yaw_rate_radps),
            covariance=covariance(6, d0=(message.speed_std_mps or 0.0) ** 2),
        ),
    )
    return [("state", ODOMETRY, odometry), ("state_json", STRING, json_string(message))]
