"""Two live vehicles beside a live car: one speaks ROS 2 behind a bridge, one our own keys."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.drive import GnssFix, SpeedSample
from foretwin.contracts.foreign_bus import Arrived, ZenohForeignBus
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.telemetry.ros2.mapping import AUTOWARE
from foretwin.telemetry.ros_messages.parts import PREDICTED_OBJECTS, typestore
from tests.system.foretwin_command import run_folder, started, wait_for
from tests.system.ros2_car import SPEED_MPS, Ros2Car

CONFIG = """
endpoint = "{run}"
[[vehicles]]
id = "second"
role = "shadow"
live = true
ros2 = "{second}"
[[vehicles]]
id = "third"
role = "ghost"
live = true
"""
MIRRORED = '\n[mirrored]\nvehicles = ["second", "third"]\n'
SECOND_AHEAD_M, THIRD_AHEAD_M = 25.0, 50.0
FLAGS = (
    "--source", "live", "--futures", "8", "--workers", "1", "--rate", "0.5", "--insecure",
)  # fmt: skip


class NativeCar:
    """Publishes position and speed on our own keys, ten times a second."""

    def __init__(self, bus: ZenohBus, like: Ros2Car) -> None:
        self._bus, self._like = bus, like
        self._due_s = time.monotonic()

    def go_on(self) -> None:
        if time.monotonic() < self._due_s:
            return
        self._due_s += 0.1
        now_ns = time.time_ns()
        fix = GnssFix(stamp_ns=now_ns, position=self._like.place(), std_m=0.1)
        self._bus.publish("gnss", fix, vehicle="third")
        speed = SpeedSample(stamp_ns=now_ns, speed_mps=SPEED_MPS)
        self._bus.publish("speed", speed, vehicle="third")


def objects_of(item: Arrived) -> int:
    return len(typestore().deserialize_cdr(item.payload, PREDICTED_OBJECTS).objects)


@pytest.mark.judge
@pytest.mark.timeout(240)
def test_two_live_vehicles_are_mirrored_where_they_drive(tmp_path: Path) -> None:
    car_side, run = free_endpoint(), free_endpoint()
    autoware = f'endpoint = "{car_side}"\n' + AUTOWARE.read_text(encoding="utf-8")
    own, second = tmp_path / "own.toml", tmp_path / "second.toml"
    own.write_text(autoware + MIRRORED)
    second.write_text(autoware.replace('namespace = "/"', 'namespace = "/second"'))
    config = tmp_path / "drive.toml"
    config.write_text(CONFIG.format(run=run, second=second))
    out = tmp_path / "runs"
    with (
        ZenohBus(BusSetup(endpoint=car_side), router=True),
        ZenohForeignBus(BusSetup(endpoint=car_side)) as peer,
    ):
        heard: set[str] = set()
        with started(out, *FLAGS, "--ros2", str(own), "--config", str(config)) as process:
            wait_for(lambda: bool(list(out.glob("*/run.json"))), "the run's record")
            car = Ros2Car(peer, listens_to=("foretwin/**", "second/foretwin/**"))
            beside = Ros2Car(peer, namespace="second/", ahead_m=SECOND_AHEAD_M)
            far = Ros2Car(peer, ahead_m=THIRD_AHEAD_M)
            with ZenohBus(BusSetup(endpoint=run)) as bus:
                drives = (beside.go_on, NativeCar(bus, far).go_on)
                deadline_s = time.monotonic() + 120.0
                seen = 0
                while seen < 60:
                    assert time.monotonic() < deadline_s, "the second vehicle never went out"
                    item = car.drive_until(deadline_s=60.0, beside=drives)
                    assert item is not None
                    heard.add(item.key)
                    if item.key == "foretwin/virtual_objects":
                        seen += objects_of(item) == 1
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60.0)
    # Nothing goes out by the mapping of the vehicle beside, and the third is a ghost.
    assert {key.split("/")[0] for key in heard} == {"foretwin"}
    folder = run_folder(out)
    assert folder is not None
    rows = pq.read_table(folder / "results" / "mirrored.parquet").to_pylist()
    own_rows = pq.read_table(folder / "results" / "mirror.parquet").to_pylist()
    own_at = {row["stamp_ns"]: (row["real_x_m"], row["real_y_m"]) for row in own_rows}
    for name, role, ahead_m in (
        ("second", "shadow", SECOND_AHEAD_M), ("third", "ghost", THIRD_AHEAD_M),
    ):  # fmt: skip
        mine = [row for row in rows if row["vehicle_id"] == name]
        assert {row["role"] for row in mine} == {role}
        apart_m = [
            np.hypot(row["real_x_m"] - own_at[row["stamp_ns"]][0],
                     row["real_y_m"] - own_at[row["stamp_ns"]][1])
            for row in mine
        ]  # fmt: skip
        assert np.median(apart_m) == pytest.approx(ahead_m, abs=4.0)
