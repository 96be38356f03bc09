"""A whole live drive of a car that speaks ROS 2, and its orchestrator killed."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.foreign_bus import ZenohForeignBus
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.telemetry.ros2.mapping import AUTOWARE
from tests.starvation import kept_waiting
from tests.system.foretwin_command import (
    log_lines,
    orchestrator_pid,
    run_folder,
    started,
    wait_for,
)
from tests.system.ros2_car import Ros2Car

CLOCK_ROW = '\n[[out]]\ntopic = "/clock"\ntype = "rosgraph_msgs/msg/Clock"\nsource = "clock"\n'
FLAGS = ("--source", "live", "--futures", "8", "--workers", "1")


def mapping(folder: Path, *, endpoint: str, enabled: bool) -> Path:
    """Autoware's mapping, with a topic towards the vehicle that a live drive has something for."""
    head = f'endpoint = "{endpoint}"\n'
    text = head + AUTOWARE.read_text(encoding="utf-8") + CLOCK_ROW
    file = folder / "mapping.toml"
    file.write_text(text.replace("enabled = false", "enabled = true") if enabled else text)
    return file


@pytest.mark.judge
@pytest.mark.timeout(180)
def test_a_killed_orchestrator_sends_nothing_towards_the_vehicle_after_200_ms(
    tmp_path: Path,
) -> None:
    endpoint = free_endpoint()
    file = mapping(tmp_path, endpoint=endpoint, enabled=True)
    with (
        ZenohBus(BusSetup(endpoint=endpoint), router=True),
        ZenohForeignBus(BusSetup(endpoint=endpoint)) as peer,
    ):
        car = Ros2Car(peer, listens_to=("clock",))
        flags = (*FLAGS, "--ros2", str(file), "--towards-vehicle")
        with started(tmp_path / "runs", *flags) as process:
            for _ in range(20):
                assert car.drive_until(deadline_s=60.0) is not None, "nothing towards the vehicle"
            run = run_folder(tmp_path / "runs")
            assert run is not None
            with kept_waiting(process.pid) as kept:
                killed_ns = time.monotonic_ns()
                os.kill(orchestrator_pid(run), signal.SIGKILL)
                last_ns = killed_ns
                while (heard := car.drive_until(deadline_s=1.0)) is not None:
                    last_ns = heard.received_mono_ns
                # The next one goes on with the drive, and says nothing towards the vehicle.
                stays = "nothing goes towards the vehicle any more"
                wait_for(lambda: any(stays in one["text"] for one in log_lines(run)), stays)
                assert car.drive_until(deadline_s=2.0) is None
            after_ms = (last_ns - killed_ns) / 1e6
            print(f"last message {after_ms:.1f} ms after SIGKILL")
            assert after_ms < 200.0 + 1e3 * kept.seconds


@pytest.mark.judge
@pytest.mark.timeout(180)
@pytest.mark.parametrize(("enabled", "flag"), [(True, ()), (False, ("--towards-vehicle",))])
def test_one_switch_sends_the_twin_and_nothing_towards_the_vehicle(
    tmp_path: Path, enabled: bool, flag: tuple[str, ...]
) -> None:
    endpoint = free_endpoint()
    file = mapping(tmp_path, endpoint=endpoint, enabled=enabled)
    with (
        ZenohBus(BusSetup(endpoint=endpoint), router=True),
        ZenohForeignBus(BusSetup(endpoint=endpoint)) as peer,
    ):
        car = Ros2Car(peer, listens_to=("foretwin/**", "clock", "control/**", "perception/**"))
        keys: list[str] = []
        with started(tmp_path / "runs", *FLAGS, "--ros2", str(file), *flag):
            until_s = time.monotonic() + 60.0
            while keys.count("foretwin/twin/odometry") < 50 and time.monotonic() < until_s:
                heard = car.drive_until(deadline_s=60.0)
                assert heard is not None
                keys.append(heard.key)
    assert keys.count("foretwin/twin/odometry") >= 50
    assert {key.split("/")[0] for key in keys} == {"foretwin"}
