"""What the stand-in's process hears: others in the World, whom it sees on its own lot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.drive import OthersAround, RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint, local_pose
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.setup import BusSetup, StandinSetup
from foretwin.telemetry.processes.vehicle_process import VehicleProcess
from foretwin.telemetry.standin.__main__ import serve
from foretwin.telemetry.standin.source import StandinSource
from tests.contracts.memory_bus import MemoryBus
from tests.contracts.test_anchor import LOT, WORLD

COVERS = ("foretwin.telemetry.standin.__main__",)
ANCHOR = Anchor(lot=LOT, world=WORLD)


@pytest.mark.parametrize("beside", [True, False])
def test_it_sees_others_where_they_are_on_its_lot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, beside: bool
) -> None:
    at = WORLD
    path = {
        "lat_deg": [at.lat_deg, at.lat_deg + 0.001],
        "lon_deg": [at.lon_deg, at.lon_deg],
        "speed_mps": [8.0, 8.0],
    }
    file = tmp_path / "path.json"
    file.write_text(json.dumps(path), encoding="utf-8")
    setup = StandinSetup(
        run_id="r", process_id="vehicle", vehicle_id="second", bus=BusSetup(endpoint=""),
        log_file="", path_file=str(file), anchor=ANCHOR, beside=beside,
    )  # fmt: skip
    bus, seen = MemoryBus(), []
    user = RoadUser(
        user_id="ego", kind="car", position=GeoPoint(at.lat_deg, at.lon_deg), yaw_rad=at.yaw_rad,
        speed_mps=3.0, length_m=4.5, width_m=1.6, virtual=True,
    )  # fmt: skip

    def one_step(process: VehicleProcess) -> None:
        told = OthersAround(users=RoadUsers(stamp_ns=7, users=(user,)), known_for_s=(0.3,))
        bus.publish("surroundings", told, vehicle="second")
        process.step()

    def see(_: StandinSource, users: Any, **when: Any) -> None:
        seen.append((users, when))

    monkeypatch.setattr(VehicleProcess, "serve", one_step)
    monkeypatch.setattr(StandinSource, "see", see)
    serve(setup, bus, ProcessLife(setup, bus))
    (((there,), when),) = seen
    assert local_pose(LOT.frame, there.position, there.yaw_rad) == pytest.approx(
        (0.0, 0.0, LOT.yaw_rad), abs=1e-6
    )
    assert when == {"stamp_ns": 7, "known_for_s": (0.3,)}
    # What lights show is stamped by the clock of the drive's own car.
    assert bool(bus.mailboxes("lights")) != beside
