"""The rows of a mapping: which topic becomes which channel, and what goes out on which."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.telemetry.logs.units import ANGLE, SPEED
from foretwin.telemetry.ros2.names import check_topic, dds_type
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.clouds import Layout
from foretwin.telemetry.ros_messages.foreign import FOREIGN
from foretwin.telemetry.ros_messages.table import TOPIC_PREFIX as OWN_PREFIX

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

Source = Literal[
    "state", "twin", "virtual_objects", "merged_objects", "point_cloud", "radar_list", "lights",
    "spat", "diagnostics", "clock", "vehicle_command",
]  # fmt: skip
_OBJECTS = (parts.PREDICTED_OBJECTS, parts.DETECTED_OBJECTS, parts.TRACKED_OBJECTS)
_TYPES_OF_SOURCE: dict[Source, tuple[str, ...]] = {
    "state": (parts.ODOMETRY,),
    "twin": (parts.ODOMETRY,),
    "virtual_objects": _OBJECTS,
    "merged_objects": _OBJECTS,
    "point_cloud": (parts.POINT_CLOUD2,),
    "radar_list": (parts.RADAR_SCAN,),
    "lights": (parts.TRAFFIC_LIGHTS, parts.TRAFFIC_SIGNALS),
    "spat": (parts.STRING,),
    "diagnostics": (DIAGNOSTICS,),
    "clock": (parts.CLOCK,),
    "vehicle_command": (parts.CONTROL, parts.ACKERMANN),
}
SHOWS_VIRTUAL: tuple[Source, ...] = ("virtual_objects", "merged_objects")
OF_SENSORS: tuple[Source, ...] = ("point_cloud", "radar_list")
INJECTS: tuple[Source, ...] = (*SHOWS_VIRTUAL, *OF_SENSORS)
REAL_CLOUD = "real_cloud"
SHOWS_LIGHTS: tuple[Source, ...] = ("lights", "spat")
CHANNEL_OF_OTHERS = {
    parts.TF: "transforms",
    parts.CLOCK: "clock",
    parts.LANELET_ROUTE: "route",
    parts.POINT_CLOUD2: REAL_CLOUD,
    parts.STRING: "signals",
}
"""Types that are taken in but are no samples of the vehicle's telemetry, and SPAT as JSON."""


class InRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One topic that is listened to."""

    topic: str
    """Absolute name of the ROS topic."""
    type: str
    """Its ROS type, such as sensor_msgs/msg/NavSatFix."""
    channel: str
    """What it becomes."""
    stamp: Literal["header", "arrival"] = "header"
    """By whose clock a sample counts."""
    angle_unit: str = "rad"
    """Of steering and commands."""
    left_positive: bool = True
    """Of steering and commands."""
    speed_unit: str = "m/s"
    """Of a speed."""
    axes: Literal["forward_left_up", "forward_right_down"] = "forward_left_up"
    """Of an Imu."""
    sensor: str = ""
    """Of a cloud: the name of the sensor among the drive's [[sensors]] that it is put in for."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        check_topic(self.topic)
        dds_type(self.type)
        known = {kind: how.channels[0] for kind, how in FOREIGN.items()} | CHANNEL_OF_OTHERS
        if self.type not in known:
            raise ValueError(f"type {self.type!r}: readable are {', '.join(sorted(known))}")
        if self.channel != known[self.type]:
            raise ValueError(f"channel {self.channel!r}: {self.type} gives {known[self.type]!r}")
        for name, units in (("angle_unit", ANGLE), ("speed_unit", SPEED)):
            if getattr(self, name) not in units:
                raise ValueError(
                    f"{name} {getattr(self, name)!r}: {one_of(getattr(self, name), units)}"
                )
        angles = self.angle_unit != "rad" or not self.left_positive
        if angles and self.channel not in ("steering", "control"):
            raise ValueError(f"angle_unit, left_positive: not of channel {self.channel!r}")
        if self.speed_unit != "m/s" and self.channel != "speed":
            raise ValueError(f"speed_unit: not of channel {self.channel!r}")
        if self.axes != "forward_left_up" and self.channel != "imu":
            raise ValueError(f"axes: not of channel {self.channel!r}")
        if bool(self.sensor) != (self.channel == REAL_CLOUD):
            raise ValueError(f"sensor {self.sensor!r}: of channel {REAL_CLOUD!r}, and of it alone")

    @property
    def is_latched(self) -> bool:
        """Whether ROS says it once and keeps it for who comes later (transient local)."""
        return self.type in (parts.TF, parts.LANELET_ROUTE)

    @property
    def stream(self) -> str:
        """What must come from one topic alone."""
        return FOREIGN[self.type].stream if self.type in FOREIGN else self.type + self.topic


class OutRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One topic that is published."""

    topic: str
    """Absolute name of the ROS topic."""
    type: str
    """Its ROS type."""
    source: Source
    """What is told on it."""
    sensor: str = ""
    """Of clouds and radar lists: the sensor of that name among the drive's [[sensors]]."""
    frame: str = ""
    """Of clouds and radar lists: how the car's transforms call the sensor's own frame; empty: in
    base_link, where a radar list cannot be."""
    layout: Layout = "velodyne"
    """Of clouds: fields x y z intensity ring time (velodyne), or PointXYZIRCAEDT (autoware)."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        check_topic(self.topic)
        if self.type not in _TYPES_OF_SOURCE[self.source]:
            raise ValueError(
                f"type {self.type!r}: {self.source} goes out as "
                f"{' or '.join(_TYPES_OF_SOURCE[self.source])}"
            )
        of_sensors = " or ".join(map(repr, OF_SENSORS))
        if bool(self.sensor) != (self.source in OF_SENSORS):
            raise ValueError(f"sensor {self.sensor!r}: of source {of_sensors}, and of these alone")
        if self.frame and self.source not in OF_SENSORS:
            raise ValueError(f"frame {self.frame!r}: of source {of_sensors} alone")
        if self.layout != "velodyne" and self.source != "point_cloud":
            raise ValueError(f"layout {self.layout!r}: of source 'point_cloud' alone")
        if self.source == "radar_list" and not self.frame:
            raise ValueError(
                "frame '': a radar list is in the radar's own frame, which has to be named"
            )

    @property
    def towards_vehicle(self) -> bool:
        """Whether software of the vehicle might obey it: a command, or a topic that is not ours."""
        return self.source == "vehicle_command" or not self.topic.startswith(OWN_PREFIX)
