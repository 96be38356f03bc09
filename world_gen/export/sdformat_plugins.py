"""What an SDFormat world needs of its simulator: Gazebo Classic with ROS 2, or Gazebo (gz-sim).

Names and elements of the plugins are those of gazebo_ros_pkgs 3.x and of gz-sim 7 and later.
"""

from __future__ import annotations

from collections.abc import Mapping

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.world_gen.export.choices import Simulator
from foretwin.world_gen.export.sdformat_shapes import numbers, pose
from foretwin.world_gen.export.xml_tree import Element, child, leaves

HEADING_DEG: Mapping[str, str] = {"classic": "180", "gazebo": "0"}
"""Gazebo Classic takes its local axes for west and south (gazebo-classic issue 2022): turned by
180 degrees, its GPS sensor reports east and north as SDFormat means them."""

MAX_SPEED_MPS = 70.0
GPS_RATE_HZ = 10.0
_WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
_GZ_SYSTEMS = (
    ("gz-sim-physics-system", "gz::sim::systems::Physics"),
    ("gz-sim-user-commands-system", "gz::sim::systems::UserCommands"),
    ("gz-sim-scene-broadcaster-system", "gz::sim::systems::SceneBroadcaster"),
    ("gz-sim-navsat-system", "gz::sim::systems::NavSat"),
)


def world_plugins(world: Element, simulator: Simulator) -> None:
    """Add what lets shadows and ghosts be moved, and Gazebo's own systems.

    Poses are set by the ROS service /set_entity_state in Gazebo Classic, by
    /world/<name>/set_pose in Gazebo.
    """
    if simulator == "classic":
        plugin = child(world, "plugin", name="state", filename="libgazebo_ros_state.so")
        child(plugin, "update_rate", "50")
        return
    for filename, name in _GZ_SYSTEMS:
        child(world, "plugin", filename=filename, name=name)


def gps_sensor(link: Element, vehicle: str, simulator: Simulator, *, above_m: float) -> None:
    """Add a GPS receiver above the rear axle; its readings have no noise."""
    sensor = child(link, "sensor", name="gps", type="gps")
    pose(sensor, 0.0, 0.0, above_m)
    child(sensor, "always_on", "1")
    child(sensor, "update_rate", numbers(GPS_RATE_HZ))
    if simulator == "gazebo":
        child(sensor, "topic", f"/model/{vehicle}/gps")
        return
    plugin = child(sensor, "plugin", name=f"{vehicle}_gps", filename="libgazebo_ros_gps_sensor.so")
    _ros(plugin, vehicle, "~/out:=gps/fix")
    child(plugin, "frame_name", f"{vehicle}/gps")


def ackermann_plugin(
    model: Element,
    vehicle: str,
    car: VehicleParameters,
    simulator: Simulator,
    *,
    wheel_radius_m: float,
    track_m: float,
) -> None:
    """Let a twin be driven by velocity and steering, and tell its odometry."""
    if simulator == "classic":
        _classic_ackermann(model, vehicle, car)
        return
    system = "gz-sim-ackermann-steering-system", "gz::sim::systems::AckermannSteering"
    plugin = child(model, "plugin", filename=system[0], name=system[1])
    settings = {
        "left_joint": "rear_left_wheel_joint",
        "right_joint": "rear_right_wheel_joint",
        "left_steering_joint": "front_left_steer_joint",
        "right_steering_joint": "front_right_steer_joint",
        "wheel_base": numbers(car.wheelbase_m.value),
        "wheel_separation": numbers(track_m),
        "kingpin_width": numbers(track_m),
        "wheel_radius": numbers(wheel_radius_m),
        "steering_limit": numbers(car.max_tire_angle_rad.value),
        "steer_p_gain": "10",  # rad/s per rad: the default of 1 takes seconds to turn a wheel
        "min_velocity": numbers(-MAX_SPEED_MPS / 5),
        "max_velocity": numbers(MAX_SPEED_MPS),
        "min_acceleration": numbers(-car.max_brake_decel_mps2.value),
        "max_acceleration": numbers(car.max_drive_accel_mps2.value),
        "topic": f"/model/{vehicle}/cmd_vel",
        "odom_topic": f"/model/{vehicle}/odometry",
        "frame_id": f"{vehicle}/odom",
        "child_frame_id": f"{vehicle}/base_link",
    }
    leaves(plugin, settings)


def _classic_ackermann(model: Element, vehicle: str, car: VehicleParameters) -> None:
    library = "libgazebo_ros_ackermann_drive.so"
    plugin = child(model, "plugin", name=f"{vehicle}_ackermann", filename=library)
    _ros(plugin, vehicle)
    steering = car.max_tire_angle_rad.value
    settings = {
        # Each step: forces last one step, at a lower rate they would act a part of the time.
        "update_rate": "0",
        **{f"{wheel}_joint": f"{wheel}_wheel_joint" for wheel in _WHEELS},
        "left_steering_joint": "front_left_steer_joint",
        "right_steering_joint": "front_right_steer_joint",
        "max_steer": numbers(steering),
        "max_steering_angle": numbers(steering * car.steering_ratio.value),
        "max_speed": numbers(MAX_SPEED_MPS),
        # Stiff enough that tyres on dry road turn the wheels back by less than 0.02 rad.
        "left_steering_pid_gain": "10000 0 0",
        "left_steering_i_range": "0 0",
        "right_steering_pid_gain": "10000 0 0",
        "right_steering_i_range": "0 0",
        "linear_velocity_pid_gain": "1000 0 0",
        "linear_velocity_i_range": "0 0",
        "publish_odom": "true",
        "publish_odom_tf": "true",
        "publish_wheel_tf": "false",
        "publish_distance": "false",
        "odometry_frame": f"{vehicle}/odom",
        "robot_base_frame": f"{vehicle}/base_link",
    }
    leaves(plugin, settings)


def _ros(plugin: Element, vehicle: str, *remappings: str) -> None:
    ros = child(plugin, "ros")
    child(ros, "namespace", f"/{vehicle}")
    for remapping in remappings:
        child(ros, "remapping", remapping)
