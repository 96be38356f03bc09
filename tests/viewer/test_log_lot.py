"""A car's lot on screen: its fence and its anchor in the World, the gate, and the room left."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.towards_vehicle import Injection
from foretwin.viewer.log_lot import rows_of_lot
from tests.viewer import scene
from tests.viewer.shown import Shown, monitor_of, text_of
from tests.viewer.test_log_road_users import cells

_JUNCTION = geo_pose(scene.DRIVE_FRAME, 30.0, -40.0, 0.0).position
ANCHOR = Anchor(
    lot=AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0),
    world=AnchorPose(lat_deg=_JUNCTION.lat_deg, lon_deg=_JUNCTION.lon_deg, yaw_deg=90.0),
    scale=10.0,
)
"""East on the lot is north in the World, and a metre ten."""


def shown_of(*corners_m: tuple[float, float]) -> Shown:
    corners = [geo_pose(ANCHOR.lot.frame, x, y, 0.0).position for x, y in corners_m]
    fence = [(one.lat_deg, one.lon_deg) for one in corners]
    rows = rows_of_lot(ANCHOR, fence, drive_frame=scene.DRIVE_FRAME)
    return Shown(monitor_of(lot=rows).opening())


def test_fence_and_anchor_stand_on_the_map_where_the_world_has_them() -> None:
    shown = shown_of((10.0, -5.0), (10.0, 5.0), (-10.0, 5.0))
    (point,) = cells(shown["map/anchor"].positions)
    assert point[:2] == pytest.approx([30.0, -40.0], abs=0.01)
    (line,) = cells(shown["map/fence"].strips)
    corners = [[80.0, 60.0], [-20.0, 60.0], [-20.0, -140.0], [80.0, 60.0]]
    assert np.array(line)[:, :2] == pytest.approx(np.array(corners), abs=0.05)
    assert all(row.lasting for row in shown.rows if row.path.startswith("map/"))


def test_a_lot_without_a_fence_has_its_anchor_alone() -> None:
    assert "map/anchor" in shown_of().paths
    assert "map/fence" not in shown_of().paths


def test_the_gate_is_said_with_its_reason_and_time_and_the_room_is_drawn() -> None:
    told = Injection(
        stamp_ns=scene.START_NS + 12_340_000_000, gate="shut", reason="near the fence",
        fence_m=28.4, margin_m=29.4,
    )  # fmt: skip
    shown = Shown(monitor_of().handle("injection", told))
    assert text_of(shown["lot/gate"]) == (
        "**12.3 s** · gate **shut** · virtual objects off: near the fence · "
        "fence 28 m off, 29 m needed"
    )
    assert cells(shown["lot/room_m/fence"].scalars) == [28.4]
    assert cells(shown["lot/room_m/needed"].scalars) == [29.4]
    assert {row.drive_ns for row in shown.rows} == {12_340_000_000}
