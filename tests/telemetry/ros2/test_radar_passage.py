"""Lists of radars through the gateway: behind the switches, on the lot, nothing back as real."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import astuple

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.radar_list import RadarList
from foretwin.telemetry.anchored import lot_from_world_message
from foretwin.telemetry.ros2.mapping import MappingError, parse_mapping
from foretwin.telemetry.ros_messages.parts import RADAR_SCAN
from tests.telemetry.ros2.gateway_ground import mapping_text
from tests.telemetry.ros2.passing_ground import PERCEPTION, PassingGround, S
from tests.telemetry.ros2.test_merged_objects import user

COVERS = (
    "foretwin.telemetry.ros2.inwards",
    "foretwin.telemetry.ros2.outwards",
    "foretwin.telemetry.ros2.rows",
)
MORE = f"""{PERCEPTION}
[[out]]
topic = "/sensing/radar/front/objects_raw"
type = "radar_msgs/msg/RadarScan"
source = "radar_list"
sensor = "front"
frame = "radar_front"
[[out]]
topic = "/foretwin/radar"
type = "radar_msgs/msg/RadarScan"
source = "radar_list"
sensor = "front"
frame = "radar_front"
"""
RETURNS = np.array([[20.0, 0.25, 0.0, -3.5, 10.0]], np.float32)
MOUNT = Mount(forward_m=3.6, left_m=0.5, up_m=0.5, yaw_deg=30.0)


class Passing(PassingGround):
    def __init__(self, *, flag: bool = True, anchor: Anchor | None = None) -> None:
        super().__init__(MORE, flag=flag, anchor=anchor)
        self.goes_on()

    def told(self, sensor: str = "front") -> None:
        self.passes("radar_list", seen_by(sensor))

    def sent(self, topic: str = "/sensing/radar/front/objects_raw") -> list[Any]:
        return self.heard_on(topic, RADAR_SCAN)


def seen_by(sensor: str) -> RadarList:
    return RadarList(stamp_ns=5 * S, returns=RETURNS, sensor=sensor, mount=MOUNT)


def test_a_list_goes_out_in_the_radars_frame() -> None:
    ground = Passing()
    ground.told()
    ground.told(sensor="another")
    (theirs,), (ours,) = ground.sent(), ground.sent("/foretwin/radar")

    assert theirs == ours
    assert theirs.header.frame_id == "radar_front"
    (one,) = theirs.returns
    assert (one.range, one.azimuth, one.doppler_velocity) == (20.0, 0.25, -3.5)


def test_without_the_second_switch_only_what_is_below_foretwin_goes_out() -> None:
    ground = Passing(flag=False)
    ground.told()
    assert (len(ground.sent()), len(ground.sent("/foretwin/radar"))) == (0, 1)
    assert ground.gateway.held["/sensing/radar/front/objects_raw"] == 1


def test_when_the_word_is_overdue_no_list_goes_to_the_vehicle() -> None:
    ground = Passing()
    ground.told()
    ground.is_overdue("radar_list", seen_by("front"))
    assert (len(ground.sent()), len(ground.sent("/foretwin/radar"))) == (1, 2)


def test_whom_the_stack_perceives_in_our_lists_is_not_real() -> None:
    ground = Passing()
    ground.holds_a_van_that_is_none()

    def perceived(x: float, y: float) -> int:
        return ground.perceives([user("0" * 32, x, y, van=True, virtual=False)])

    assert perceived(20.6, 10.0) == 1
    ground.told()
    assert perceived(20.6, 10.0) == 0
    assert perceived(26.0, 8.0) == 1


def test_a_car_on_a_small_mirrored_lot_has_small_mirrored_lists() -> None:
    lot = AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0)
    anchor = Anchor(lot=lot, world=lot, scale=10.0, mirrored=True)
    there = lot_from_world_message(anchor, seen_by("front"))

    assert there.returns[0] == pytest.approx([2.0, -0.25, 0.0, -0.35, 10.0])
    small = Mount(forward_m=0.36, left_m=-0.05, up_m=0.05, yaw_deg=-30.0)
    assert astuple(there.mount) == pytest.approx(astuple(small))
    ground = Passing(anchor=anchor)
    ground.told()
    (sent,) = ground.sent("/foretwin/radar")
    assert sent.returns[0].range == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('frame = "radar_front"', "", "frame '': a radar list is in the radar's own frame"),
        ('sensor = "front"', "", "sensor '': of source 'point_cloud' or 'radar_list'"),
        ('frame = "radar_front"', 'frame = "f"\nlayout = "autoware"', "layout 'autoware'"),
        ("RadarScan", "RadarTracks", "radar_list goes out as radar_msgs/msg/RadarScan"),
    ],
)
def test_rows_that_cannot_be_are_told(old: str, new: str, said: str) -> None:
    text = mapping_text(enabled=True, more=MORE.replace(old, new, 1))
    with pytest.raises(MappingError, match=said):
        parse_mapping(text, name="m.toml")
