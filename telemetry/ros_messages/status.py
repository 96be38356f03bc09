"""What Autoware says of who drives, of gear and indicators and of signal colours.

Autoware reports mode, gear and indicators in messages of their own; each becomes a VehicleStatus
with the others unknown, and `StatusJoiner` keeps what was said last of each.
"""

from __future__ import annotations

from typing import Any

import msgspec

from foretwin.contracts import drive

_MODES: dict[int, drive.ControlMode] = {
    # Steering alone or speed alone: a human drives the rest, so no comparison of the whole holds.
    1: "autonomous",
    **dict.fromkeys((2, 3, 4, 5), "manual"),
}
"""ControlModeReport.mode; NO_COMMAND and NOT_READY are unknown."""
_GEARS: dict[int, drive.Gear] = {
    1: "neutral",
    **dict.fromkeys((*range(2, 20), 23, 24), "drive"),
    **dict.fromkeys((20, 21), "reverse"),
    22: "park",
}
"""GearReport.report."""
_INDICATORS: dict[int, drive.Indicator] = {1: "off", 2: "left", 3: "right"}
"""TurnIndicatorsReport.report."""
_OFF = 1
"""TrafficLightElement.status."""
_RED, _AMBER, _GREEN = 1, 2, 3
_COLOURS: dict[frozenset[int], drive.SignalColour] = {
    frozenset({_RED}): "red",
    frozenset({_AMBER}): "amber",
    frozenset({_GREEN}): "green",
    frozenset({_RED, _AMBER}): "red_amber",
}


def mode_from_ros(ros: Any, stamp_ns: int) -> drive.VehicleStatus:
    """Return who drives, of a ControlModeReport; partly autonomous is manual."""
    return drive.VehicleStatus(stamp_ns=stamp_ns, control_mode=_MODES.get(ros.mode, "unknown"))


def gear_from_ros(ros: Any, stamp_ns: int) -> drive.VehicleStatus:
    """Return the gear of a GearReport."""
    return drive.VehicleStatus(stamp_ns=stamp_ns, gear=_GEARS.get(ros.report, "unknown"))


def indicator_from_ros(ros: Any, stamp_ns: int) -> drive.VehicleStatus:
    """Return the indicators of a TurnIndicatorsReport."""
    return drive.VehicleStatus(stamp_ns=stamp_ns, indicator=_INDICATORS.get(ros.report, "unknown"))


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


def signals_from_ros(ros: Any, stamp_ns: int) -> tuple[drive.SignalState, ...]:
    """Return the colour of each group of a TrafficLightGroupArray; ids are decimal digits.

    Elements of several shapes count together where they agree (a green arrow beside a red light is
    unknown); all off is dark.
    """
    return tuple(
        drive.SignalState(
            stamp_ns=stamp_ns, group_id=str(group.traffic_light_group_id), colour=_colour(group)
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
