"""What Autoware says of who drives, of gear and indicators and of signal colours, and back.

Autoware reports mode, gear and indicators in messages of their own; each becomes a VehicleStatus
with the others unknown, and `StatusJoiner` keeps what was said last of each.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import msgspec

from foretwin.contracts import drive
from foretwin.telemetry.ros_messages.parts import (
    CONTROL_MODE_REPORT,
    GEAR_REPORT,
    HAZARD_LIGHTS_REPORT,
    TRAFFIC_LIGHTS,
    TURN_INDICATORS_REPORT,
    ros_type,
    stamp_ns_of,
    time_from,
)

_AUTONOMOUS, _MANUAL = 1, 4
_MODES: dict[int, drive.ControlMode] = {
    # Steering alone or speed alone: a human drives the rest, so no comparison of the whole holds.
    _AUTONOMOUS: "autonomous", 2: "manual", 3: "manual", _MANUAL: "manual", 5: "manual",
}  # fmt: skip
"""ControlModeReport.mode; NO_COMMAND and NOT_READY are unknown."""
_GEARS: dict[str, int] = {"unknown": 0, "neutral": 1, "drive": 2, "reverse": 20, "park": 22}
_INDICATORS: dict[str, int] = {"off": 1, "left": 2, "right": 3}
_RED, _AMBER, _GREEN = 1, 2, 3
_CIRCLE, _OFF, _ON = 1, 1, 2
_COLOURS: dict[frozenset[int], drive.SignalColour] = {
    frozenset({_RED}): "red",
    frozenset({_AMBER}): "amber",
    frozenset({_GREEN}): "green",
    frozenset({_RED, _AMBER}): "red_amber",
}


def mode_from_ros(ros: Any, *, stamp_ns: int | None = None) -> drive.VehicleStatus:
    """Return who drives, of a ControlModeReport; partly autonomous is manual."""
    return drive.VehicleStatus(
        stamp_ns=_stamp(ros, stamp_ns), control_mode=_MODES.get(int(ros.mode), "unknown")
    )


def gear_from_ros(ros: Any, *, stamp_ns: int | None = None) -> drive.VehicleStatus:
    """Return the gear of a GearReport."""
    report = int(ros.report)
    gear: drive.Gear = "unknown"
    if 2 <= report <= 19 or report in (23, 24):
        gear = "drive"
    elif report in (20, 21):
        gear = "reverse"
    elif report == 22:
        gear = "park"
    elif report == 1:
        gear = "neutral"
    return drive.VehicleStatus(stamp_ns=_stamp(ros, stamp_ns), gear=gear)


def indicator_from_ros(ros: Any, *, stamp_ns: int | None = None) -> drive.VehicleStatus:
    """Return the indicators of a TurnIndicatorsReport."""
    sides: dict[int, drive.Indicator] = {1: "off", 2: "left", 3: "right"}
    return drive.VehicleStatus(
        stamp_ns=_stamp(ros, stamp_ns), indicator=sides.get(int(ros.report), "unknown")
    )


def ros_from_status(message: drive.VehicleStatus) -> list[tuple[str, Any]]:
    """Return type and message of each of Autoware's reports of one status.

    An unknown mode is NOT_READY, an unknown gear NONE; unknown indicators are not reported.
    """
    stamp = time_from(message.stamp_ns)
    modes = {"autonomous": _AUTONOMOUS, "manual": _MANUAL, "unknown": 6}
    reports = [
        (CONTROL_MODE_REPORT, ros_type(CONTROL_MODE_REPORT)(
            stamp=stamp, mode=modes[message.control_mode])),
        (GEAR_REPORT, ros_type(GEAR_REPORT)(stamp=stamp, report=_GEARS[message.gear])),
    ]  # fmt: skip
    if message.indicator != "unknown":
        hazard = message.indicator == "hazard"
        side = _INDICATORS["off" if hazard else message.indicator]
        reports += [
            (TURN_INDICATORS_REPORT, ros_type(TURN_INDICATORS_REPORT)(stamp=stamp, report=side)),
            (HAZARD_LIGHTS_REPORT, ros_type(HAZARD_LIGHTS_REPORT)(
                stamp=stamp, report=2 if hazard else 1)),
        ]  # fmt: skip
    return reports


class StatusJoiner:
    """Joins reports of mode, gear and indicators: what one does not say stays as it was."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = {}

    def join(self, part: drive.VehicleStatus) -> drive.VehicleStatus:
        """Return what is known after one more report, at its stamp."""
        for name in ("control_mode", "gear", "indicator"):
            if getattr(part, name) != "unknown":
                self._known[name] = getattr(part, name)
        return msgspec.structs.replace(part, **self._known)


def signals_from_ros(ros: Any, *, stamp_ns: int | None = None) -> tuple[drive.SignalState, ...]:
    """Return the colour of each group of a TrafficLightGroupArray; ids are decimal digits.

    Elements of several shapes count together where they agree (a green arrow beside a red light is
    unknown); all off is dark.
    """
    stamp = _stamp(ros, stamp_ns)
    return tuple(
        drive.SignalState(
            stamp_ns=stamp, group_id=str(group.traffic_light_group_id), colour=_colour(group)
        )
        for group in ros.traffic_light_groups
    )


def ros_from_signals(stamp_ns: int, signals: Sequence[drive.SignalState]) -> Any:
    """Return the TrafficLightGroupArray of signal states at one instant."""
    element = ros_type("autoware_perception_msgs/msg/TrafficLightElement")
    group = ros_type("autoware_perception_msgs/msg/TrafficLightGroup")
    lit_by_colour = {colour: sorted(lit) for lit, colour in _COLOURS.items()}

    def elements(colour: str) -> list[Any]:
        if colour == "dark":
            return [element(color=0, shape=_CIRCLE, status=_OFF, confidence=1.0)]
        return [
            element(color=lit, shape=_CIRCLE, status=_ON, confidence=1.0)
            for lit in lit_by_colour.get(colour, ())  # type: ignore[call-overload]
        ]

    return ros_type(TRAFFIC_LIGHTS)(
        stamp=time_from(stamp_ns),
        traffic_light_groups=[
            group(
                traffic_light_group_id=group_number(one.group_id),
                elements=elements(one.colour),
                predictions=[],
            )
            for one in signals
        ],
    )


def group_number(group_id: str) -> int:
    """Return the 64-bit number of a signal group: the id itself where it is one, else a hash."""
    # Not str.isdigit: it holds of digits that int() refuses.
    if group_id.isdecimal() and group_id.isascii() and int(group_id) < 2**63:
        return int(group_id)
    digest = hashlib.blake2b(group_id.encode(), digest_size=8).digest()
    return int.from_bytes(digest, "little") >> 1


def _colour(group: Any) -> drive.SignalColour:
    if not len(group.elements):
        return "unknown"
    lit = [one for one in group.elements if one.status != _OFF]
    if not lit:
        return "dark"
    return _COLOURS.get(frozenset(int(one.color) for one in lit), "unknown")


def _stamp(ros: Any, stamp_ns: int | None) -> int:
    return stamp_ns_of(ros.stamp) if stamp_ns is None else stamp_ns
