"""A car on a lot as rows: its fence and its anchor in the World, and whether it is shown what is
virtual."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from foretwin.contracts.anchor import Anchor, AnchorLine
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.towards_vehicle import Injection
from foretwin.viewer.colours import VIRTUAL
from foretwin.viewer.copilot.words import virtual_objects
from foretwin.viewer.log_drive import LIMIT
from foretwin.viewer.log_roads import NAME_HEIGHT_M, ROUTE_HEIGHT_M
from foretwin.viewer.rows import Row, document, point_at, raised, static


def rows_of_lot(
    anchor: Anchor, fence: Sequence[tuple[float, float]], *, drive_frame: LocalFrame
) -> list[Row]:
    """Return what holds all along: where the lot lies in the World, and the curves' looks.

    `fence` are its corners on the lot, latitude and longitude in degrees; empty without one.
    """
    here = local_from_geo(drive_frame, anchor.world.lat_deg, anchor.world.lon_deg)
    mark = rr.Points3D(
        [point_at(here, NAME_HEIGHT_M)],
        labels=["anchor"],
        colors=[VIRTUAL],
        radii=rr.Radius.ui_points(5.0),
        show_labels=True,
    )
    rows = [
        static("map/anchor", mark),
        static("lot/room_m/fence", rr.SeriesLines(colors=VIRTUAL, names="to the fence")),
        static("lot/room_m/needed", rr.SeriesLines(colors=LIMIT, names="needed")),
    ]
    if fence:
        lat_deg, lon_deg = np.array((*fence, fence[0])).T
        there = anchor.world_from_lot_line(AnchorLine(lat_deg, lon_deg, 0.0 * lat_deg))
        corners_m = local_from_geo(drive_frame, there.lat_deg, there.lon_deg)
        line = rr.LineStrips3D(
            [raised(corners_m, ROUTE_HEIGHT_M)], colors=[VIRTUAL], radii=rr.Radius.ui_points(1.5)
        )
        rows.append(static("map/fence", line))
    return rows


def rows_of_injection(told: Injection, drive_ns: int) -> list[Row]:
    """Return the gate's state with its reason, and the way to the fence beside what is needed."""
    # With its time: what a gateway said that has died since stays on screen.
    text = f"**{drive_ns / 1e9:.1f} s** · gate **{told.gate}** · {virtual_objects(told, age_s=0.0)}"
    return [
        Row("lot/gate", drive_ns, document(text)),
        Row("lot/room_m/fence", drive_ns, rr.Scalars(told.fence_m)),
        Row("lot/room_m/needed", drive_ns, rr.Scalars(told.margin_m)),
    ]
