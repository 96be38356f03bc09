"""Lights as Autoware's messages, of today and of autoware_auto."""

from __future__ import annotations

import pytest

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.lights import ShownLight
from foretwin.telemetry.ros_messages.lights import groups_from, signals_from
from foretwin.telemetry.ros_messages.parts import (
    TRAFFIC_LIGHTS,
    TRAFFIC_SIGNALS,
    stamp_ns_of,
    typestore,
)
from foretwin.telemetry.ros_messages.status import signals_from_ros

S = 10**9
COLOURS: tuple[SignalColour, ...] = ("red", "amber", "green", "red_amber", "dark")


@pytest.mark.parametrize("colour", COLOURS)
def test_a_group_array_is_read_as_it_was_meant(colour: SignalColour) -> None:
    light = ShownLight(group_id="g", colour=colour, why="set")
    sent = groups_from((light,), {"g": (7, 9)}, stamp_ns=5 * S)
    ros = typestore().deserialize_cdr(
        typestore().serialize_cdr(sent, TRAFFIC_LIGHTS), TRAFFIC_LIGHTS
    )
    heard = signals_from_ros(ros, 5 * S)
    assert [(one.group_id, one.colour) for one in heard] == [("7", colour), ("9", colour)]
    assert stamp_ns_of(ros.stamp) == 5 * S
    assert not ros.traffic_light_groups[0].predictions
    assert {one.shape for one in ros.traffic_light_groups[0].elements} == {1}


def test_the_next_colour_is_a_prediction_where_it_is_known() -> None:
    light = ShownLight(
        group_id="g", colour="green", why="plan", next_colour="amber", changes_in_s=2.5
    )
    (group,) = groups_from((light,), {"g": (7,)}, stamp_ns=5 * S).traffic_light_groups
    (prediction,) = group.predictions
    assert stamp_ns_of(prediction.predicted_stamp) == 7_500_000_000
    assert [one.color for one in prediction.simultaneous_elements] == [2]
    assert prediction.information_source == "SIMULATION"  # a word of the message's own list


def test_what_is_unknown_or_has_no_number_is_not_told() -> None:
    lights = [
        ShownLight(group_id="g", colour="unknown", why="plan"),
        ShownLight(group_id="other", colour="red", why="plan"),
    ]
    for make in (groups_from, signals_from):
        ros = make(lights, {"g": (7,)}, stamp_ns=S)
        assert not (ros.signals if make is signals_from else ros.traffic_light_groups)


def test_autoware_auto_has_numbers_of_its_own() -> None:
    lights = [
        ShownLight(group_id="g", colour="red_amber", why="plan"),
        ShownLight(group_id="h", colour="dark", why="plan"),
    ]
    sent = signals_from(lights, {"g": (7,), "h": (8,)}, stamp_ns=5 * S)
    ros = typestore().deserialize_cdr(
        typestore().serialize_cdr(sent, TRAFFIC_SIGNALS), TRAFFIC_SIGNALS
    )
    told = [(one.map_primitive_id, [(i.color, i.shape, i.status) for i in one.lights])
            for one in ros.signals]  # fmt: skip
    assert told == [(7, [(1, 5, 16), (2, 5, 16)]), (8, [(0, 5, 15)])]
    assert stamp_ns_of(ros.header.stamp) == 5 * S
