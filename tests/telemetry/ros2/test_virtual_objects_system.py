"""A user's script says a road user that does not exist, and the car's ROS 2 hears of it, or not."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from contracts.bus import Mailbox, ZenohBus
from contracts.foreign_bus import Arrived, ZenohForeignBus
from contracts.setup import BusSetup
from telemetry.ros_parts import PREDICTED_OBJECTS, typestore
from tests.contracts.bus_sides import free_endpoint, python
from tests.telemetry.ros2.gateway_ground import ROOT, gateway_process, mapping_text

EXAMPLE = ROOT / "examples" / "virtual_road_user.py"
OBJECTS_KEY = "0/perception/objects/autoware_perception_msgs::msg::dds_::PredictedObjects_/*"
DIAGNOSTICS_KEY = "0/foretwin/diagnostics/*/*"
PLACED = """
[[virtual]]
id = "parked"
kind = "car"
lat_deg = 52.5003
lon_deg = 13.4
"""

ORCHESTRATOR = """
import sys, time
from contracts.bus import ZenohBus
from contracts.drive import VehicleState
from contracts.frames import GeoPoint
from contracts.keys import alive_key
from contracts.setup import BusSetup
from contracts.towards_vehicle import Authority
with ZenohBus(BusSetup(endpoint=sys.argv[1]), router=True) as bus:
    bus.declare_alive(alive_key(run="r", process="orchestrator"))
    print("ready", flush=True)
    while True:
        bus.publish("authority", Authority(sent_mono_ns=time.monotonic_ns()), run="r")
        bus.publish("state", VehicleState(
            vehicle_id="ego", stamp_ns=time.time_ns(), position=GeoPoint(52.5, 13.4), yaw_rad=0.0,
            speed_mps=1.0, yaw_rate_radps=0.0, accel_mps2=0.0), vehicle="ego")
        time.sleep(0.01)
"""


class Ground(NamedTuple):
    """What the car's side hears, and the processes of the run."""

    objects: Mailbox
    diagnostics: Mailbox
    orchestrator: object
    script: object


@pytest.fixture
def ground(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Ground]:
    enabled, flag = request.param
    own, run = free_endpoint(), free_endpoint()
    mapping = mapping_text(enabled=enabled, endpoint=own) + PLACED
    with ExitStack() as stack:
        stack.enter_context(ZenohBus(BusSetup(endpoint=own), router=True))
        peer = stack.enter_context(ZenohForeignBus(own))
        found = Ground(
            Mailbox(1000), Mailbox(1000),
            stack.enter_context(python("-c", ORCHESTRATOR, run)),
            stack.enter_context(
                python(str(EXAMPLE), "--endpoint", run, "--lat", "52.5", "--lon", "13.4")
            ),
        )  # fmt: skip
        peer.subscribe(OBJECTS_KEY, found.objects)
        peer.subscribe(DIAGNOSTICS_KEY, found.diagnostics)
        stack.enter_context(gateway_process(tmp_path, run_endpoint=run, mapping=mapping, flag=flag))
        yield found


def both(mailbox: Mailbox) -> Arrived:
    """Return the first message with the placed and the script's road user."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        item = mailbox.take(0.2)
        if isinstance(item, Arrived) and len(objects_of(item)) == 2:
            return item
    raise AssertionError("no message with both road users")


def objects_of(item: Arrived) -> list:
    return list(typestore().deserialize_cdr(item.payload, PREDICTED_OBJECTS).objects)


@pytest.mark.parametrize("ground", [(True, True)], indirect=True)
def test_with_both_switches_the_car_hears_of_them_until_the_orchestrator_dies(
    ground: Ground,
) -> None:
    heard = both(ground.objects)
    assert heard.attachment is not None
    assert len(heard.attachment) == 33
    places = {}
    for one in objects_of(heard):
        at = one.kinematics.initial_pose_with_covariance.pose.position
        places[one.classification[0].label] = (at.x, at.y)
    car, pedestrian = 1, 7
    assert places[car] == pytest.approx((0.0, 33.4), abs=0.1)
    assert places[pedestrian][0] == pytest.approx(0.0, abs=0.01)
    assert -0.1 <= places[pedestrian][1] <= 6.1
    ground.script.send_signal(signal.SIGKILL)  # type: ignore[attr-defined]
    deadline = time.monotonic() + 20.0
    left = 2
    while left == 2 and time.monotonic() < deadline:
        item = ground.objects.take(0.2)
        left = left if item is None else len(objects_of(item))
    assert left == 1, "what its sender does not say any more is still there"
    killed_ns = time.monotonic_ns()
    ground.orchestrator.send_signal(signal.SIGKILL)  # type: ignore[attr-defined]
    last_ns = killed_ns
    while (item := ground.objects.take(0.6)) is not None:
        last_ns = item.received_mono_ns
    assert last_ns - killed_ns < 200e6


@pytest.mark.parametrize("ground", [(True, False), (False, True)], indirect=True)
def test_with_one_switch_it_hears_nothing(ground: Ground) -> None:
    for _ in range(2):
        assert ground.diagnostics.take(20.0) is not None
    assert ground.objects.take() is None
