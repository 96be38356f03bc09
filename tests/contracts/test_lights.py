"""What is told of lights: who stops for which colour, and for whose word."""

from __future__ import annotations

import pytest

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.lights import ShownLight, WhyShown


@pytest.mark.parametrize("colour", ["red", "red_amber", "amber"])
def test_a_light_that_is_not_green_stops_cars(colour: SignalColour) -> None:
    assert ShownLight(group_id="g", colour=colour, why="set").stops_cars


@pytest.mark.parametrize("colour", ["green", "dark", "unknown"])
def test_one_that_is_green_or_out_stops_nobody(colour: SignalColour) -> None:
    assert not ShownLight(group_id="g", colour=colour, why="set").stops_cars


def test_a_plan_that_is_a_guess_binds_no_car() -> None:
    told: dict[WhyShown, bool] = {"plan": False, "learnt": True, "heard": True, "set": True}
    for why, binds in told.items():
        assert ShownLight(group_id="g", colour="red", why=why).binds_car == binds
