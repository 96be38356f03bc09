"""A vehicle beside the car in the configuration of a drive."""

from __future__ import annotations

import msgspec

from foretwin.contracts.roles import Role


class OtherVehicleConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A vehicle beside the car: its role, its parameters, and where its telemetry comes from.

    One of three: a recorded drive (`log`), a vehicle of this id on the bus (`live`), or who the car
    itself detects under the id `seen_as`.
    """

    id: str
    """What it is called, in one word; no two vehicles have one id."""
    role: Role = "shadow"
    """Of it as the drive begins."""
    vehicle: str | None = None
    """A parameter file or the name of a bundled vehicle; the car's own where left out."""
    log: str | None = None
    """A recorded drive that it replays."""
    log_offset_s: float | None = None
    """Seconds of it passed as the car's drive begins; None: by UTC, where both have it."""
    live: bool = False
    """Whether a vehicle of this id speaks on the bus."""
    same_clock: bool = False
    """Whether a live one stamps by the car's own clock, as by satellites: nothing is estimated."""
    ros2: str | None = None
    """A mapping in TOML, or `autoware`: how a live vehicle's own ROS 2 topics are read."""
    anchor: str | None = None
    """An anchor file: where a recorded vehicle, or one behind ROS 2, really is."""
    seen_as: str | None = None
    """The id under which the car itself detects it."""

    def trouble(self) -> str | None:
        """Return what is wrong with it, None where nothing is."""
        if not self.id or any(c in self.id for c in "/*$#?{} ."):
            return f"id {self.id!r} must be one word without / * $ # ? ."
        if self.role == "all":
            return "role all is the car's alone; must be twin, shadow or ghost"
        if (self.log is not None) + self.live + (self.seen_as is not None) != 1:
            return "needs exactly one of log = FILE, live = true, seen_as = ID"
        if self.ros2 is not None and not self.live:
            return "ros2 = MAPPING needs live = true: its topics are the vehicle's telemetry"
        if self.anchor is not None and self.log is None and self.ros2 is None:
            return "anchor = FILE needs log or ros2: who speaks on the bus is in the World already"
        return None
