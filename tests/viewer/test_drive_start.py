"""When a drive began: told by the setup, by the vehicle, or by the first stamp of all."""

from __future__ import annotations

from typing import Any, cast

import pytest

from foretwin.contracts.bus import Bus
from foretwin.contracts.drive import VehicleInfo
from foretwin.viewer import drive_start
from foretwin.viewer.drive_start import start_of_drive

BUS = cast(Bus, None)


def test_the_vehicle_says_when_its_drive_began_where_the_setup_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    info = VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=0, sends=())
    monkeypatch.setattr(drive_start, "ask", lambda *_, **__: info)

    assert start_of_drive(BUS, "car", told_ns=7, first_stamp_ns=30) == 7
    assert start_of_drive(BUS, "car", told_ns=0, first_stamp_ns=30) == 0, "a log from zero"


def test_without_an_answer_it_began_with_the_first_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(*_: Any, **__: Any) -> None:
        raise TimeoutError("nobody")

    monkeypatch.setattr(drive_start, "ask", silent)

    assert start_of_drive(BUS, "car", told_ns=0, first_stamp_ns=30) == 30
