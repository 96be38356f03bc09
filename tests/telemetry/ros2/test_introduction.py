"""Who asks what the vehicle is hears it once the antenna's place can be known."""

from __future__ import annotations

from typing import Any

import pytest

from foretwin.contracts.bus import Mailbox, Reply
from foretwin.contracts.drive import InfoRequest, VehicleInfo
from tests.telemetry.ros2.gateway_ground import FIX_KEY, TF_KEY, antenna_at, fix
from tests.telemetry.ros2.test_gateway import Ground

COVERS = ("foretwin.telemetry.ros2.inwards",)
S = 10**9


class Asker:
    """Somebody on the run's bus who wants to know what the vehicle is."""

    def __init__(self, ground: Ground) -> None:
        self.ground, self.replies = ground, Mailbox(8)
        ground.bus.request("info", InfoRequest(), self.replies, vehicle="ego")

    def hears(self, passed_ms: float = 0.0) -> Any:
        """What is answered after a time, None where nothing is yet."""
        self.ground.step(passed_ms)
        reply = self.replies.take()
        if reply is None:
            return None
        assert isinstance(reply, Reply)
        return reply.message or reply.error


def test_it_is_told_at_once_where_the_antennas_place_is_known() -> None:
    ground = Ground(enabled=False, flag=False)
    ground.arrive(TF_KEY, antenna_at(1.5, -0.1, 1.8))
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))

    assert Asker(ground).hears() == VehicleInfo(
        vehicle_id="ego", time_base="log", start_stamp_ns=5 * S, end_stamp_ns=None,
        source="ROS 2 through rmw_zenoh", reference_point="antenna",
        body_from_antenna_m=pytest.approx((1.5, -0.1, 1.8)), sends=("gnss", "steering"),
    )  # fmt: skip


def test_transforms_that_may_still_come_are_waited_for_and_then_no_more() -> None:
    ground = Ground(enabled=False, flag=False)
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    first, second = Asker(ground), Asker(ground)

    assert first.hears() is None
    assert first.hears(1500.0) is None
    told = first.hears(0.1)
    assert told.body_from_antenna_m is None
    assert second.hears() == told
    assert first.hears(5000.0) is None, "an answer comes once"


def test_the_place_is_told_as_soon_as_it_is_known() -> None:
    ground = Ground(enabled=False, flag=False)
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    asker = Asker(ground)
    assert asker.hears(700.0) is None
    ground.arrive(TF_KEY, antenna_at(1.5, 0.0, 1.8))
    assert asker.hears().body_from_antenna_m == pytest.approx((1.5, 0.0, 1.8))


def test_of_a_vehicle_that_says_nothing_there_is_nothing_to_tell() -> None:
    ground = Ground(enabled=False, flag=False)
    asker = Asker(ground)
    assert asker.hears() is None
    assert asker.hears(1500.0) is None
    assert asker.hears(0.1) == "no sample of the vehicle yet"


def test_who_places_the_antenna_in_the_mapping_waits_for_no_transforms() -> None:
    ground = Ground(enabled=False, flag=False, head="antenna_m = [1.0, 0.0, 2.0]")
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    assert Asker(ground).hears().body_from_antenna_m == (1.0, 0.0, 2.0)
