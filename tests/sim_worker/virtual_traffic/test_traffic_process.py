"""Virtual traffic on the bus: states in, road users out, what is wrong refused."""

from __future__ import annotations

from pathlib import Path

import msgspec

from foretwin.contracts.codec import write_message
from foretwin.contracts.drive import RoadUsers
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.mailbox import Mailbox, Received, Reply, Request
from foretwin.contracts.setup import BusSetup, TrafficSetup
from foretwin.contracts.virtual_traffic import TrafficCourse, VirtualTraffic
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.process import TrafficWorker
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.places import crossroads, state_at, straight_path

COVERS = ("foretwin.sim_worker.virtual_traffic.process",)


class Ground:
    """Virtual traffic on a bus in memory."""

    def __init__(self, folder: Path) -> None:
        self.bus = MemoryBus()
        write_message(crossroads(), folder / "crossroads.world")
        setup = TrafficSetup(
            run_id="r",
            process_id="traffic",
            vehicle_id="ego",
            bus=BusSetup(endpoint="tcp/127.0.0.1:7447", lossless=True),
            log_file=str(folder / "log"),
            worlds_dir=str(folder),
            vehicle=load_vehicle(),
            traffic=VirtualTraffic(source="model", count=5),
            seed=1,
        )
        self.worker = TrafficWorker(setup, self.bus)
        self.inbox, self.said, self.answers = Mailbox(256), Mailbox(256), Mailbox(8)
        self.bus.subscribe("state", self.inbox, vehicle="ego")
        self.bus.subscribe("lights", self.inbox, run="r")
        self.bus.serve("use_course", self.inbox, run="r", process="traffic")
        self.bus.subscribe("virtual_traffic", self.said, run="r")

    def ask(self, world_id: str) -> Reply:
        told = TrafficCourse(stamp_ns=0, start_stamp_ns=0, world_id=world_id, path=straight_path())
        self.bus.request("use_course", told, self.answers, run="r", process="traffic")
        self.settle()
        reply = self.answers.take()
        assert isinstance(reply, Reply)
        return reply

    def settle(self) -> None:
        while (item := self.inbox.take()) is not None:
            assert isinstance(item, Received | Request)
            self.worker.handle(item)

    def drive(self, states: int) -> list[RoadUsers]:
        for k in range(states):
            state = state_at(-60.0 + 0.2 * k, -1.5, stamp_ns=k * 20_000_000)
            self.bus.publish("state", state, vehicle="ego")
        self.settle()
        found = []
        while (item := self.said.take()) is not None:
            found.append(item.message())
        return found


def test_road_users_go_out_once_it_is_told_a_world(tmp_path: Path) -> None:
    ground = Ground(tmp_path)
    assert ground.drive(3) == []
    assert isinstance(ground.ask("crossroads").message, TrafficCourse)
    said = ground.drive(51)
    assert len(said) == 21
    assert {len(users.users) for users in said} == {5}


def test_a_world_that_is_not_there_is_refused_and_the_rest_goes_on(tmp_path: Path) -> None:
    ground = Ground(tmp_path)
    assert ground.ask("nowhere").message is None
    ground.ask("crossroads")
    odd = msgspec.structs.replace(state_at(0.0, 0.0, stamp_ns=10), yaw_rad=float("nan"))
    ground.bus.publish("state", odd, vehicle="ego")
    ground.bus.publish("lights", ShownLights(stamp_ns=0, world_id=None), run="r")
    ground.settle()
    assert len(ground.drive(6)) == 3
