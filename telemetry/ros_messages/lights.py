"""What lights show as Autoware's messages: TrafficLightGroupArray, and TrafficSignalArray of
autoware_auto, from which it came.

Constants are those of autoware_msgs 1.12 and of tier4/autoware_auto_msgs. A light shows one round
lamp for each of its colours; one that is dark, a lamp that is off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.lights import ShownLight
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.parts import ros_message

_LAMPS: dict[SignalColour, tuple[int, ...]] = {
    "red": (1,), "amber": (2,), "green": (3,), "red_amber": (1, 2), "dark": (0,),
}  # fmt: skip
"""RED, AMBER, GREEN, and 0 for a lamp that is off; what is unknown is not told."""


class _Codes(NamedTuple):
    """The numbers of a type for a round lamp, off and on."""

    kind: str
    circle: int
    off: int
    on: int


_SOURCE = "SIMULATION"
"""PredictedTrafficLightState.information_source, one of the words that it names."""
_ELEMENT = _Codes("autoware_perception_msgs/msg/TrafficLightElement", 1, 1, 2)
_LIGHT = _Codes("autoware_auto_perception_msgs/msg/TrafficLight", 5, 15, 16)


def groups_from(
    lights: Sequence[ShownLight], ids: Mapping[str, Sequence[int]], *, stamp_ns: int
) -> Any:
    """Return the TrafficLightGroupArray of lights, each under all its `ids` by group.

    What a light changes to, and when, is its one prediction, where that is known.
    """
    told = []
    for light in lights:
        for number in ids.get(light.group_id, ()):
            if lamps := _lamps(light.colour, _ELEMENT):
                kind = "autoware_perception_msgs/msg/TrafficLightGroup"
                predictions = _predictions(light, stamp_ns)
                told.append(
                    ros_message(
                        kind,
                        traffic_light_group_id=number,
                        elements=lamps,
                        predictions=predictions,
                    )
                )
    stamp = parts.time_from(stamp_ns)
    return ros_message(parts.TRAFFIC_LIGHTS, stamp=stamp, traffic_light_groups=told)


def signals_from(
    lights: Sequence[ShownLight], ids: Mapping[str, Sequence[int]], *, stamp_ns: int
) -> Any:
    """Return the TrafficSignalArray of lights, each under all its `ids` by group."""
    told = []
    for light in lights:
        for number in ids.get(light.group_id, ()):
            if lamps := _lamps(light.colour, _LIGHT):
                kind = "autoware_auto_perception_msgs/msg/TrafficSignal"
                told.append(ros_message(kind, map_primitive_id=number, lights=lamps))
    header = parts.header_from(stamp_ns, parts.MAP_FRAME)
    return ros_message(parts.TRAFFIC_SIGNALS, header=header, signals=told)


FROM_LIGHTS: dict[str, Callable[..., Any]] = {
    parts.TRAFFIC_LIGHTS: groups_from,
    parts.TRAFFIC_SIGNALS: signals_from,
}
"""How lights go out as each type."""


def _lamps(colour: SignalColour, codes: _Codes) -> list[Any]:
    return [
        ros_message(
            codes.kind,
            color=lamp,
            shape=codes.circle,
            status=codes.on if lamp else codes.off,
            confidence=1.0,
        )
        for lamp in _LAMPS.get(colour, ())
    ]


def _predictions(light: ShownLight, stamp_ns: int) -> list[Any]:
    if light.next_colour is None or light.changes_in_s is None:
        return []
    kind = "autoware_perception_msgs/msg/PredictedTrafficLightState"
    at_ns = stamp_ns + round(light.changes_in_s * 1e9)
    return [
        ros_message(
            kind,
            predicted_stamp=parts.time_from(at_ns),
            simultaneous_elements=_lamps(light.next_colour, _ELEMENT),
            reliability=1.0,
            information_source=_SOURCE,
        )
    ]
