"""Live vehicles and the car are told of one another, and who falls silent is told of."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from foretwin.contracts.drive import DriveEnd, RoadUser
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.mailbox import Mailbox, Reply
from foretwin.orchestrator.config import OtherVehicleConfig
from foretwin.orchestrator.other_vehicles.vehicles import OtherVehicleFeed
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.other_vehicles.test_vehicles import (
    AROUND,
    FRAME,
    ROLES,
    START_NS,
    TOLD,
    VAN,
    crew,
    nothing_said,  # noqa: F401 - a fixture
    on_the_bus,
    own,
)


def test_a_live_vehicle_and_the_car_are_told_of_one_another_but_for_ghosts(tmp_path: Path) -> None:
    beside, _ = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    on_the_bus(beside, from_s=0.0, to_s=2.0)
    beside.keep_up_with(own(1.9, x_m=100.0), None, ROLES | {"van": "shadow"})
    ((car,), (van,)) = (AROUND[name].users.users for name in ("van", "ego"))
    assert (car.user_id, van.user_id) == ("ego", "van")
    assert x_of_user(car) == pytest.approx(
        100.0 + box_centre_from_base_m(load_vehicle(None)), abs=0.1
    )
    assert x_of_user(van) == pytest.approx(19.0 + box_centre_from_base_m(VAN), abs=0.5)
    assert AROUND["van"].users.stamp_ns == own(1.9).stamp_ns
    AROUND.clear()
    beside.keep_up_with(own(2.0, x_m=100.0), None, ROLES | {"van": "ghost"})
    assert set(AROUND) == {"ego"}
    assert AROUND["ego"].users.users == ()


def x_of_user(user: RoadUser) -> float:
    return float(local_from_geo(FRAME, user.position.lat_deg, user.position.lon_deg)[0])


def answered(beside: OtherVehicleFeed, at_s: float) -> None:
    """Let the question for the time that is asked every second be answered, by nobody."""
    beside.take_time(Reply("vehicle_clock", ("ego", 0), None, "no answer", round(at_s * 1e9)))


def test_who_falls_silent_is_told_of_once_and_again_when_it_was_heard(tmp_path: Path) -> None:
    beside, _ = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    on_the_bus(beside, from_s=0.0, to_s=1.0)
    now_s = time.monotonic()
    for later_s in (1.0, 3.0, 5.0):
        answered(beside, now_s + later_s)
    assert TOLD == ["van is heard", "van is silent: gone until it is heard again"]
    on_the_bus(beside, from_s=1.0, to_s=2.0)
    assert TOLD[2:] == ["van is heard again"]


def test_who_has_said_that_it_is_over_is_not_called_silent(tmp_path: Path) -> None:
    beside, _ = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    on_the_bus(beside, from_s=0.0, to_s=1.0)
    bus, box = MemoryBus(), Mailbox(4)
    bus.subscribe("end", box, vehicle="van")
    bus.publish("end", DriveEnd(stamp_ns=START_NS, published={}), vehicle="van")
    beside.take_sample("van", box.take())
    answered(beside, time.monotonic() + 9.0)
    assert TOLD == ["van is heard"]


def test_who_does_not_say_where_its_antenna_sits_is_told_of(tmp_path: Path) -> None:
    beside, _ = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    on_the_bus(beside, from_s=0.0, to_s=0.2)
    beside.take_info("van", None)
    assert "van does not say where on it its positions are of" in TOLD[-1]
