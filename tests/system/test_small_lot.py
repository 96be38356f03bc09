"""A car of 1:10 on a lot of 20 m by 10 m brakes for a pedestrian whom only the World holds."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.anchor_file import AnchorFile, anchor_text
from foretwin.contracts.frames import GeoPoint, geo_pose
from tests.system.test_lot_drive import PACES, LotSide, on_the_lot
from tests.telemetry.lot_car.test_braking import MAPPING

SCALE = 10.0
SMALL = Anchor(
    lot=AnchorPose(lat_deg=48.1, lon_deg=11.6, yaw_deg=30.0),
    world=AnchorPose(lat_deg=44.9998199, lon_deg=-30.0050731, yaw_deg=3.0),
    scale=SCALE,
)
"""Where the drawn town begins."""
CORNERS_M = (-3.0, -5.0), (17.0, -5.0), (17.0, 5.0), (-3.0, 5.0)
WALKER_M = 6.0
"""On the lot, straight on from its point."""
SHORT_OF_M = 2.0 / SCALE


def place(x_m: float, y_m: float) -> GeoPoint:
    """Return a place on the lot, along and to the left of its direction."""
    cos, sin = math.cos(SMALL.lot.yaw_rad), math.sin(SMALL.lot.yaw_rad)
    return geo_pose(SMALL.lot.frame, cos * x_m - sin * y_m, sin * x_m + cos * y_m, 0.0).position


def small_lot() -> LotSide:
    """Return what `docs/small-cars.md` writes."""
    walker = SMALL.world_from_lot(place(WALKER_M, 0.0), 0.0).position
    mapping = MAPPING.format(
        dialect="ros2dds", objects="PredictedObjects", lat=walker.lat_deg, lon=walker.lon_deg
    )
    for there, here in (
        ("[0.95, 0.0, 1.45]", "[0.095, 0.0, 0.145]"),
        ("lat_deg = 52.4739\nlon_deg = 13.395\n", "lat_deg = 48.1\nlon_deg = 11.6\n"),
    ):
        assert there in mapping
        mapping = mapping.replace(there, here)
    places = [place(*xy_m) for xy_m in CORNERS_M]
    fence = tuple((one.lat_deg, one.lon_deg) for one in places)
    file = AnchorFile(lot=SMALL.lot, world=SMALL.world, scale=SCALE, fence=fence)
    return LotSide(
        mapping, anchor_text(file), ("--vehicle", "f1tenth"), ("--way", "12", "--speed", "0.8")
    )


@pytest.mark.judge
@pytest.mark.timeout(900)
def test_a_car_of_1_10_stands_before_a_pedestrian_on_its_lot(tmp_path: Path) -> None:
    for pace in PACES:
        folder = tmp_path / str(pace)
        folder.mkdir()
        with on_the_lot(folder, small_lot(), pace=pace) as (report, log, _):
            print(pace, report)
        if report["stood_before_m"] is not None or "vehicle: shut: " not in log:
            break
    assert report["brakes"] == ["pedestrian"], log
    assert report["stood_before_m"] == pytest.approx(SHORT_OF_M, abs=0.1)
    assert 0.5 < report["braked_at_m"] < 4.0
    assert report["lists"] > 100
