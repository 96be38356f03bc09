"""The process of sensors on a bus: states, Worlds and road users in, clouds out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.codec import write_message
from foretwin.contracts.point_cloud import PointCloud
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.sensor_turns import SensorTurns
from foretwin.contracts.setup import BusSetup, SensorSetup, SensorsSetup
from foretwin.contracts.simulation import ActiveWorld, RunEnd
from foretwin.sim_worker.sensors.offscreen import DrawingError
from foretwin.sim_worker.sensors.process import SensorsProcess, serve
from foretwin.sim_worker.sensors.sensor_file import sensor_text
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.places import box, crossroads, state_at
from tests.sim_worker.sensors.test_virtual_sensors import users

RUN, CAR = {"run": "r1"}, {"vehicle": "car"}
WORLD = crossroads(buildings=(box(20.0, 0.0, 2.0, 30.0),))


def setup_in(folder: Path) -> SensorsSetup:
    text, name = sensor_text("vlp_16")
    return SensorsSetup(
        run_id="r1", process_id="sensors", vehicle_id="car", bus=BusSetup(endpoint="tcp/x:1"),
        log_file=str(folder / "log.jsonl"), worlds_dir=str(folder), turns_dir=str(folder),
        sensors=tuple(SensorSetup(text=text, name=name, sees=sees) for sees in ("world", "users")),
    )  # fmt: skip


def test_clouds_come_of_the_world_in_force_and_of_both_who_say_road_users(tmp_path: Path) -> None:
    bus, heard = MemoryBus(), Mailbox(16)
    process = SensorsProcess(setup_in(tmp_path), bus)
    bus.subscribe("point_cloud", heard, **RUN)
    write_message(WORLD, tmp_path / f"{WORLD.id}.world")
    bus.publish("active_world", ActiveWorld(stamp_ns=0, world_id=WORLD.id), **RUN)
    bus.publish("virtual_traffic", users(0, "ahead"), **RUN)
    bus.publish("virtual_objects", users(0, "behind", x=-10.0), **RUN)
    for stamp_ns in (0, 100_000_000):
        bus.publish("state", state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ns), **CAR)
        process.step(0.0)
    clouds = [item.message() for item in iter(heard.take, None)]

    assert all(isinstance(cloud, PointCloud) for cloud in clouds)
    assert process.turns == {"vlp_16": SensorTurns(told=len(clouds))}
    whole, alone = (cloud.points for cloud in clouds)
    assert len(whole) > 5000 > len(alone) > 200
    assert 6.9 < np.abs(alone[:, 0]).min() < 7.2
    assert (alone[:, 0] > 0.0).any()
    assert (alone[:, 0] < 0.0).any()


def test_a_world_that_is_not_there_ends_nothing(tmp_path: Path) -> None:
    bus, heard = MemoryBus(), Mailbox(16)
    process = SensorsProcess(setup_in(tmp_path), bus)
    bus.subscribe("point_cloud", heard, **RUN)
    bus.publish("active_world", ActiveWorld(stamp_ns=0, world_id="nowhere"), **RUN)
    for stamp_ns in (0, 100_000_000):
        bus.publish("state", state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ns), **CAR)
        process.step(0.0)

    assert len(heard) == 1, "of the sensor that sees road users alone"


def test_it_leaves_when_the_run_ends(tmp_path: Path) -> None:
    bus, setup = MemoryBus(), setup_in(tmp_path)
    life = ProcessLife(setup, bus)
    bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)
    serve(setup, bus, life)

    assert life.over
    assert (tmp_path / "sensors.turns").exists()


def test_what_a_radar_lists_goes_out_on_a_channel_of_its_own(tmp_path: Path) -> None:
    bus, heard = MemoryBus(), Mailbox(16)
    text, name = sensor_text("short_range_radar")
    one = SensorSetup(text=text, name=name, sees="users")
    process = SensorsProcess(replace(setup_in(tmp_path), sensors=(one,)), bus)
    bus.subscribe("radar_list", heard, **RUN)
    bus.publish("virtual_traffic", users(0, "ahead"), **RUN)
    for stamp_ns in (0, 50_000_000):
        bus.publish("state", state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ns), **CAR)
        process.step(0.0)
    (item,) = iter(heard.take, None)

    assert item.message().sensor == "short_range_radar"
    assert item.message().returns[0, 0] == pytest.approx(10.0 - 3.0 - 3.5, abs=0.4)
    assert process.turns == {"short_range_radar": SensorTurns(told=1)}


@pytest.mark.parametrize("lossless", [True, False])
def test_in_lock_step_no_turn_is_passed_over_however_states_come(
    tmp_path: Path, lossless: bool
) -> None:
    """Those of a round come at once, while who measures looks once in a while."""
    bus, heard = MemoryBus(), Mailbox(64)
    text, name = sensor_text("short_range_radar")
    setup = replace(
        setup_in(tmp_path),
        sensors=(SensorSetup(text=text, name=name, sees="users"),),
        bus=BusSetup(endpoint="tcp/x:1", lossless=lossless),
    )
    process = SensorsProcess(setup, bus)
    bus.subscribe("radar_list", heard, **RUN)
    for stamp_ms in range(0, 621, 20):
        bus.publish("state", state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ms * 1_000_000), **CAR)
    process.step(0.0)
    stamps_ms = [item.message().stamp_ns // 1_000_000 for item in iter(heard.take, None)]

    assert stamps_ms == (list(range(0, 551, 50)) if lossless else [550])
    passed_over = 0 if lossless else 11
    assert process.turns["short_range_radar"] == SensorTurns(
        told=len(stamps_ms), passed_over=passed_over
    )


class BrokenDriver:
    """A camera's, which draws one picture and no more."""

    def __init__(self, *_: object) -> None:
        self._drawn = 0

    def picture(self, *_: object) -> np.ndarray:
        self._drawn += 1
        if self._drawn > 1:
            raise DrawingError("the driver is gone")
        return np.zeros((480, 640, 3), np.uint8)

    def close(self) -> None: ...


