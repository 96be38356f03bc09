"""What a vehicle says live, and what of it belongs together, becomes samples."""

from __future__ import annotations

from typing import Any

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.foreign_bus import Arrived
from foretwin.telemetry.ros2.inwards import Inwards
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros_messages.ackermann import NO_ACCELERATION
from foretwin.telemetry.ros_messages.parts import ACKERMANN, VELOCITY_REPORT, typestore
from tests.telemetry.autoware_messages import velocity_report
from tests.telemetry.ros_messages.test_ackermann import asked

COVERS = ("foretwin.telemetry.ros2.inwards",)
S = 10**9
AT = 1_772_359_200 * S


def listening(**kinds: tuple[str, str]) -> Inwards:
    """Listen to topics, each of a type and a channel."""
    rows = [
        f'[[in]]\ntopic = "/{topic}"\ntype = "{kind}"\nchannel = "{channel}"\n'
        for topic, (kind, channel) in kinds.items()
    ]
    return Inwards(parse_mapping('dialect = "ros2dds"\n' + "".join(rows), name="m.toml"))


def heard(inwards: Inwards, topic: str, kind: str, message: Any) -> list[msgspec.Struct]:
    """Return the samples of a message."""
    data = bytes(typestore().serialize_cdr(message, kind))
    return [sample for _, sample in inwards.take(Arrived(topic, data, None, S, AT))]


def test_what_ackermann_asks_for_is_known_by_the_measured_speed() -> None:
    inwards = listening(drive=(ACKERMANN, "control"), speed=(VELOCITY_REPORT, "speed"))
    assert heard(inwards, "drive", ACKERMANN, asked(AT, 7.0, 3.0)) == []
    assert inwards.unused == {f"/drive: {NO_ACCELERATION}": 1}
    said = velocity_report(AT + 1, speed_mps=10.0, yaw_rate_radps=0.0)
    heard(inwards, "speed", VELOCITY_REPORT, said)
    assert heard(inwards, "drive", ACKERMANN, asked(AT + 2, 7.0, 3.0)) == [
        drive.ControlCommand(stamp_ns=AT + 2, accel_mps2=-3.0, tire_angle_rad=0.125)
    ]
