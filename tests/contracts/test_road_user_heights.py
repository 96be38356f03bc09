"""Every kind of road user has one height, which all say of it."""

from __future__ import annotations

from typing import get_args

import pytest

from foretwin.contracts.drive import RoadUser, RoadUserKind
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.road_user_heights import HEIGHT_M
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.telemetry.ros_messages import shapes


def test_every_kind_has_a_height() -> None:
    assert set(HEIGHT_M) == set(get_args(RoadUserKind))


@pytest.mark.parametrize("kind", HEIGHT_M)
def test_what_sensors_measure_is_as_high_as_what_a_stack_is_told(kind: RoadUserKind) -> None:
    user = RoadUser(
        user_id="7",
        kind=kind,
        position=GeoPoint(52.5, 13.4),
        yaw_rad=0.0,
        speed_mps=0.0,
        length_m=KINDS[kind].length_m,
        width_m=KINDS[kind].width_m,
    )
    assert shapes.height_m(user) == shapes.shape_from(user).dimensions.z == KINDS[kind].height_m
