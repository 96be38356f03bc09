"""Whether a car is shown what is virtual is said at once on change, else five times a second."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.guard import Refused, admit
from foretwin.contracts.towards_vehicle import Injection
from foretwin.orchestrator.record.recorded_messages import TopicRead, recorded_messages
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.processes.recording import DriveRecording
from foretwin.telemetry.ros2.injection import InjectionWord
from foretwin.telemetry.ros2.lot_guard import margin_m
from foretwin.telemetry.ros2.safety import CommandLimits, VehicleGate
from tests.contracts.memory_bus import MemoryBus
from tests.telemetry.drive_messages import START_NS
from tests.telemetry.processes.test_recorder import publish_all, recorder
from tests.telemetry.ros2.test_gateway_on_a_lot import BREACHES, Lot
from tests.telemetry.ros2.test_lot_guard import MS, S, guard, state

TOLD = (
    "far away", "much too fast", "no state any more", "no sample any more",
    "a position that leaps", "positions overdue", "nobody in charge",
)  # fmt: skip
"""One breach of each reason; all begin in the middle of the lot."""


def heard(told: Mailbox) -> list[Injection]:
    found = []
    while (item := told.take()) is not None:
        found.append(item.message())
    return found


@pytest.mark.parametrize("breach", TOLD)
def test_a_gate_that_shuts_is_told_of_with_its_reason(breach: str) -> None:
    lot, told = Lot(), Mailbox(1000)
    lot.ground.bus.subscribe("injection", told, vehicle="ego")
    lot.go_on(100)
    before = heard(told)
    assert [one.gate for one in before][-2:] == ["open", "open"]
    assert len(before) <= 7, "a second of five, and one for the change"
    assert (before[-1].reason, before[-1].fence_m) == ("well", pytest.approx(56.0, abs=0.01))
    assert before[-1].margin_m == pytest.approx(margin_m(5.0))
    lot.change(BREACHES[breach].wrong)
    after_ms = 0
    while lot.ground.gateway.gate.state == "open":
        lot.go_on()
        after_ms += 10
        assert after_ms < 200
    last = heard(told)[-1]
    assert (last.gate, last.reason) == ("shut", BREACHES[breach].reason), (
        "in the step in which it shut"
    )


def word() -> InjectionWord:
    one = guard()
    one.take_state(state(101.0, speed_mps=8.0), now_ns=S)
    return InjectionWord(VehicleGate(CommandLimits(), config_on=True, flag_on=False), one)


def test_outside_the_way_to_the_fence_is_negative_and_time_goes_on_from_the_state() -> None:
    said = word().news(S + 30 * MS)
    assert said is not None
    assert (said.gate, said.reason) == ("off", "switched off")
    assert said.fence_m == pytest.approx(-5.0, abs=0.01)
    assert said.stamp_ns == state(0.0).stamp_ns + 30 * MS


def test_what_stays_as_it_is_is_said_five_times_a_second() -> None:
    one = word()
    said = [at for at in range(S, 2 * S, 10 * MS) if one.news(at) is not None]
    assert said == list(range(S, 2 * S, S // 5))


def test_before_the_car_is_heard_of_nothing_is_said() -> None:
    gate = VehicleGate(CommandLimits(), config_on=True, flag_on=True)
    assert InjectionWord(gate, guard()).news(S) is None


def test_what_is_beyond_bounds_is_refused() -> None:
    with pytest.raises(Refused, match="fence_m"):
        admit(
            Injection(stamp_ns=1, gate="shut", reason="well", fence_m=1e10, margin_m=0.0), where="x"
        )


def test_it_is_recorded_and_never_said_again(tmp_path: Path) -> None:
    bus, path = MemoryBus(), tmp_path / "drive.mcap"
    process = recorder(bus, DriveRecording(path))
    publish_all(bus)
    shut = Injection(
        stamp_ns=START_NS + 5, gate="shut", reason="near the fence", fence_m=12.5, margin_m=29.4
    )
    bus.publish("injection", shut, vehicle="car")
    process.step()
    process.finish()
    assert list(recorded_messages(path, TopicRead("/foretwin/injection", Injection))) == [shut]
    assert "injection" not in {channel for channel, _ in open_log(path).samples()}
