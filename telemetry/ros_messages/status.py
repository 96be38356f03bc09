"""What Autoware says of who drives, of gear and indicators and of signal colours.

Autoware reports mode, gear and indicators in messages of their own; each becomes a StatusPart, and
`StatusJoiner` keeps what was said last of each.
"""

from __future__ import annotations

from typing import Any, Literal

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
_OFF, _FLASHING = 1, 3
"""TrafficLightElement.status."""
_RED, _AMBER, _GREEN = 1, 2, 3
_COLOURS: dict[frozenset[int], drive.SignalColour] = {
    frozenset({_RED}): "red",
    frozenset({_AMBER}): "amber",
    frozenset({_GREEN}): "green",
    frozenset({_RED, _AMBER}): "red_amber",
}


class StatusPart(msgspec.Struct, frozen=True, kw_only=True):
    """What one report says: the value of one field of a VehicleStatus, which may be unknown."""

    stamp_ns: int
    field: Literal["control_mode", "gear", "indicator"]
    value: str


def mode_from_ros(ros: Any, stamp_ns: int) -> StatusPart:
    """Return who drives, of a ControlModeReport; partly autonomous is manual."""
    mode = _MODES.get(ros.mode, "unknown")
    return StatusPart(stamp_ns=stamp_ns, field="control_mode", value=mode)


def gear_from_ros(ros: Any, stamp_ns: int) -> StatusPart:
    """Return the gear of a GearReport."""
    return StatusPart(stamp_ns=stamp_ns, field="gear", value=_GEARS.get(ros.report, "unknown"))


def indicator_from_ros(ros: Any, stamp_ns: int) -> StatusPart:
    """Return the indicators of a TurnIndicatorsReport."""
    side = _INDICATORS.get(ros.report, "unknown")
    return StatusPart(stamp_ns=stamp_ns, field="indicator", value=side)


class StatusJoiner:
    """Joins reports of mode, gear and indicators: what one is not about stays as it was."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = {}

    def join(self, part: StatusPart) -> drive.VehicleStatus:
        """Return what is known after one more report, at its stamp."""
        self._known[part.field] = part.value
        return drive.VehicleStatus(stamp_ns=part.stamp_ns, **self._known)


def signals_from_ros(ros: Any, stamp_ns: int) -> tuple[drive.SignalState, ...]:
    """Return the colour of each group of a TrafficLightGroupArray; ids are decimal digits.

    Elements of several shapes count together where they agree (a green arrow beside a red light is
    unknown); all off is dark, and what flashes is unknown: it does not mean its colour.
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
    if any(one.status == _FLASHING for one in lit):
        return "unknown"
    return _COLOURS.get(frozenset(int(one.color) for one in lit), "unknown")
