"""Message definitions that ROS 2's common interfaces lack: Ackermann and Autoware.

Field names, types and order are those of ackermann_msgs 2.0 and of autoware_msgs 1.12 (before
1.0, autoware_auto_*_msgs under other package names): CDR carries no names, so order is meaning.
Constants are left out: neither CDR nor type hashes hold them.
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
    "autoware_vehicle_msgs/msg/ControlModeReport": """
builtin_interfaces/Time stamp
uint8 mode
""",
    "autoware_vehicle_msgs/msg/GearReport": """
builtin_interfaces/Time stamp
uint8 report
""",
    "autoware_vehicle_msgs/msg/TurnIndicatorsReport": """
builtin_interfaces/Time stamp
uint8 report
""",
    "autoware_vehicle_msgs/msg/HazardLightsReport": """
builtin_interfaces/Time stamp
uint8 report
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
    "autoware_planning_msgs/msg/LaneletPrimitive": """
int64 id
string primitive_type
""",
    "autoware_planning_msgs/msg/LaneletSegment": """
autoware_planning_msgs/LaneletPrimitive preferred_primitive
autoware_planning_msgs/LaneletPrimitive[] primitives
""",
    "autoware_planning_msgs/msg/LaneletRoute": """
std_msgs/Header header
geometry_msgs/Pose start_pose
geometry_msgs/Pose goal_pose
autoware_planning_msgs/LaneletSegment[] segments
unique_identifier_msgs/UUID uuid
bool allow_modification
""",
    "autoware_perception_msgs/msg/ObjectClassification": """
uint8 label
float32 probability
""",
    "autoware_perception_msgs/msg/Shape": """
uint8 type
geometry_msgs/Polygon footprint
geometry_msgs/Vector3 dimensions
""",
    "autoware_perception_msgs/msg/DetectedObjectKinematics": """
geometry_msgs/PoseWithCovariance pose_with_covariance
bool has_position_covariance
uint8 orientation_availability
geometry_msgs/TwistWithCovariance twist_with_covariance
bool has_twist
bool has_twist_covariance
""",
    "autoware_perception_msgs/msg/DetectedObject": """
float32 existence_probability
autoware_perception_msgs/ObjectClassification[] classification
autoware_perception_msgs/DetectedObjectKinematics kinematics
autoware_perception_msgs/Shape shape
""",
    "autoware_perception_msgs/msg/DetectedObjects": """
std_msgs/Header header
autoware_perception_msgs/DetectedObject[] objects
""",
    "autoware_perception_msgs/msg/PredictedPath": """
geometry_msgs/Pose[] path
builtin_interfaces/Duration time_step
float32 confidence
""",
    "autoware_perception_msgs/msg/PredictedObjectKinematics": """
geometry_msgs/PoseWithCovariance initial_pose_with_covariance
geometry_msgs/TwistWithCovariance initial_twist_with_covariance
geometry_msgs/AccelWithCovariance initial_acceleration_with_covariance
autoware_perception_msgs/PredictedPath[] predicted_paths
""",
    "autoware_perception_msgs/msg/PredictedObject": """
unique_identifier_msgs/UUID object_id
float32 existence_probability
autoware_perception_msgs/ObjectClassification[] classification
autoware_perception_msgs/PredictedObjectKinematics kinematics
autoware_perception_msgs/Shape shape
""",
    "autoware_perception_msgs/msg/PredictedObjects": """
std_msgs/Header header
autoware_perception_msgs/PredictedObject[] objects
""",
    "autoware_perception_msgs/msg/TrafficLightElement": """
uint8 color
uint8 shape
uint8 status
float32 confidence
""",
    "autoware_perception_msgs/msg/PredictedTrafficLightState": """
builtin_interfaces/Time predicted_stamp
autoware_perception_msgs/TrafficLightElement[] simultaneous_elements
float32 reliability
string information_source
""",
    "autoware_perception_msgs/msg/TrafficLightGroup": """
int64 traffic_light_group_id
autoware_perception_msgs/TrafficLightElement[] elements
autoware_perception_msgs/PredictedTrafficLightState[] predictions
""",
    "autoware_perception_msgs/msg/TrafficLightGroupArray": """
builtin_interfaces/Time stamp
autoware_perception_msgs/TrafficLightGroup[] traffic_light_groups
""",
}
"""Definitions by full type name, in the order in which they build on one another."""
