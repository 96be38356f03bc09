"""A script and the mirror say who does not exist, and the car's ROS 2 hears of it, or not."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
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
[mirrored]
vehicles = ["van"]
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

MIRROR = """
import sys, time
from contracts.bus import ZenohBus
from contracts.setup import BusSetup
from contracts.simulation import MirroredVehicle, MirrorSample, PlaneState
car, van = PlaneState(0.0, 0.0, 0.0, 7.0), PlaneState(-40.0, 0.0, 0.0, 0.0)
other = MirroredVehicle(
    vehicle_id="van", role="shadow", real=van, shown=van, length_m=5.0, width_m=2.0, height_m=2.0,
    rear_overhang_m=1.0)
with ZenohBus(BusSetup(endpoint=sys.argv[1])) as bus:
    print("ready", flush=True)
    while True:
        bus.publish("mirror", MirrorSample(
            stamp_ns=time.time_ns(), world_id=None, real=car, twin=car, shadow=car, ghost=car,
            gap_m=0.0, gap_along_m=0.0, gap_across_m=0.0, gap_yaw_rad=0.0, gap_speed_mps=0.0,
            since_reset_s=0.0, independent=True, others=(other,)), run="r")
        time.sleep(0.1)
"""


class Ground(NamedTuple):
    """What the car's side hears, and the processes of the run."""

    objects: Mailbox
    diagnostics: Mailbox
    orchestrator: object
    script: object
    begin: Callable[[], None]
    """Lets a new gateway take the old one's place."""


@pytest.fixture
def ground(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Ground]:
    enabled, flag = request.param
    own, run = free_endpoint(), free_endpoint()
    mapping = mapping_text(enabled=enabled, endpoint=own) + PLACED

    def begin() -> None:
        gateway.close()
        gateway.enter_context(
            gateway_process(tmp_path, run_endpoint=run, mapping=mapping, flag=flag)
        )

    with ExitStack() as stack:
        stack.enter_context(ZenohBus(BusSetup(endpoint=own), router=True))
        peer = stack.enter_context(ZenohForeignBus(own))
        found = Ground(
            Mailbox(1000), Mailbox(1000),
            stack.enter_context(python("-c", ORCHESTRATOR, run)),
            stack.enter_context(
                python(str(EXAMPLE), "--endpoint", run, "--lat", "52.5", "--lon", "13.4")
            ),
            begin,
        )  # fmt: skip
        stack.enter_context(python("-c", MIRROR, run))
        peer.subscribe(OBJECTS_KEY, found.objects)
        peer.subscribe(DIAGNOSTICS_KEY, found.diagnostics)
        gateway = stack.enter_context(ExitStack())
        begin()
        yield found


def message_of(ground: Ground, count: int) -> Arrived:
    """Return the first message with so many road users.

    On a machine so busy that the orchestrator falls silent for 150 ms a gateway shuts, as it
    should, and for good: then another one begins.
    """
    deadline = time.monotonic() + 90.0
    heard_s = time.monotonic()
    while time.monotonic() < deadline:
        item = ground.objects.take(0.2)
        if isinstance(item, Arrived):
            heard_s = time.monotonic()
            if len(objects_of(item)) == count:
                return item
        elif time.monotonic() - heard_s > 15.0:
            ground.begin()
            heard_s = time.monotonic()
    raise AssertionError(f"no message with {count} road users")


def objects_of(item: Arrived) -> list:
    return list(typestore().deserialize_cdr(item.payload, PREDICTED_OBJECTS).objects)


@pytest.mark.parametrize("ground", [(True, True)], indirect=True)
def test_with_both_switches_the_car_hears_of_them_until_the_orchestrator_dies(
    ground: Ground,
) -> None:
    heard = message_of(ground, 3)
    assert heard.attachment is not None
    assert len(heard.attachment) == 33
    places: dict[int, list[tuple[float, float]]] = {}
    for one in objects_of(heard):
        at = one.kinematics.initial_pose_with_covariance.pose.position
        places.setdefault(one.classification[0].label, []).append((at.x, at.y))
    car, pedestrian = 1, 7
    from_mirror, placed = sorted(places[car])
    assert placed == pytest.approx((0.0, 33.4), abs=0.1)
    assert from_mirror == pytest.approx((-38.5, 0.0), abs=0.01)
    ((walker_x_m, walker_y_m),) = places[pedestrian]
    assert walker_x_m == pytest.approx(0.0, abs=0.01)
    assert -0.1 <= walker_y_m <= 6.1
    ground.script.send_signal(signal.SIGKILL)  # type: ignore[attr-defined]
    message_of(ground, 2)  # what its sender does not say any more is gone
    # The mirror speaks on, and nobody passes it on.
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
