"""Encounters in a drive: touches told as they begin, all kept in the table and counted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.contracts.roles import OtherVehicle, Role
from foretwin.orchestrator.config import OtherVehicleConfig
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.other_vehicles.encounter_handler import EncounterHandler
from foretwin.orchestrator.plan import OtherVehiclePlan
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.trip import town_plan

VAN = load_vehicle("vw_vanagon")
FRAME = LocalFrame(GeoPoint(52.5, 13.4))


class Tables:
    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def add(self, table: str, rows: list[dict[str, Any]]) -> None:
        assert table == "encounters"
        self.rows += rows


def state(name: str, at_s: float, x_m: float, y_m: float, yaw_rad: float) -> VehicleState:
    there = geo_pose(FRAME, x_m, y_m, yaw_rad)
    return VehicleState(
        vehicle_id=name, stamp_ns=round(at_s * 1e9), position=there.position,
        yaw_rad=there.yaw_rad, speed_mps=10.0, yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip


class Crossing:
    """The car drives east, the van north, both through the origin; the van `later_s` later."""

    def __init__(self, folder: Path) -> None:
        self.tables, self.told = Tables(), list[Notice]()
        member = OtherVehiclePlan(OtherVehicleConfig(id="van", live=True), VAN, False)
        plan = replace(town_plan(folder), beside=(member,), drive_frame=FRAME)
        self.handler = EncounterHandler(plan, self.tables, self.told.append)  # type: ignore[arg-type]

    def drive(self, *, begins_s: float, later_s: float, role: Role = "shadow") -> None:
        for t_s in np.arange(-4.0, 4.0, 0.05):
            at_s = begins_s + 4.0 + float(t_s)
            own = state("ego", at_s, 10.0 * float(t_s), 0.0, 0.0)
            van = state("van", at_s, 0.0, 10.0 * (float(t_s) - later_s), np.pi / 2)
            heard = OtherVehicle(state=van, clock_std_s=0.01)
            self.handler.keep_up_with(own, [heard], {"ego": "all", "van": role})


def test_a_touch_is_told_as_it_happens_and_counted_once_it_is_over(tmp_path: Path) -> None:
    crossing = Crossing(tmp_path)
    crossing.drive(begins_s=10.0, later_s=0.0)
    (told,) = crossing.told
    assert (told.level, told.text[:32]) == ("warning", "ego and van touch in the World, ")
    (row,) = crossing.tables.rows
    assert (row["one"], row["other"], row["touched"], row["least_m"]) == ("ego", "van", True, 0.0)
    assert crossing.handler.count.record()["touched"] == 1


def test_who_passes_near_is_told_with_the_distance_and_how_sure_it_is(tmp_path: Path) -> None:
    crossing = Crossing(tmp_path)
    crossing.drive(begins_s=10.0, later_s=0.0)
    crossing.drive(begins_s=30.0, later_s=1.0)
    assert crossing.told[-1].level == "info"
    assert crossing.told[-1].text.startswith("ego and van met in the World: ")
    assert "± 0.10 m" in crossing.told[-1].text
    record = crossing.handler.count.record()
    assert (record["met"], record["touched"]) == (2, 1)
    assert record["nearest"]["least_m"] == 0.0
    assert [row["touched"] for row in crossing.tables.rows] == [True, False]


def test_ghosts_meet_nobody_and_a_car_alone_meets_nobody(tmp_path: Path) -> None:
    crossing = Crossing(tmp_path)
    crossing.drive(begins_s=10.0, later_s=0.0, role="ghost")
    crossing.handler.finish()
    assert crossing.tables.rows == []
    assert crossing.handler.count.record() == {"met": 0, "touched": 0, "nearest": None}


def test_after_a_step_back_of_the_cars_clock_all_begins_anew(tmp_path: Path) -> None:
    crossing = Crossing(tmp_path)
    crossing.drive(begins_s=100.0, later_s=0.0)
    crossing.drive(begins_s=10.0, later_s=0.0)
    assert crossing.handler.count.met == 2


def test_what_goes_on_at_the_end_counts(tmp_path: Path) -> None:
    crossing = Crossing(tmp_path)
    for at_s in (1.0, 1.1, 1.2):
        van = state("van", at_s, 9.0, 0.0, 0.0)
        crossing.handler.keep_up_with(
            state("ego", at_s, 0.0, 0.0, 0.0), [OtherVehicle(state=van)], {"van": "shadow"}
        )
    assert not crossing.tables.rows
    crossing.handler.finish()
    (row,) = crossing.tables.rows
    assert 3.0 < row["least_m"] < 6.0
    assert msgspec.to_builtins(crossing.handler.count.nearest)["one"] == "ego"
