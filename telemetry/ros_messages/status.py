"""What Autoware says of who drives, of gear and indicators and of signal colours.

Autoware reports mode, gear and indicators in messages of their own; each becomes a VehicleStatus
with the others unknown, and `StatusJoiner` keeps what was said last of each.
"""

from __future__ import annotations

from typing import Any

import msgspec

from foretwin.contracts import drive
from foretwin.telemetry.ros_messages.parts import (
    stamp_ns_of,
)

_AUTONOMOUS, _MANUAL = 1, 4
_MODES: dict[int, drive.ControlMode] = {
    # Steering alone or speed alone: a human drives the rest, so no comparison of the whole holds.
    _AUTONOMOUS: "autonomous",
    2: "manual",
    3: "manual",
    _MANUAL: "manual",
    5: "manual",
}
"""ControlModeReport.mode; NO_COMMAND and NOT_READY are unknown."""
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


def _colour(group: Any) -> drive.SignalColour:
    if not len(group.elements):
        return "unknown"
    lit = [one for one in group.elements if one.status != _OFF]
    if not lit:
        return "dark"
    return _COLOURS.get(frozenset(int(one.color) for one in lit), "unknown")


def _stamp(ros: Any, stamp_ns: int | None) -> int:
    return stamp_ns_of(ros.stamp) if stamp_ns is None else stamp_ns
