"""What a car was shown that is not there: not taken for real where the car says so itself."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

from msgspec.structs import replace

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.radar_list import RadarList
from foretwin.telemetry.ros2.virtual_objects import moved
from foretwin.telemetry.ros_messages.parts import DETECTED_OBJECTS
from foretwin.telemetry.ros_messages.shapes import uuid_from

_MOST = 4096
"""So many are remembered, the newest."""
_REMEMBERED_NS = 2_000_000_000
"""So long one is looked for by its place: perception holds a track of what it does not see any more
about as long."""
_SAME_PLACE_M, _SAME_SIZE_M, _SAME_SPEED_MPS = 0.5, 0.01, 0.1
_MOST_CLOUDS = 64

How = Literal["named", "nameless", "measured"]
"""In a list with ids, in one without, or by what a sensor would have measured."""
_VAGUER: tuple[How, ...] = ("named", "nameless", "measured")


def how_shown(list_type: str) -> How:
    """Return how road users are shown in a list of that ROS type."""
    return "nameless" if list_type == DETECTED_OBJECTS else "named"


class _Shown(NamedTuple):
    stamp_ns: int
    user: RoadUser
    how: How


class Injected:
    """The virtual road users that went out to a car: by their UUIDs, and where on its lot."""

    def __init__(self) -> None:
        self._uuids: dict[str, str] = {}
        self._shown: dict[str, _Shown] = {}
        self._clouds: dict[tuple[str, int], None] = {}

    def note_measured(self, sent: PointCloud | RadarList, within: RoadUsers) -> None:
        """Take a cloud or a radar's list that goes out, and who is in it."""
        self.note(within, how="measured")
        self._clouds[sent.sensor, sent.stamp_ns] = None
        if len(self._clouds) > _MOST_CLOUDS:
            del self._clouds[next(iter(self._clouds))]

    def is_shown_cloud(self, cloud: PointCloud) -> bool:
        """Whether a cloud comes back: stacks keep the stamp, whatever they do with the points.

        Only one of the same sensor does: lidars of one car may all have the same stamps.
        """
        return (cloud.sensor, cloud.stamp_ns) in self._clouds

    def note(self, sent: RoadUsers, *, how: How = "named") -> None:
        """Take what goes out; who went out in several ways is looked for as in the vaguest."""
        for user in sent.users:
            if not user.virtual:
                continue
            if (uuid := self._uuids.get(user.user_id)) is None:
                uuid = bytes(uuid_from(user).uuid).hex()
                self._uuids[user.user_id] = uuid
            before = self._shown.pop(uuid, None)
            vaguest = how if before is None else max(how, before.how, key=_VAGUER.index)
            self._shown[uuid] = _Shown(sent.stamp_ns, user, vaguest)
            if len(self._shown) > _MOST:
                gone = self._shown.pop(next(iter(self._shown)))
                self._uuids.pop(gone.user.user_id, None)

    def without(self, seen: RoadUsers) -> RoadUsers:
        """Return what the car sees that was not shown to it.

        It is known by its UUID; where either list has none, by its place at that time, size and
        speed: in lists without ids they are numbers, and who was shown in such a list gets an id
        from the stack's own tracking. Whoever was shown as points gets its size from there too: it
        is known by where it is, and so is what is real within its outline.
        """
        if not self._shown:
            return seen
        users = tuple(user for user in seen.users if not self._is_shown(user, seen.stamp_ns))
        return seen if len(users) == len(seen.users) else replace(seen, users=users)

    def _is_shown(self, user: RoadUser, stamp_ns: int) -> bool:
        if user.user_id in self._shown:
            return True
        numbered = user.user_id.isdecimal()
        return any(
            ((numbered or how == "nameless") and _is_same(user, one))
            or (how == "measured" and _is_within(user, one))
            for one, how in self._around(stamp_ns)
        )

    def _around(self, stamp_ns: int) -> Iterator[tuple[RoadUser, How]]:
        for shown_ns, user, how in self._shown.values():
            if abs(stamp_ns - shown_ns) <= _REMEMBERED_NS:
                yield moved(user, user.speed_mps * (stamp_ns - shown_ns) * 1e-9), how


def _is_within(seen: RoadUser, shown: RoadUser) -> bool:
    """Whether the middle of what is seen lies in the outline of what was shown, or nearly."""
    x_m, y_m = _place(seen, shown)
    cos, sin = math.cos(shown.yaw_rad), math.sin(shown.yaw_rad)
    ahead_m, aside_m = abs(cos * x_m + sin * y_m), abs(cos * y_m - sin * x_m)
    return (
        ahead_m <= 0.5 * shown.length_m + _SAME_PLACE_M
        and aside_m <= 0.5 * shown.width_m + _SAME_PLACE_M
    )


def _is_same(seen: RoadUser, shown: RoadUser) -> bool:
    sizes_m = (seen.length_m - shown.length_m, seen.width_m - shown.width_m)
    if max(map(abs, sizes_m)) > _SAME_SIZE_M:
        return False
    x_m, y_m = _place(seen, shown)
    return (
        abs(seen.speed_mps - shown.speed_mps) <= _SAME_SPEED_MPS
        and x_m * x_m + y_m * y_m <= _SAME_PLACE_M**2
    )


def _place(seen: RoadUser, shown: RoadUser) -> tuple[float, float]:
    at = seen.position
    x_m, y_m = local_from_geo(LocalFrame(shown.position), at.lat_deg, at.lon_deg).tolist()
    return x_m, y_m
