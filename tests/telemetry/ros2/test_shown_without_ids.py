"""Whom a car was shown in a list without ids does not come back as real under another."""

from __future__ import annotations

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import RoadUsers
from foretwin.telemetry.ros2.names import dds_type
from foretwin.telemetry.ros_messages.objects import predicted_from_users
from foretwin.telemetry.ros_messages.parts import PREDICTED_OBJECTS, typestore
from tests.telemetry.ros2.test_gateway_on_a_lot import PLAIN, WALKER, Lot, replaced

COVERS = ("foretwin.telemetry.ros2.inwards",)

DETECTED = """
[[out]]
topic = "/perception/detected"
type = "autoware_perception_msgs/msg/DetectedObjects"
source = "virtual_objects"
"""


def test_who_went_out_without_an_id_is_known_under_another() -> None:
    """Detected objects have none; the car's tracking gives them one, which is none of ours."""
    for more, comes_back in (("", True), (DETECTED, False)):
        lot = Lot(more=more)
        seen = Mailbox(100)
        lot.ground.bus.subscribe("objects", seen, vehicle="ego")
        lot.go_on(50)
        tracked = replaced(
            WALKER, user_id="0123456789abcdef0123456789abcdef", position=PLAIN.lot.frame.origin
        )
        users = RoadUsers(stamp_ns=lot.stamp_ns, users=(tracked,))
        ros = predicted_from_users(users, PLAIN.lot.frame)
        key = f"0/perception/seen/{dds_type(PREDICTED_OBJECTS)}/RIHS01_x"
        payload = bytes(typestore().serialize_cdr(ros, PREDICTED_OBJECTS))
        lot.ground.foreign.arrive(key, payload, mono_ns=lot.ground.now_ns)
        lot.ground.step()
        item = seen.take()
        assert item is not None
        assert bool(item.message().users) == comes_back
