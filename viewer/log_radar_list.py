"""Lists of virtual radars as rows: each return, by its colour whether it comes nearer."""

from __future__ import annotations

import numpy as np
import rerun as rr

from foretwin.contracts.arrays import Array
from foretwin.contracts.radar_list import RadarList, base_places
from foretwin.viewer.rows import Row

PATH = "world/ego/real/radar"
_STANDS, _NEARER, _FARTHER = (np.array(one) for one in ([150] * 3, [240, 80, 60], [80, 140, 250]))
_FULL_MPS = 10.0
"""What comes nearer or goes away as fast is as red or blue as it gets."""


def colours_of(range_rate_mps: Array) -> Array:
    """Return (N, 3): grey what keeps its distance, red what comes nearer, blue what goes away."""
    share = np.clip(range_rate_mps / _FULL_MPS, -1.0, 1.0)[:, None]
    towards = np.where(share < 0.0, _NEARER, _FARTHER)
    return np.asarray((_STANDS + np.abs(share) * (towards - _STANDS)).astype(np.uint8))


def rows_of_radar_list(message: RadarList, drive_ns: int) -> list[Row]:
    """Return the returns of one list, which hang on the car."""
    path = f"{PATH}/{rr.escape_entity_path_part(message.sensor or 'sensor')}"
    shown = rr.Points3D(
        base_places(message),
        colors=colours_of(message.returns[:, 3].astype(np.float64)),
        radii=rr.Radius.ui_points(5.0),
    )
    return [Row(path, drive_ns, shown)]
