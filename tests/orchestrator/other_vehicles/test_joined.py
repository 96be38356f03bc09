"""One at a time speaks for a live vehicle, and who may not is told why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from foretwin.contracts.roles import JoinReply, JoinRequest
from foretwin.orchestrator.config import OtherVehicleConfig
from foretwin.orchestrator.other_vehicles.joined import SEAT_S, JoinedVehicles
from foretwin.orchestrator.other_vehicles.live import LiveVehicle
from foretwin.orchestrator.plan import OtherVehiclePlan
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.trip import town_plan

VAN = load_vehicle("vw_vanagon")


class Door:
    """A drive in which `van` and a small car have seats, and `bus` one behind a gateway."""

    def __init__(self, folder: Path) -> None:
        configs = (
            OtherVehicleConfig(id="van", live=True),
            OtherVehicleConfig(id="small", live=True),
            OtherVehicleConfig(id="far", log="far.mcap"),
        )
        scales = {"small": 10.0}
        beside = tuple(
            OtherVehiclePlan(one, VAN, commands_recorded=False, scale=scales.get(one.id, 1.0))
            for one in configs
        )
        self.told: list[str] = []
        self.now_s = 100.0
        self.source = LiveVehicle(
            "van", VAN, ask_info=lambda _: None, tell=lambda _: None, own_clock=lambda: None
        )
        plan = replace(town_plan(folder), beside=beside)
        self._joined = JoinedVehicles(plan, lambda notice: self.told.append(notice.text))

    def ask(
        self,
        instance: str = "a",
        *,
        name: str = "van",
        scale: float = 1.0,
        leaves: bool = False,
        drives: bool = True,
    ) -> JoinReply:
        asked = JoinRequest(instance=instance, scale=scale, leaves=leaves)
        source = self.source if drives else None
        return self._joined.answer(name, asked, source, now_s=self.now_s)


@pytest.fixture
def door(tmp_path: Path) -> Door:
    return Door(tmp_path)


def test_it_joins_goes_on_and_leaves(door: Door) -> None:
    assert door.ask().drive_frame is not None
    door.now_s += SEAT_S - 0.1
    reply = door.ask()
    assert (reply.refused, reply.clock) == ("", "")
    assert reply.trouble == "nothing was heard of van"
    assert door.ask(leaves=True) == JoinReply()
    assert door.ask(leaves=True) == JoinReply()
    assert door.told == ["van joins", "van has left"]


def test_a_second_one_waits_until_the_first_has_left_or_fallen_silent(door: Door) -> None:
    door.ask("a")
    assert door.ask("b").refused == "van has joined already, from somewhere else"
    door.ask("a", leaves=True)
    assert not door.ask("b").refused
    door.now_s += SEAT_S + 0.1
    assert not door.ask("b").refused, "nobody else has come"
    assert door.told == ["van joins", "van has left", "van joins"]
    door.now_s += SEAT_S + 0.1
    assert not door.ask("c").refused
    assert door.ask("b").refused


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("ego", "ego is the drive's own car: seats are those of"),
        ("far", "far has no seat here: seats are those of [[vehicles]] with live = true and "
         "without ros2: small, van"),
    ],
)  # fmt: skip
def test_who_has_no_seat_is_told_which_there_are(door: Door, name: str, text: str) -> None:
    assert text in door.ask(name=name).refused


def test_an_anchor_of_another_scale_is_refused(door: Door) -> None:
    assert "van is a vehicle of scale 1 in this drive" in door.ask(scale=10.0).refused
    assert "its anchor says scale = 1" in door.ask(name="small").refused


def test_before_the_car_drives_nobody_can_tell_a_clock(door: Door) -> None:
    reply = door.ask(drives=False)
    assert (reply.trouble, reply.drive_frame) == (
        "ego was not heard yet: it has to drive first",
        None,
    )
    assert door.told == []
