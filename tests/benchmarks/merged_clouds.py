"""From a lidar's cloud to the merged one at its stack: over Zenoh, gateway and sensors' process."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.foreign_bus import Arrived, ForeignBus, ZenohForeignBus
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup, SensorSetup, SensorsSetup, write_setup
from foretwin.sim_worker.sensors.kinds import Lidar
from foretwin.sim_worker.sensors.sensor_file import load_sensor, sensor_text
from foretwin.telemetry.ros_messages.clouds import cloud_from
from foretwin.telemetry.ros_messages.parts import POINT_CLOUD2, typestore
from tests.benchmarks.measuring import Measurement
from tests.benchmarks.merged_objects import crowd
from tests.contracts.bus_sides import DEADLINE_S, python
from tests.telemetry.ros2.gateway_ground import ROOT, attached, gateway_process, mapping_text
from tests.telemetry.ros2.test_virtual_objects_system import ORCHESTRATOR

CLOUDS, PERIOD_S, VIRTUAL = 100, 0.1, 40
_TYPE = "sensor_msgs::msg::dds_::PointCloud2_"
# Below /foretwin/ no gate shuts where this machine is busy; the way is the same.
_MORE = """
[[in]]
topic = "/lidar/raw"
type = "sensor_msgs/msg/PointCloud2"
channel = "real_cloud"
sensor = "vlp_16"
[[out]]
topic = "/foretwin/merged"
type = "sensor_msgs/msg/PointCloud2"
source = "point_cloud"
sensor = "vlp_16"
frame = "velodyne"
"""


def measure() -> Measurement:
    """Return the 95th percentile of ms of VLP-16 clouds in which each ray met something, 28,928
    points, with 40 road users put in; the baseline is with none of them."""
    own, run = free_endpoint(), free_endpoint()
    mapping = mapping_text(enabled=True, endpoint=own, more=_MORE)
    merged = Mailbox(100)
    text, name = sensor_text("vlp_16")
    mounts = (("vlp_16", load_sensor("vlp_16").mount),)
    with (
        tempfile.TemporaryDirectory() as folder,
        ZenohBus(BusSetup(endpoint=own), router=True),
        ZenohForeignBus(BusSetup(endpoint=own)) as car,
        python("-c", ORCHESTRATOR, run),
        ZenohBus(BusSetup(endpoint=run)) as bus,
    ):
        setup = SensorsSetup(
            run_id="r", process_id="sensors", vehicle_id="ego", bus=BusSetup(endpoint=run),
            log_file=f"{folder}/sensors.jsonl", worlds_dir=folder, turns_dir=folder,
            sensors=(SensorSetup(text=text, name=name, sees="real"),),
        )  # fmt: skip
        write_setup(setup, file := Path(folder) / "sensors.json")
        car.subscribe(f"0/foretwin/merged/{_TYPE}/*", merged)
        with (
            _process("foretwin.sim_worker.sensors.process", "--setup", str(file)),
            gateway_process(
                Path(folder), run_endpoint=run, mapping=mapping, flag=True, mounts=mounts
            ),
        ):
            until_s = time.monotonic() + DEADLINE_S
            while not _taken(car, merged, clouds=1, within_s=0.5):
                assert time.monotonic() < until_s, "no merged cloud"
            alone = _taken(car, merged, clouds=CLOUDS)
            over = threading.Event()
            talk = threading.Thread(target=_say_crowds, args=(bus, over))
            talk.start()
            try:
                beside = _taken(car, merged, clouds=CLOUDS)
            finally:
                over.set()
                talk.join()
    assert len(alone) == len(beside) == CLOUDS, (len(alone), len(beside))
    p50, p95 = np.percentile(beside, (50, 95)).tolist()
    more = {"p50": p50, "most": max(beside), "clouds": len(beside), "users": VIRTUAL}
    return Measurement(p95, "ms", float(np.percentile(alone, 95)), more)


@contextlib.contextmanager
def _process(*command: str) -> Iterator[None]:
    with subprocess.Popen([sys.executable, "-m", *command], cwd=ROOT) as process:
        try:
            yield
        finally:
            process.kill()


def _say_crowds(bus: ZenohBus, over: threading.Event) -> None:
    while not over.wait(PERIOD_S / 2.0):
        bus.publish("virtual_objects", crowd(time.time_ns(), VIRTUAL, virtual=True), run="r")


def _taken(car: ForeignBus, merged: Mailbox, *, clouds: int, within_s: float = 5.0) -> list[float]:
    """Say clouds of a wall all around, 60 m away, and return how many ms each took."""
    lidar = load_sensor("vlp_16").measures(Lidar)
    column, ring = np.divmod(np.arange(lidar.azimuths * 16), 16)
    up = np.radians(np.array(lidar.elevation_deg))[ring]
    at = -2.0 * np.pi * column / lidar.azimuths
    points = np.stack(
        [60.0 * np.cos(up) * np.cos(at), 60.0 * np.cos(up) * np.sin(at), 60.0 * np.sin(up),
         np.full(len(ring), 20.0), ring, column / lidar.azimuths / lidar.rate_hz], axis=1,
    ).astype(np.float32)  # fmt: skip
    taken = []
    for number in range(clouds):
        begun_s = time.monotonic()
        ros = cloud_from(PointCloud(stamp_ns=time.time_ns(), points=points), frame_id="velodyne")
        data = bytes(typestore().serialize_cdr(ros, POINT_CLOUD2))
        put_s = time.perf_counter()
        car.put(f"0/lidar/raw/{_TYPE}/RIHS01_x", data, attached(number))
        if not isinstance(merged.take(within_s), Arrived):
            break
        taken.append(1e3 * (time.perf_counter() - put_s))
        time.sleep(max(0.0, begun_s + PERIOD_S - time.monotonic()))
    return taken
