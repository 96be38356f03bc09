"""Who drives, in which gear, and what lights show: as it was said last, also that nobody knows."""

from __future__ import annotations

import pytest

from foretwin.contracts import drive
from foretwin.telemetry.ros_messages.parts import (
    CONTROL_MODE_REPORT,
    GEAR_REPORT,
    TRAFFIC_LIGHTS,
    TURN_INDICATORS_REPORT,
    ros_message,
)
from foretwin.telemetry.ros_messages.status import (
    StatusJoiner,
    StatusPart,
    gear_from_ros,
    indicator_from_ros,
    mode_from_ros,
    signals_from_ros,
)
from tests.telemetry.autoware_messages import ros_from_status

AT = 1_772_359_200_000_000_000
_RED, _AMBER, _GREEN = 1, 2, 3
_OFF, _ON, _FLASHING = 1, 2, 3


def test_a_status_comes_back_from_its_reports() -> None:
    readers = {"ControlMode": mode_from_ros, "Gear": gear_from_ros, "TurnInd": indicator_from_ros}
    cases: tuple[tuple[drive.ControlMode, drive.Gear, drive.Indicator], ...] = (
        ("autonomous", "drive", "left"),
        ("manual", "reverse", "off"),
        ("manual", "park", "right"),
    )
    for mode, gear, indicator in cases:
        status = drive.VehicleStatus(stamp_ns=AT, control_mode=mode, gear=gear, indicator=indicator)
        joiner, joined = StatusJoiner(), None
        for kind, report in ros_from_status(status):
            for name, read in readers.items():
                if name in kind:
                    joined = joiner.join(read(report, AT))
        assert joined == status


@pytest.mark.parametrize(
    ("mode", "means"),
    [
        (0, "unknown"),
        (1, "autonomous"),
        (2, "manual"),
        (4, "manual"),
        (5, "manual"),
        (6, "unknown"),
    ],
)
def test_who_drives(mode: int, means: str) -> None:
    said = mode_from_ros(ros_message(CONTROL_MODE_REPORT, mode=mode), 7)
    assert said == StatusPart(stamp_ns=7, field="control_mode", value=means)


def test_what_nobody_knows_any_more_is_unknown() -> None:
    joiner = StatusJoiner()
    joiner.join(gear_from_ros(ros_message(GEAR_REPORT, report=2), AT))
    modes = [
        joiner.join(mode_from_ros(ros_message(CONTROL_MODE_REPORT, mode=mode), AT))
        for mode in (1, 1, 6, 0, 5)  # 6 is NOT_READY, 0 NO_COMMAND
    ]
    assert [one.control_mode for one in modes] == [
        "autonomous", "autonomous", "unknown", "unknown", "manual",
    ]  # fmt: skip
    assert {one.gear for one in modes} == {"drive"}
    assert joiner.join(gear_from_ros(ros_message(GEAR_REPORT, report=0), AT)).gear == "unknown"
    left = joiner.join(
        indicator_from_ros(ros_message(TURN_INDICATORS_REPORT, report=2), AT),
    )
    assert left == drive.VehicleStatus(
        stamp_ns=AT, control_mode="manual", gear="unknown", indicator="left"
    )


@pytest.mark.parametrize(
    ("elements", "colour"),
    [
        ([(_AMBER, _FLASHING)], "unknown"),
        ([(_RED, _FLASHING)], "unknown"),
        ([(_AMBER, _FLASHING), (_RED, _OFF)], "unknown"),
        ([(_AMBER, _ON), (_RED, _OFF)], "amber"),
        ([(_RED, _ON), (_AMBER, _ON)], "red_amber"),
        ([(_GREEN, _OFF)], "dark"),
    ],
)
def test_what_flashes_does_not_mean_its_colour(
    elements: list[tuple[int, int]], colour: drive.SignalColour
) -> None:
    element, group = "TrafficLightElement", "TrafficLightGroup"
    lamps = [
        ros_message(f"autoware_perception_msgs/msg/{element}", color=color, shape=1, status=status)
        for color, status in elements
    ]
    groups = [
        ros_message(
            f"autoware_perception_msgs/msg/{group}", traffic_light_group_id=7, elements=lamps
        )
    ]
    message = ros_message(TRAFFIC_LIGHTS, traffic_light_groups=groups)
    assert [one.colour for one in signals_from_ros(message, AT)] == [colour]
