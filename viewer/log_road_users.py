"""Road users around the car as rows of boxes: those that it detects, and virtual ones apart."""

from __future__ import annotations

import numpy as np
import rerun as rr

from foretwin.contracts.drive import RoadUsers
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.road_user_heights import HEIGHT_M
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.viewer.colours import Colour
from foretwin.viewer.log_drive import PERIOD_NS
from foretwin.viewer.rows import Row

DETECTED_PATH, VIRTUAL_PATH = "world/detected", "world/virtual_traffic"
_ABOVE_GROUND_M = 0.05


class RoadUsersLog:
    """Turns one source's road users into rows of a path, at most at about 10 Hz of drive time."""

    def __init__(self, drive_frame: LocalFrame, path: str, colour: Colour) -> None:
        self._frame, self._path, self._colour = drive_frame, path, colour
        self._last_ns: int | None = None

    def rows(self, message: RoadUsers, drive_ns: int) -> list[Row]:
        """Return the boxes of all, none where there is nobody any more."""
        users = message.users
        if not users:
            return self._none(drive_ns)
        if self._last_ns is not None and 0 <= drive_ns - self._last_ns < PERIOD_NS:
            return []
        self._last_ns = drive_ns
        degrees = np.array([(user.position.lat_deg, user.position.lon_deg) for user in users]).T
        xy = local_from_geo(self._frame, *degrees)
        yaw = local_from_geo_yaw(self._frame, np.array([one.yaw_rad for one in users]), *degrees)
        size = np.array([(one.length_m, one.width_m, HEIGHT_M[one.kind]) for one in users])
        turned = np.zeros((len(users), 4))
        turned[:, 2], turned[:, 3] = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        boxes = rr.Boxes3D(
            half_sizes=0.5 * size,
            centers=np.column_stack([xy, 0.5 * size[:, 2] + _ABOVE_GROUND_M]),
            quaternions=turned,
            colors=[self._colour],
            radii=0.04,
            fill_mode="majorwireframe",
        )
        return [Row(self._path, drive_ns, boxes)]

    def old(self, drive_ns: int) -> list[Row]:
        """Return what takes those away of whom nothing was told for `USERS_FOR_NS`."""
        if self._last_ns is None or drive_ns - self._last_ns <= USERS_FOR_NS:
            return []
        return self._none(drive_ns)

    def _none(self, drive_ns: int) -> list[Row]:
        self._last_ns = None
        return [Row(self._path, drive_ns, rr.Clear(recursive=False))]
