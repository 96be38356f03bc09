"""The whole map as rows: its roads, the route, the names of streets on the way."""

from __future__ import annotations

import numpy as np
import rerun as rr

from foretwin.contracts.roads_shown import RoadsShown
from foretwin.viewer.colours import Colour
from foretwin.viewer.legend import ROUTE
from foretwin.viewer.rows import Row, plain_text, point_at, raised, static

STREET: Colour = (92, 98, 110)
NAME: Colour = (214, 218, 226)
HEIGHT_M, ROUTE_HEIGHT_M, NAME_HEIGHT_M = -0.5, 40.0, 45.0
"""The map lies below the Worlds, the route above their buildings."""


def rows_of_roads(roads: RoadsShown) -> list[Row]:
    """Return what the view from above shows at all times."""
    rows = []
    if len(roads.counts):
        lines = np.split(roads.xy_m, np.cumsum(roads.counts)[:-1])
        strips = rr.LineStrips3D(
            [raised(line, HEIGHT_M).astype(np.float32) for line in lines],
            colors=[STREET],
            radii=rr.Radius.ui_points(1.0),
        )
        rows.append(static("map/roads", strips))
    if roads.routes:
        way = rr.LineStrips3D(
            [raised(line, ROUTE_HEIGHT_M) for line in roads.routes],
            colors=[ROUTE],
            radii=rr.Radius.ui_points(2.0),
        )
        rows.append(static("map/route", way))
    if roads.names:
        names = rr.Points3D(
            [point_at(np.array([one.x_m, one.y_m]), NAME_HEIGHT_M) for one in roads.names],
            labels=[plain_text(one.name) for one in roads.names],
            colors=[NAME],
            radii=rr.Radius.ui_points(1.0),
            show_labels=True,
        )
        rows.append(static("map/names", names))
    return rows
