"""A car behind ROS 2 is listened to before a drive, until its pose on the lot is settled."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.lot_car.ros_voice import RosVoice
from foretwin.telemetry.ros2.lot_pose import LotPoseAsked, hear_lot_pose
from foretwin.telemetry.ros2.mapping import Mapping, parse_mapping
from foretwin.telemetry.ros2.rows import OutRow
from foretwin.telemetry.ros2.sender import RosSender
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.source import StandinSource
from tests.telemetry.lot_car.test_braking import ANCHOR, MAPPING, WALL_NS, Wire, straight
from tests.telemetry.test_anchored import seen_from

MS = 10**6


def asked(mapping: str, wait_s: float = 20.0) -> LotPoseAsked:
    return LotPoseAsked(
        mapping=mapping, mapping_name="car.toml", vehicle=load_vehicle(None), scale=1.0,
        wait_s=wait_s,
    )  # fmt: skip


class TalkingWire(Wire):
    """The car speaks, from the lot's point along its axis, as who listens asks for the time."""

    def __init__(self, mapping: Mapping, *, speaks: bool = True) -> None:
        super().__init__()
        parameters = read_parameters()
        self.source = StandinSource(straight(150.0), parameters, vehicle_id="ego")
        self._voice = RosVoice(mapping, steering_ratio=parameters.car.steering_ratio)
        self._sender = RosSender(mapping, self, wall_ns=lambda: WALL_NS + self.now_ns)
        self._later_ns = WALL_NS + self.now_ns - self.source.first_stamp_ns
        self._speaks = speaks

    def mono_ns(self) -> int:
        """Say what comes next, so that nobody waits for it."""
        if not self._speaks:
            self.now_ns += 100 * MS
            return self.now_ns
        before = self._sender.sent.total()
        while self._sender.sent.total() == before and not self.source.ended:
            self.now_ns = self.source.next_stamp_ns + self._later_ns - WALL_NS
            self._say_until(self.source.next_stamp_ns)
        return self.now_ns

    def _say_until(self, stamp_ns: int) -> None:
        for channel, sample in self.source.advance(stamp_ns):
            later = replace(sample, stamp_ns=sample.stamp_ns + self._later_ns)
            for row, payload in self._voice.say(channel, later):
                self._sender.put(OutRow(topic=row.topic, type=row.type, source="state"), payload)


@pytest.fixture(params=["ros2dds", "rmw_zenoh"])
def text(request: pytest.FixtureRequest) -> str:
    return MAPPING.format(dialect=request.param, objects="DetectedObjects", lat=52.5, lon=13.4)


def test_the_pose_is_where_the_car_is_on_its_lot(text: str):
    mapping = parse_mapping(text, name="car.toml")
    wire = TalkingWire(mapping)
    found = hear_lot_pose(mapping, asked(text), foreign=wire, mono_ns=wire.mono_ns)
    assert found.pose is not None
    along_m, left_m, yaw = seen_from(ANCHOR.lot, found.pose.frame.origin, found.pose.yaw_rad)
    assert along_m == pytest.approx(wire.source.s_m, abs=1.0)
    assert left_m == pytest.approx(0.0, abs=1.0)
    assert yaw == pytest.approx(0.0, abs=0.1)


def test_a_car_that_says_nothing_has_none(text: str):
    mapping = parse_mapping(text, name="car.toml")
    wire = TalkingWire(mapping, speaks=False)
    found = hear_lot_pose(mapping, asked(text, 0.2), foreign=wire, mono_ns=wire.mono_ns)
    assert (found.pose, found.lacks) == (None, "nothing was heard of it")
    standing = TalkingWire(mapping)
    standing.source.hold(True)
    found = hear_lot_pose(mapping, asked(text, 3.0), foreign=standing, mono_ns=standing.mono_ns)
    assert found.pose is None
    assert "heading is not known" in found.lacks
