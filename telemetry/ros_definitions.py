"""Message definitions that ROS 2's common interfaces lack: Ackermann and Autoware.

Field names, types and order are those of ackermann_msgs 2.0 and of autoware_msgs 1.x (before
it, autoware_auto_*_msgs under other package names): CDR carries no names, so order is meaning.
"""

from __future__ import annotations

DEFINITIONS = {
    "ackermann_msgs/msg/AckermannDrive": """
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
""",
    "ackermann_msgs/msg/AckermannDriveStamped": """
std_msgs/Header header
ackermann_msgs/AckermannDrive drive
""",
    "autoware_vehicle_msgs/msg/SteeringReport": """
builtin_interfaces/Time stamp
float32 steering_tire_angle
""",
    "autoware_vehicle_msgs/msg/VelocityReport": """
std_msgs/Header header
float32 longitudinal_velocity
float32 lateral_velocity
float32 heading_rate
""",
    "autoware_control_msgs/msg/Lateral": """
builtin_interfaces/Time stamp
builtin_interfaces/Time control_time
float32 steering_tire_angle
float32 steering_tire_rotation_rate
bool is_defined_steering_tire_rotation_rate
""",
    "autoware_control_msgs/msg/Longitudinal": """
builtin_interfaces/Time stamp
builtin_interfaces/Time control_time
float32 velocity
float32 acceleration
float32 jerk
bool is_defined_acceleration
bool is_defined_jerk
""",
    "autoware_control_msgs/msg/Control": """
builtin_interfaces/Time stamp
builtin_interfaces/Time control_time
autoware_control_msgs/Lateral lateral
autoware_control_msgs/Longitudinal longitudinal
""",
    "autoware_planning_msgs/msg/TrajectoryPoint": """
builtin_interfaces/Duration time_from_start
geometry_msgs/Pose pose
float32 longitudinal_velocity_mps
float32 lateral_velocity_mps
float32 acceleration_mps2
float32 heading_rate_rps
float32 front_wheel_angle_rad
float32 rear_wheel_angle_rad
""",
    "autoware_planning_msgs/msg/Trajectory": """
std_msgs/Header header
autoware_planning_msgs/TrajectoryPoint[] points
""",
}
"""Definitions by full type name, in the order in which they build on one another."""
