"""Lights between the World and others: by which numbers each is known, and what may go where.

Only what the World's plan or somebody's word says goes out. What came in, from the car's own
recognition or by V2X, never does, nor a cycle that was learnt of it; and what was sent out is not
taken for heard where it comes back.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import msgspec

from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.lights import ShownLight, ShownLights
from foretwin.telemetry.ros2.rows import OutRow
from foretwin.telemetry.ros2.spat import V2xMovement, colours_from_spat, spat_json
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.lights import FROM_LIGHTS
from foretwin.telemetry.ros_messages.parts import ros_message, typestore

_OURS: tuple[str, ...] = ("plan", "set")
_ECHO_NS = 2_000_000_000
"""So long what was sent is known again: as long as a colour that was heard counts."""


class LightIds(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """By which numbers others know a group of lights; `foretwin lights` prints them."""

    group: str
    """Its name in the World, as `foretwin set light.GROUP` takes it."""
    ids: tuple[int, ...] = ()
    """Regulatory elements of the car's Lanelet2 map: traffic_light_group_id of Autoware."""
    ways: tuple[int, ...] = ()
    """Its lights as lines of that map: map_primitive_id of autoware_auto."""
    signals: tuple[int, ...] = ()
    """Its signals in OpenDRIVE, for who reads that; nothing goes out by them."""
    intersection: int | None = None
    """Of V2X: IntersectionID, 0 to 65535."""
    signal_group: int | None = None
    """Of V2X: SignalGroupID there, 1 to 254."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        if not self.group:
            raise ValueError("group: the name of a group of lights")
        for name, most in (("ids", 2**63), ("ways", 2**31), ("signals", 2**31)):
            if not all(0 < one < most for one in getattr(self, name)):
                raise ValueError(f"{name} {getattr(self, name)}: numbers above 0")
        if (self.intersection is None) != (self.signal_group is None):
            raise ValueError("intersection and signal_group: both or none")
        if self.intersection is not None and not 0 <= self.intersection <= 65535:
            raise ValueError(f"intersection {self.intersection}: 0 to 65535")
        if self.signal_group is not None and not 1 <= self.signal_group <= 254:
            raise ValueError(f"signal_group {self.signal_group}: 1 to 254")

    @property
    def known_as(self) -> tuple[str, ...]:
        """All by which it is found again; no two groups may share one."""
        movement = () if self.movement is None else (f"V2X {tuple(self.movement)}",)
        return f"group {self.group}", *(f"id {one}" for one in self.ids), *movement

    @property
    def movement(self) -> V2xMovement | None:
        """Its number in V2X."""
        if self.intersection is None or self.signal_group is None:
            return None
        return V2xMovement(self.intersection, self.signal_group)


class LightExchange:
    """Turns lights into what goes out, and what comes in into states of the World's groups."""

    def __init__(self, rows: Sequence[LightIds]) -> None:
        self._ids: dict[str, Mapping[str, Sequence[int]]] = {
            parts.TRAFFIC_LIGHTS: {row.group: row.ids for row in rows},
            parts.TRAFFIC_SIGNALS: {row.group: row.ways for row in rows},
        }
        self._movements = {row.group: row.movement for row in rows if row.movement is not None}
        self._by_id = {str(number): row.group for row in rows for number in row.ids}
        self._by_movement = {movement: group for group, movement in self._movements.items()}
        self._sent_ns: dict[tuple[str, SignalColour], int] = {}
        self._revision = self._stamp_ns = self._wall_ns = self._mono_ns = 0
        self._ours: tuple[ShownLight, ...] = ()

    def take(self, shown: ShownLights, *, wall_ns: int, mono_ns: int) -> None:
        """Take what lights show, to be sent now."""
        self._ours = tuple(one for one in shown.lights if one.why in _OURS)
        self._stamp_ns, self._wall_ns, self._mono_ns = shown.stamp_ns, wall_ns, mono_ns

    def payload(self, row: OutRow) -> bytes | None:
        """Return what goes out on a row, None for nothing; it is remembered."""
        told: Collection[str]
        if row.type == parts.STRING:
            text = spat_json(
                self._ours, self._movements, wall_ns=self._wall_ns, revision=self._revision
            )
            if text is None:
                return None
            self._revision += 1
            told, ros = self._movements, ros_message(parts.STRING, data=text)
        else:
            told = self._ids[row.type]
            ros = FROM_LIGHTS[row.type](self._ours, told, stamp_ns=self._stamp_ns)
        for one in self._ours:
            if one.group_id in told:
                self._sent_ns[one.group_id, one.colour] = self._mono_ns
        return bytes(typestore().serialize_cdr(ros, row.type))

    def nothing(self, row: OutRow, *, stamp_ns: int) -> bytes:
        """Return the last word of a row of lights: that nothing is known."""
        ros = FROM_LIGHTS[row.type]((), {}, stamp_ns=stamp_ns)
        return bytes(typestore().serialize_cdr(ros, row.type))

    def in_world(self, heard: SignalState) -> SignalState:
        """Return what was heard under its group's name in the World, where a row has it."""
        group = self._by_id.get(heard.group_id)
        return heard if group is None else msgspec.structs.replace(heard, group_id=group)

    def from_spat(self, text: str, stamp_ns: int) -> tuple[SignalState, ...]:
        """Return what a SPAT says of groups that rows have; raises ValueError for another text."""
        return tuple(
            SignalState(stamp_ns=stamp_ns, group_id=self._by_movement[movement], colour=colour)
            for movement, colour in colours_from_spat(text).items()
            if movement in self._by_movement
        )

    def is_echo(self, heard: SignalState, *, mono_ns: int) -> bool:
        """Whether a light is heard to show what was said of it lately."""
        sent_ns = self._sent_ns.get((heard.group_id, heard.colour))
        return sent_ns is not None and mono_ns - sent_ns <= _ECHO_NS
