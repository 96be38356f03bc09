"""Clouds of virtual lidars as rows: the last turn of each, thinned out, as bright as it was."""

from __future__ import annotations

import numpy as np
import rerun as rr

from foretwin.contracts.point_cloud import PointCloud
from foretwin.viewer.log_drive import PERIOD_NS
from foretwin.viewer.rows import Row

PATH = "world/ego/real/points"
MOST_POINTS = 4_000
"""Of a turn: each so many-th is drawn, so that a recording grows by 64 kB for one at most."""
_DARK, _BRIGHT = np.array([40, 90, 190]), np.array([250, 235, 120])
_BRIGHT_PERCENT = 60.0
"""A tree's; what is brighter looks the same."""


class PointCloudLog:
    """Turns clouds into rows, of each sensor at about 10 Hz of drive time.

    Points hang on the car as it was when the turn began, and go with it until the next is there.
    """

    def __init__(self) -> None:
        self._last_ns: dict[str, int] = {}

    def rows(self, message: PointCloud, drive_ns: int) -> list[Row]:
        """Return the points of one turn."""
        last_ns = self._last_ns.get(message.sensor)
        if last_ns is not None and 0 <= drive_ns - last_ns < PERIOD_NS:
            return []
        self._last_ns[message.sensor] = drive_ns
        every = -(-len(message.points) // MOST_POINTS) or 1
        points = message.points[::every]
        bright = np.clip(points[:, 3:4] / _BRIGHT_PERCENT, 0.0, 1.0)
        colours = (_DARK + bright * (_BRIGHT - _DARK)).astype(np.uint8)
        path = f"{PATH}/{rr.escape_entity_path_part(message.sensor or 'sensor')}"
        shown = rr.Points3D(points[:, :3], colors=colours, radii=rr.Radius.ui_points(1.5))
        return [Row(path, drive_ns, shown)]
