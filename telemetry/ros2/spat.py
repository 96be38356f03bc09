"""Signal phase and timing as V2X says it: SAE J2735 SPAT, which ISO/TS 19091 profiles, as JSON.

The field names are those of the standard's ASN.1, as its JSON encoding rules write them:
`timeStamp` (MinuteOfTheYear, UTC), and for each intersection `id`, `revision`, `status`, `moy`,
`timeStamp` (DSecond) and `states`, each with `movementName`, `signalGroup` and one
`state-time-speed` of `eventState` and, where it is known when that ends, `timing` with
`minEndTime` and `maxEndTime` (TimeMark: tenths of a second into the hour, UTC). Both are the same:
a plan of fixed times knows one end. Nothing is said of speeds, lanes or later phases.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.lights import ShownLight

_EVENTS: dict[SignalColour, str] = {
    "red": "stop-And-Remain",
    "red_amber": "pre-Movement",
    # A turn across oncoming traffic may have the same green: nothing here is protected.
    "green": "permissive-Movement-Allowed",
    "amber": "permissive-clearance",
    "dark": "dark",
    "unknown": "unavailable",
}
_COLOURS: dict[str, SignalColour] = {event: colour for colour, event in _EVENTS.items()} | {
    "protected-Movement-Allowed": "green",
    "protected-clearance": "amber",
    "stop-Then-Proceed": "red",
}
"""MovementPhaseState; `caution-Conflicting-Traffic` is a flashing amber, for which no colour
stands here."""
_MANUAL, _FIXED = "8000", "0400"
"""IntersectionStatusObject as a bit string: manualControlIsEnabled, fixedTimeOperation."""
_HOUR_TENTHS = 36_000
MOST_STATES, MOST_INTERSECTIONS = 255, 32
"""Of the standard."""


class V2xMovement(NamedTuple):
    """A signal group of an intersection, as V2X numbers them."""

    intersection: int
    signal_group: int


class _Event(msgspec.Struct, frozen=True):
    state: str = msgspec.field(name="eventState")


class _State(msgspec.Struct, frozen=True):
    signal_group: int = msgspec.field(name="signalGroup")
    events: list[_Event] = msgspec.field(name="state-time-speed")


class _Id(msgspec.Struct, frozen=True):
    id: int


class _Intersection(msgspec.Struct, frozen=True):
    id: _Id
    states: list[_State]


class _Spat(msgspec.Struct, frozen=True):
    intersections: list[_Intersection]


def spat_json(
    lights: Iterable[ShownLight],
    movements: Mapping[str, V2xMovement],
    *,
    wall_ns: int,
    revision: int,
) -> str | None:
    """Return the SPAT of lights whose groups have `movements`, None where there is none.

    `wall_ns` is UTC now, from which the lights' changes count; `revision` counts messages.
    """
    now = datetime.datetime.fromtimestamp(wall_ns // 1_000_000_000, datetime.UTC)
    year = datetime.datetime(now.year, 1, 1, tzinfo=datetime.UTC)
    minute = int((now - year).total_seconds()) // 60
    ms = now.second * 1000 + wall_ns % 1_000_000_000 // 1_000_000
    found: dict[int, list[tuple[V2xMovement, ShownLight]]] = {}
    for light in lights:
        if (movement := movements.get(light.group_id)) is not None:
            found.setdefault(movement.intersection, []).append((movement, light))
    if not found:
        return None
    intersections = [
        {
            "id": {"id": number},
            "revision": revision % 128,
            "status": _MANUAL if any(light.why == "set" for _, light in group) else _FIXED,
            "moy": minute,
            "timeStamp": ms,
            "states": [_movement_state(*one, wall_ns) for one in group[:MOST_STATES]],
        }
        for number, group in sorted(found.items())[:MOST_INTERSECTIONS]
    ]
    return msgspec.json.encode({"timeStamp": minute, "intersections": intersections}).decode()


def _movement_state(movement: V2xMovement, light: ShownLight, wall_ns: int) -> dict[str, Any]:
    event: dict[str, Any] = {"eventState": _EVENTS[light.colour]}
    if light.changes_in_s is not None:
        tenths = (wall_ns // 100_000_000 + round(light.changes_in_s * 10.0)) % _HOUR_TENTHS
        event["timing"] = {"minEndTime": tenths, "maxEndTime": tenths}
    return {
        "movementName": light.group_id[:63],
        "signalGroup": movement.signal_group,
        "state-time-speed": [event],
    }


def colours_from_spat(text: str) -> dict[V2xMovement, SignalColour]:
    """Return what the movements of a SPAT show now, those of no colour here left out.

    Raises ValueError for a text that is no SPAT.
    """
    try:
        message = msgspec.json.decode(text, type=_Spat)
    except msgspec.DecodeError as error:
        raise ValueError(f"no SPAT: {error}") from None
    return {
        V2xMovement(crossing.id.id, state.signal_group): _COLOURS[state.events[0].state]
        for crossing in message.intersections[:MOST_INTERSECTIONS]
        for state in crossing.states[:MOST_STATES]
        if state.events and state.events[0].state in _COLOURS
    }
