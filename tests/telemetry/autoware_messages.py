"""What an Autoware car says, for those who read it: the opposite of the product's readers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from foretwin.contracts import drive
from foretwin.telemetry.ros_messages.parts import (
    BASE_FRAME,
    CONTROL_MODE_REPORT,
    GEAR_REPORT,
    HAZARD_LIGHTS_REPORT,
    TF,
    TRAFFIC_LIGHTS,
    TURN_INDICATORS_REPORT,
    VELOCITY_REPORT,
    header_from,
    ros_type,
    time_from,
    turn_from,
    vector_from,
    within_float32,
)

_MODES = {"autonomous": 1, "manual": 4, "unknown": 6}
_GEARS = {"unknown": 0, "neutral": 1, "drive": 2, "reverse": 20, "park": 22}
_INDICATORS = {"off": 1, "left": 2, "right": 3}
_LIT = {"red": (1,), "amber": (2,), "green": (3,), "red_amber": (1, 2)}
_CIRCLE, _OFF, _ON = 1, 1, 2


def ros_from_status(message: drive.VehicleStatus) -> list[tuple[str, Any]]:
    """Return type and message of each of Autoware's reports of one status.

    An unknown mode is NOT_READY, an unknown gear NONE; unknown indicators are not reported.
    """
    stamp = time_from(message.stamp_ns)
    reports = [
        (
            CONTROL_MODE_REPORT,
            ros_type(CONTROL_MODE_REPORT)(stamp=stamp, mode=_MODES[message.control_mode]),
        ),
        (GEAR_REPORT, ros_type(GEAR_REPORT)(stamp=stamp, report=_GEARS[message.gear])),
    ]
    if message.indicator != "unknown":
        hazard = message.indicator == "hazard"
        side = _INDICATORS["off" if hazard else message.indicator]
        reports += [
            (TURN_INDICATORS_REPORT, ros_type(TURN_INDICATORS_REPORT)(stamp=stamp, report=side)),
            (
                HAZARD_LIGHTS_REPORT,
                ros_type(HAZARD_LIGHTS_REPORT)(stamp=stamp, report=2 if hazard else 1),
            ),
        ]
    return reports


def ros_from_signals(stamp_ns: int, signals: Sequence[drive.SignalState]) -> Any:
    """Return the TrafficLightGroupArray of signal states at one instant."""
    element = ros_type("autoware_perception_msgs/msg/TrafficLightElement")
    group = ros_type("autoware_perception_msgs/msg/TrafficLightGroup")

    def elements(colour: str) -> list[Any]:
        if colour == "dark":
            return [element(color=0, shape=_CIRCLE, status=_OFF, confidence=1.0)]
        return [
            element(color=lit, shape=_CIRCLE, status=_ON, confidence=1.0)
            for lit in _LIT.get(colour, ())
        ]

    return ros_type(TRAFFIC_LIGHTS)(
        stamp=time_from(stamp_ns),
        traffic_light_groups=[
            group(
                traffic_light_group_id=int(one.group_id),
                elements=elements(one.colour),
                predictions=[],
            )
            for one in signals
        ],
    )


def velocity_report(stamp_ns: int, *, speed_mps: float, yaw_rate_radps: float) -> Any:
    """Return Autoware's VelocityReport."""
    return ros_type(VELOCITY_REPORT)(
        header=header_from(stamp_ns, BASE_FRAME),
        longitudinal_velocity=within_float32(speed_mps),
        lateral_velocity=0.0,
        heading_rate=within_float32(yaw_rate_radps),
    )


def transform_message(
    stamp_ns: int, *, parent: str, child: str, place_m: drive.Vector3, yaw_rad: float
) -> Any:
    """Return a TFMessage of one frame, turned about z alone."""
    stamped = ros_type("geometry_msgs/msg/TransformStamped")(
        header=header_from(stamp_ns, parent),
        child_frame_id=child,
        transform=ros_type("geometry_msgs/msg/Transform")(
            translation=vector_from(*place_m), rotation=turn_from(yaw_rad)
        ),
    )
    return ros_type(TF)(transforms=[stamped])
