"""What a car was shown that is not there: not taken for real where the car says so itself."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import LocalFrame, local_pose
from foretwin.telemetry.ros2.virtual_objects import moved
from foretwin.telemetry.ros_messages.shapes import uuid_from

_MOST = 4096
"""So many are remembered, the newest."""
_REMEMBERED_NS = 2_000_000_000
"""So long one is looked for by its place, where a list says no ids: perception holds a track of
what it does not see any more about as long."""
_SAME_PLACE_M, _SAME_SIZE_M, _SAME_SPEED_MPS = 0.5, 0.01, 0.1


class Injected:
    """The virtual road users that went out to a car: by their UUIDs, and where on its lot."""

    def __init__(self) -> None:
        self._uuids: dict[str, str] = {}
        self._shown: dict[str, tuple[int, RoadUser]] = {}

    def note(self, sent: RoadUsers) -> None:
        """Take what goes out."""
        for user in sent.users:
            if not user.virtual:
                continue
            if (uuid := self._uuids.get(user.user_id)) is None:
                uuid = bytes(uuid_from(user).uuid).hex()
                self._uuids[user.user_id] = uuid
            self._shown.pop(uuid, None)
            self._shown[uuid] = (sent.stamp_ns, user)
            if len(self._shown) > _MOST:
                _, gone = self._shown.pop(next(iter(self._shown)))
                self._uuids.pop(gone.user_id, None)

    def without(self, seen: RoadUsers) -> RoadUsers:
        """Return what the car sees that was not shown to it.

        It is known by its UUID; in a list without ids, whose own are numbers, by its place at that
        time, size and speed.
        """
        if not self._shown:
            return seen
        users = tuple(user for user in seen.users if not self._is_shown(user, seen.stamp_ns))
        return seen if len(users) == len(seen.users) else replace(seen, users=users)

    def _is_shown(self, user: RoadUser, stamp_ns: int) -> bool:
        if user.user_id in self._shown:
            return True
        return user.user_id.isdecimal() and any(
            _is_same(user, one) for one in self._around(stamp_ns)
        )

    def _around(self, stamp_ns: int) -> Iterator[RoadUser]:
        for shown_ns, user in self._shown.values():
            if abs(stamp_ns - shown_ns) <= _REMEMBERED_NS:
                yield moved(user, user.speed_mps * (stamp_ns - shown_ns) * 1e-9)


def _is_same(seen: RoadUser, shown: RoadUser) -> bool:
    sizes_m = (seen.length_m - shown.length_m, seen.width_m - shown.width_m)
    if max(map(abs, sizes_m)) > _SAME_SIZE_M:
        return False
    x_m, y_m, _ = local_pose(LocalFrame(shown.position), seen.position, 0.0)
    return (
        abs(seen.speed_mps - shown.speed_mps) <= _SAME_SPEED_MPS
        and x_m * x_m + y_m * y_m <= _SAME_PLACE_M**2
    )
