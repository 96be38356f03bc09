"""What goes towards the vehicle passes the gate, at its rate, and is counted where it does not."""

from __future__ import annotations

from foretwin.telemetry.ros2.gated_sender import GatedSender
from foretwin.telemetry.ros2.mapping import Mapping
from foretwin.telemetry.ros2.rows import OutRow
from foretwin.telemetry.ros2.safety import CommandLimits, VehicleGate
from foretwin.telemetry.ros2.sender import RosSender
from foretwin.telemetry.ros_messages import parts
from tests.telemetry.ros2.gateway_ground import RecordingForeign

OURS = OutRow(topic="/foretwin/state", type=parts.ODOMETRY, source="state")
THEIRS = OutRow(topic="/car/state", type=parts.ODOMETRY, source="state")
MS = 10**6


def test_only_an_open_gate_lets_through_what_goes_towards_the_vehicle() -> None:
    foreign, now = RecordingForeign(), [0]
    gate = VehicleGate(CommandLimits(), config_on=True, flag_on=True)
    mapping = Mapping(dialect="ros2dds")
    sender = RosSender(mapping, foreign, wall_ns=lambda: 0)
    gated = GatedSender(sender, gate, foreign=foreign, max_rate_hz=50.0, mono_ns=lambda: now[0])
    rows = (OURS, THEIRS)
    gated.send(rows, lambda row: row.topic.encode())
    gated.put(THEIRS, b"unasked")
    assert (foreign.payloads, gated.held) == ([b"/foretwin/state"], {"/car/state": 2})

    gate.heartbeat(0, now_ns=0)
    gated.send(rows, lambda row: row.topic.encode())
    assert foreign.payloads[1:] == [b"/foretwin/state", b"/car/state"]
    now[0] = 19 * MS
    gated.send(rows, lambda row: row.topic.encode(), every_ns=5 * MS)
    assert foreign.payloads[3:] == [b"/foretwin/state"], "towards the vehicle 50 times a second"
    now[0] = 20 * MS
    gated.send(rows, lambda row: row.topic.encode(), every_ns=5 * MS)
    assert foreign.payloads[4:] == [b"/car/state"], "ours each 5 ms"


def test_what_cannot_be_written_and_a_link_that_is_down_end_nothing() -> None:
    foreign = RecordingForeign()
    gate = VehicleGate(CommandLimits(), config_on=True, flag_on=True)
    gate.heartbeat(0, now_ns=0)
    sender = RosSender(Mapping(dialect="ros2dds"), foreign, wall_ns=lambda: 0)
    gated = GatedSender(sender, gate, foreign=foreign, max_rate_hz=50.0, mono_ns=lambda: 0)

    def broken(_: OutRow) -> bytes:
        raise OverflowError

    gated.send((OURS,), broken)
    foreign.connected = False
    gated.send((THEIRS,), lambda _: b"x")
    assert gated.held == {"/foretwin/state: OverflowError": 1, "/car/state": 1}
    assert (foreign.payloads, gate.state) == ([], "shut")
