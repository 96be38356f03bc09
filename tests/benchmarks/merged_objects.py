"""From a car's list of objects to the merged one at its stack: over Zenoh, through the gateway."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.foreign_bus import Arrived, ForeignBus, ZenohForeignBus
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.telemetry.ros_messages.objects import CERTAIN, predicted_from_users
from foretwin.telemetry.ros_messages.parts import PREDICTED_OBJECTS, typestore
from tests.benchmarks.measuring import Measurement
from tests.contracts.bus_sides import DEADLINE_S, python
from tests.telemetry.ros2.gateway_ground import FRAME, attached, gateway_process, mapping_text
from tests.telemetry.ros2.test_virtual_objects_system import ORCHESTRATOR

LISTS, PERIOD_S = 100, 0.1
REAL, VIRTUAL = 60, 40
_TYPE = "autoware_perception_msgs::msg::dds_::PredictedObjects_"
# Below /foretwin/ no gate shuts where this machine is busy; the way is the same.
_MORE = """
[[in]]
topic = "/perception/real"
type = "autoware_perception_msgs/msg/PredictedObjects"
channel = "objects"
[[out]]
topic = "/foretwin/merged_objects"
type = "autoware_perception_msgs/msg/PredictedObjects"
source = "merged_objects"
"""


class ListsTaken(NamedTuple):
    """How long each list took, in ms, and how many objects the last one held."""

    ms: list[float]
    objects: int


def measure() -> Measurement:
    """Return the 95th percentile of ms with 60 real and 40 virtual ones; the baseline is that of
    lists that are passed on, before the first virtual one was said."""
    own, run = free_endpoint(), free_endpoint()
    mapping = mapping_text(enabled=True, endpoint=own, more=_MORE)
    merged = Mailbox(1000)
    with (
        tempfile.TemporaryDirectory() as folder,
        ZenohBus(BusSetup(endpoint=own), router=True),
        ZenohForeignBus(BusSetup(endpoint=own)) as car,
        python("-c", ORCHESTRATOR, run),
        ZenohBus(BusSetup(endpoint=run)) as bus,
    ):
        car.subscribe(f"0/foretwin/merged_objects/{_TYPE}/*", merged)
        with gateway_process(Path(folder), run_endpoint=run, mapping=mapping, flag=True):
            until_s = time.monotonic() + DEADLINE_S
            while not _taken(car, merged, None, lists=1, within_s=0.5).ms:
                assert time.monotonic() < until_s, "no merged list"
            alone = _taken(car, merged, None, lists=LISTS)
            beside = _taken(car, merged, bus, lists=LISTS)
    assert len(alone.ms) == len(beside.ms) == LISTS, (len(alone.ms), len(beside.ms))
    assert alone.objects == REAL < beside.objects, (alone.objects, beside.objects)
    p50, p95 = np.percentile(beside.ms, (50, 95)).tolist()
    more = {"p50": p50, "most": max(beside.ms), "lists": len(beside.ms), "objects": beside.objects}
    return Measurement(p95, "ms", float(np.percentile(alone.ms, 95)), more)


def _taken(
    car: ForeignBus, merged: Mailbox, bus: ZenohBus | None, *, lists: int, within_s: float = 5.0
) -> ListsTaken:
    """Say lists of the car at its rate, and virtual objects at twice that on `bus`."""
    taken = ListsTaken([], 0)
    for number in range(lists):
        begun_s = time.monotonic()
        stamp_ns = time.time_ns()
        if bus is not None:
            bus.publish("virtual_objects", crowd(stamp_ns, VIRTUAL, virtual=True), run="r")
            time.sleep(PERIOD_S / 2.0)
        ros = predicted_from_users(crowd(stamp_ns, REAL, virtual=False), FRAME, CERTAIN)
        data = bytes(typestore().serialize_cdr(ros, PREDICTED_OBJECTS))
        put_s = time.perf_counter()
        car.put(f"0/perception/real/{_TYPE}/RIHS01_x", data, attached(number))
        item = merged.take(within_s)
        if not isinstance(item, Arrived):
            break
        taken.ms.append(1e3 * (time.perf_counter() - put_s))
        found = typestore().deserialize_cdr(item.payload, PREDICTED_OBJECTS)
        taken = taken._replace(objects=len(found.objects))
        time.sleep(max(0.0, begun_s + PERIOD_S - time.monotonic()))
    return taken


def crowd(stamp_ns: int, count: int, *, virtual: bool) -> RoadUsers:
    """Return walkers and cars all around, virtual ones between the real ones."""
    rng = np.random.default_rng(int(virtual))
    users = []
    for number in range(count):
        x_m, y_m, yaw_rad = rng.uniform(-60.0, 60.0, 3).tolist()
        at = geo_pose(FRAME, x_m, y_m, yaw_rad)
        walks = number % 2 == 0
        users.append(
            RoadUser(
                user_id=f"{number:030x}{int(virtual):02x}",
                kind="pedestrian" if walks else "car",
                position=at.position,
                yaw_rad=at.yaw_rad,
                speed_mps=1.0,
                length_m=0.5 if walks else 4.5,
                width_m=0.6 if walks else 1.8,
                virtual=virtual,
            )
        )
    return RoadUsers(stamp_ns=stamp_ns, users=tuple(users))
