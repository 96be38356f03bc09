"""What the gateway makes of a vehicle's units, signs and axes, and that it counts each sample."""

from __future__ import annotations

import math

import pytest

from foretwin.contracts.drive import ControlCommand, ImuSample, SpeedSample, SteeringSample
from foretwin.contracts.foreign_bus import Arrived
from foretwin.telemetry.ros2.declared_units import in_our_units
from foretwin.telemetry.ros2.mapping import InRow
from tests.telemetry.ros2.gateway_ground import FIX_KEY, fix
from tests.telemetry.ros2.test_gateway import Ground

COVERS = ("foretwin.telemetry.ros2.declared_units", "foretwin.telemetry.ros2.inwards")
S = 10**9
CLOCK_OF_OTHERS = """
[[out]]
topic = "/foretwin/clock"
type = "rosgraph_msgs/msg/Clock"
source = "clock"
"""


def row(channel: str, **said: object) -> InRow:
    return InRow(topic="/a", type="a/msg/B", channel=channel, **said)  # type: ignore[arg-type]


def test_axes_that_point_forward_right_and_down_are_turned_about_the_first() -> None:
    sample = ImuSample(stamp_ns=1, accel_mps2=(1.0, 2.0, 3.0), rate_radps=(0.1, 0.2, 0.3))
    assert in_our_units(sample, row("imu")) == sample
    turned = in_our_units(sample, row("imu", axes="forward_right_down"))
    assert turned == ImuSample(
        stamp_ns=1, accel_mps2=(1.0, -2.0, -3.0), rate_radps=(0.1, -0.2, -0.3)
    )


@pytest.mark.parametrize(
    ("said", "angle_rad"),
    [
        ({}, 0.2), ({"left_positive": False}, -0.2), ({"angle_unit": "deg"}, math.radians(0.2)),
        ({"angle_unit": "deg", "left_positive": False}, -math.radians(0.2)),
    ],
)  # fmt: skip
def test_angles_become_radians_to_the_left(said: dict[str, object], angle_rad: float) -> None:
    sample = SteeringSample(stamp_ns=1, tire_angle_rad=0.2)
    found = in_our_units(sample, row("steering", **said))
    assert found.tire_angle_rad == pytest.approx(angle_rad)  # type: ignore[attr-defined]


def test_who_measures_no_angle_has_none_in_any_unit() -> None:
    sample = ControlCommand(stamp_ns=1, tire_angle_rad=None, accel_mps2=1.0)
    assert in_our_units(sample, row("control", angle_unit="deg")) is sample


def test_an_attachment_that_is_none_is_counted_and_its_sample_is_taken() -> None:
    ground = Ground(enabled=False, flag=False)
    inbox = next(iter(ground.foreign.inboxes.values()))
    inbox.put(Arrived(FIX_KEY, fix(5 * S, 52.6, 13.5), b"short", ground.now_ns, 10**18))
    ground.step()
    inwards = ground.gateway.inwards
    assert inwards.unused == {"/sensing/gnss: attachment not understood": 1}
    assert (inwards.counts, inwards.lost) == ({"gnss": 1}, {})


def test_speeds_become_metres_a_second() -> None:
    sample = SpeedSample(stamp_ns=1, speed_mps=36.0)
    assert in_our_units(sample, row("speed", speed_unit="km/h")).speed_mps == pytest.approx(10.0)  # type: ignore[attr-defined]


def test_each_sample_counts_once() -> None:
    ground = Ground(enabled=False, flag=False)
    for number in range(3):
        ground.arrive(FIX_KEY, fix(5 * S + number, 52.6, 13.5), number)
    assert ground.gateway.inwards.counts == {"gnss": 3}
    assert ground.gateway.inwards.first_stamp_ns == 5 * S


def test_where_nothing_may_go_to_the_vehicle_others_hear_of_it_all_the_same() -> None:
    """Two topics of one source, the first towards the vehicle."""
    ground = Ground(enabled=False, flag=False, more=CLOCK_OF_OTHERS)
    for _ in range(3):
        ground.say_everything()
        ground.step(100.0)
    assert ground.towards()["/clock"] == 0
    assert ground.gateway.report()["held"]["/clock"] == 3
    assert ground.foreign.on("/foretwin/clock")


@pytest.mark.parametrize(("dialect", "attached"), [("rmw_zenoh", True), ("ros2dds", False)])
def test_a_bridge_needs_neither_tokens_nor_attachments(dialect: str, attached: bool) -> None:
    ground = Ground(enabled=True, flag=True, dialect=dialect)
    ground.say_everything()
    ground.step(1100.0)
    assert bool(ground.foreign.tokens) is attached
    assert ground.foreign.attachments
    assert all((one is not None) is attached for one in ground.foreign.attachments)
