"""Our node as ROS lists it, and each sample with its number, time and sender."""

from __future__ import annotations

from foretwin.telemetry.ros2.attachment import unpack
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros2.names import type_hash
from foretwin.telemetry.ros2.sender import RosSender
from tests.telemetry.ros2.gateway_ground import RecordingForeign, mapping_text

ODOMETRY = "nav_msgs/msg/Odometry"


class Ground:
    """A sender with a wall clock in the test's hand."""

    def __init__(self, *, dialect: str = "rmw_zenoh") -> None:
        self.foreign, self.wall_ns = RecordingForeign(), 10**18
        self.mapping = parse_mapping(mapping_text(enabled=False, dialect=dialect), name="m.toml")
        self.sender = RosSender(self.mapping, self.foreign, wall_ns=lambda: self.wall_ns)


def test_the_node_and_each_end_are_announced_by_a_number_of_their_own() -> None:
    ground = Ground()
    fix, _, transforms = ground.mapping.inwards
    ground.sender.announce([fix, transforms, ground.mapping.outwards[0]])

    node, *ends = ground.foreign.tokens
    assert node == "@ros2_lv/0/ab12/0/0/NN/%/%/foretwin"
    assert [end.split("/", 8)[:8] for end in ends] == [
        ["@ros2_lv", "0", "ab12", "0", str(number), kind, "%", "%"]
        for number, kind in ((1, "MS"), (2, "MS"), (3, "MP"))
    ]
    assert ["%sensing%gnss" in ends[0], "%tf_static" in ends[1], "%foretwin%twin" in ends[2]] == [
        True, True, True,
    ]  # fmt: skip
    # What ROS says once and keeps is asked for as such, or the two would not match.
    assert [end.rsplit("/", 1)[1] for end in ends] == ["::,10:,:,:,,", ":1:,10:,:,:,,",
                                                       "::,10:,:,:,,"]  # fmt: skip


def test_samples_are_numbered_by_topic_from_one_on() -> None:
    ground = Ground()
    twin, diagnostics = ground.mapping.outwards[:2]
    for row in (twin, twin, diagnostics):
        ground.wall_ns += 5
        ground.sender.put(row, row.topic.encode())

    attached = [unpack(one) for one in ground.foreign.attachments if one is not None]
    assert [(one.seq, one.sent_ns - 10**18) for one in attached] == [(1, 5), (2, 10), (1, 15)]
    first, again, other = (one.gid for one in attached)
    assert first == again != other, "each publisher has an id of its own"
    assert ground.sender.sent == {"/foretwin/twin": 2, "/foretwin/diagnostics": 1}
    assert ground.foreign.put_keys[0] == (
        f"0/foretwin/twin/nav_msgs::msg::dds_::Odometry_/{type_hash(ODOMETRY)}"
    )
    assert ground.foreign.payloads[0] == b"/foretwin/twin"


def test_a_bridge_hears_the_bytes_alone_on_the_topic() -> None:
    ground = Ground(dialect="ros2dds")
    ground.sender.announce(ground.mapping.outwards)
    ground.sender.put(ground.mapping.outwards[0], b"data")
    assert ground.foreign.tokens == []
    assert (ground.foreign.put_keys, ground.foreign.attachments) == (["foretwin/twin"], [None])
