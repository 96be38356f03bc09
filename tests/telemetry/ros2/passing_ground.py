"""A gateway with its second switch, through which what sensors that do not exist have seen goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.towards_vehicle import Authority
from foretwin.telemetry.ros_messages.objects import FROM_USERS, ObjectSpread
from foretwin.telemetry.ros_messages.parts import PREDICTED_OBJECTS, typestore
from tests.telemetry.ros2.gateway_ground import FRAME
from tests.telemetry.ros2.test_gateway import Ground
from tests.telemetry.ros2.test_merged_objects import user

S, MS = 10**9, 10**6
PERCEPTION = """
[[in]]
topic = "/perception/real"
type = "autoware_perception_msgs/msg/PredictedObjects"
channel = "objects"
"""
_KEY = "0/perception/real/autoware_perception_msgs::msg::dds_::PredictedObjects_/RIHS01_x"


class PassingGround(Ground):
    def __init__(self, more: str, *, flag: bool = True, anchor: Anchor | None = None) -> None:
        super().__init__(enabled=True, flag=flag, more=more, anchor=anchor)
        self.objects = Mailbox(10)
        self.bus.subscribe("objects", self.objects, vehicle="ego")

    def goes_on(self, passed_ms: float = 0.0) -> None:
        self.now_ns += round(passed_ms * MS)
        self.orders.say(self.bus, Authority(sent_mono_ns=self.now_ns))
        self.step()

    def passes(self, channel: str, seen: Any, *, after_ms: float = 100.0) -> None:
        self.bus.publish(channel, seen, run="r")
        self.goes_on(after_ms)

    def is_overdue(self, channel: str, seen: Any) -> None:
        """Say what was seen once the word of the orchestrator is too old."""
        self.now_ns += 200 * MS
        self.bus.publish(channel, seen, run="r")
        self.step()

    def heard_on(self, topic: str, type_name: str) -> list[Any]:
        return [typestore().deserialize_cdr(one, type_name) for one in self.foreign.on(topic)]

    def holds_a_van_that_is_none(self) -> None:
        van = user("ghost", 20.0, 8.0, van=True, virtual=True)
        self.passes("virtual_objects", RoadUsers(stamp_ns=5 * S, users=(van,)), after_ms=0.0)

    def perceives(self, users: Sequence[RoadUser]) -> int:
        """Return how many of what the stack perceives are taken for real."""
        said = RoadUsers(stamp_ns=5 * S, users=tuple(users))
        ros = FROM_USERS[PREDICTED_OBJECTS](said, FRAME, ObjectSpread())
        self.arrive(_KEY, bytes(typestore().serialize_cdr(ros, PREDICTED_OBJECTS)))
        item = self.objects.take()
        assert item is not None
        return len(item.message().users)
