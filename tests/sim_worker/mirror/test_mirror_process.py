"""The mirror on the bus: others keep their place in time, roles are set by a question."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.drive import ControlCommand, ControlMode
from foretwin.contracts.mailbox import Mailbox, Received, Request
from foretwin.contracts.roles import CastVehicle, MirrorCast, OtherVehicle, OtherVehicles, UseRoles
from foretwin.contracts.setup import BusSetup, WorkerSetup
from foretwin.contracts.simulation import MirrorSample
from foretwin.sim_worker.mirror.process import MirrorWorker
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.places import FRAME, state_at

COVERS = ("foretwin.sim_worker.mirror.process",)

VAN = CastVehicle(vehicle_id="van", vehicle=load_vehicle("vw_vanagon"))
TICK_NS = 100_000_000


class Ground:
    """A mirror on a bus in memory, with what it says."""

    def __init__(
        self, folder: Path, *, lossless: bool, others: bool = True, commands: bool = False
    ) -> None:
        self.bus = MemoryBus()
        setup = WorkerSetup(
            run_id="r",
            process_id="mirror",
            vehicle_id="ego",
            role="mirror",
            bus=BusSetup(endpoint="tcp/127.0.0.1:7447", lossless=lossless),
            log_file=str(folder / "log"),
            worlds_dir=str(folder),
            vehicle=load_vehicle(),
            drive_frame=FRAME,
            mirror_cast=MirrorCast(others=(VAN,) if others else ()),
            commands_recorded=commands,
        )
        self.worker = MirrorWorker(setup, self.bus)
        self._inbox, self._said = Mailbox(256), Mailbox(256)
        self.bus.subscribe("state", self._inbox, vehicle="ego")
        self.bus.subscribe("control", self._inbox, vehicle="ego")
        self.bus.subscribe("other_vehicles", self._inbox, run="r")
        self.bus.serve("use_roles", self._inbox, run="r", process="mirror")
        self.bus.subscribe("mirror", self._said, run="r")

    def own(self, k: int, control_mode: ControlMode = "unknown") -> None:
        state = state_at(0.8 * k, 0.0, stamp_ns=k * TICK_NS)
        state = msgspec.structs.replace(state, control_mode=control_mode)
        self.bus.publish("state", state, vehicle="ego")
        self.settle()

    def others(self, k: int) -> None:
        van = state_at(30.0 + 0.8 * k, 0.0, stamp_ns=k * TICK_NS)
        heard = OtherVehicle(state=msgspec.structs.replace(van, vehicle_id="van"))
        message = OtherVehicles(stamp_ns=k * TICK_NS, heard=(heard,))
        self.bus.publish("other_vehicles", message, run="r")
        self.settle()

    def settle(self) -> None:
        while (item := self._inbox.take()) is not None:
            assert isinstance(item, Received | Request)
            self.worker.handle(item)

    def said(self) -> list[MirrorSample]:
        found = []
        while (item := self._said.take()) is not None:
            found.append(item.message())
        return found


@pytest.mark.parametrize("others_first", [True, False])
def test_in_lock_step_results_do_not_depend_on_who_arrives_first(
    tmp_path: Path, others_first: bool
) -> None:
    """The bus keeps no order between keys: here one key comes ten messages ahead."""
    ground = Ground(tmp_path, lossless=True)
    for start in (0, 10):
        steps = (ground.others, ground.own) if others_first else (ground.own, ground.others)
        for step in steps:
            for k in range(start, start + 10):
                step(k)
    samples = ground.said()
    assert [s.stamp_ns for s in samples] == [k * TICK_NS for k in range(20)]
    for sample in samples:
        (van,) = sample.others
        assert van.real.x_m - sample.real.x_m == pytest.approx(30.0, abs=1e-6)


def test_in_lock_step_no_state_waits_for_commands_while_a_human_drives(tmp_path: Path) -> None:
    ground = Ground(tmp_path, lossless=True, others=False, commands=True)
    for k in range(4):
        ground.own(k, "autonomous")
    assert ground.said() == []
    ground.bus.publish(
        "control", ControlCommand(stamp_ns=3 * TICK_NS, accel_mps2=0.0), vehicle="ego"
    )
    ground.settle()
    assert len(ground.said()) == 4
    for k in range(4, 8):
        ground.own(k, "manual")
    assert len(ground.said()) == 4
    ground.own(8, "autonomous")
    assert ground.said() == []


def test_live_no_state_waits(tmp_path: Path) -> None:
    ground = Ground(tmp_path, lossless=False)
    for k in range(5):
        ground.own(k)
    assert len(ground.said()) == 5


def test_roles_are_set_by_a_question_and_count_from_their_stamp_on(tmp_path: Path) -> None:
    ground = Ground(tmp_path, lossless=True)
    use = UseRoles(stamp_ns=4 * TICK_NS, roles={"van": "twin", "ego": "ghost"}, correction="follow")
    ground.bus.request("use_roles", use, answers := Mailbox(1), run="r", process="mirror")
    ground.settle()
    assert answers.take().message == use
    for k in range(8):
        ground.others(k)
        ground.own(k)
    samples = ground.said()
    assert [s.role for s in samples] == ["all"] * 4 + ["ghost"] * 4
    assert [s.others[0].role for s in samples] == ["shadow"] * 4 + ["twin"] * 4
    assert samples[-1].others[0].correction is not None