def test_a_camera_that_cannot_be_drawn_any_more_is_told_of_once_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("foretwin.sim_worker.sensors.virtual_sensors.CameraWorld", BrokenDriver)
    bus, pictures, lists = MemoryBus(), Mailbox(64), Mailbox(64)
    files = [sensor_text(name) for name in ("vga_camera", "short_range_radar")]
    mine = tuple(SensorSetup(text=text, name=name, sees="users") for text, name in files)
    process = SensorsProcess(replace(setup_in(tmp_path), sensors=mine), bus)
    bus.subscribe("camera_image", pictures, **RUN)
    bus.subscribe("radar_list", lists, **RUN)
    for stamp_ms in range(0, 501, 50):
        stamp_ns = stamp_ms * 1_000_000
        bus.publish("state", state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ns), **CAR)
        process.step(0.0)

    assert (len(pictures), len(lists)) == (1, 10)
    assert process.turns["vga_camera"] == SensorTurns(told=1, passed_over=4)
    (line,) = caplog.messages
    assert line == "sensor vga_camera gives nothing any more, the others go on: the driver is gone"


def test_turns_that_came_while_it_was_away_are_counted(tmp_path: Path) -> None:
    bus = MemoryBus()
    text, name = sensor_text("short_range_radar")
    one = SensorSetup(text=text, name=name, sees="users")
    process = SensorsProcess(replace(setup_in(tmp_path), sensors=(one,)), bus)
    for stamp_ms in range(0, 5000, 20):
        bus.publish("state", state_at(0.0, 0.0, speed=0.0, stamp_ns=stamp_ms * 1_000_000), **CAR)
        if stamp_ms < 200:
            process.step(0.0)
    process.step(0.0)
    turns = process.turns["short_range_radar"]
    assert turns.told + turns.passed_over == pytest.approx(4980 // 50, abs=1)
