"""What strangers order reaches no vehicle, is counted, and is told once."""

from __future__ import annotations

import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.mailbox import Received
from foretwin.contracts.towards_vehicle import Authority, VehicleCommand
from tests.telemetry.ros2.gateway_ground import STEERING_KEY, steering
from tests.telemetry.ros2.order_side import OrderSide
from tests.telemetry.ros2.test_gateway import Ground, S

REFUSED = "run/r/{}: not signed with this run's key"


def in_charge() -> Ground:
    ground = Ground(enabled=True, flag=True)
    ground.arrive(STEERING_KEY + "RIHS01_x", steering(5 * S, 0.1))
    ground.orders.say(ground.bus, Authority(sent_mono_ns=ground.now_ns))
    ground.step()
    assert ground.gateway.gate.state == "open"
    return ground


def command(ground: Ground) -> VehicleCommand:
    return VehicleCommand(
        stamp_ns=0, sent_mono_ns=ground.now_ns, tire_angle_rad=0.1, accel_mps2=0.5, speed_mps=1.0
    )


def sent(ground: Ground) -> int:
    return len(ground.foreign.on("/control/cmd"))


def test_a_command_that_nobody_signed_reaches_no_vehicle() -> None:
    ground = in_charge()
    for _ in range(3):
        ground.bus.publish("vehicle_command", command(ground), run="r")
        ground.step()
    assert sent(ground) == 0
    assert ground.gateway.report()["refused"] == {REFUSED.format("vehicle_command"): 3}
    ground.orders.say(ground.bus, command(ground))
    ground.step()
    assert sent(ground) == 1


def test_a_forged_word_neither_opens_the_gate_nor_holds_off_the_dead_man() -> None:
    stranger = Ground(enabled=True, flag=True)
    stranger.bus.publish("authority", Authority(sent_mono_ns=stranger.now_ns), run="r")
    stranger.step()
    assert stranger.gateway.gate.state == "waiting"
    ground = in_charge()
    for number in range(20):
        forged = Authority(sent_mono_ns=ground.now_ns, number=2**61 + number, signature=bytes(64))
        ground.bus.publish("authority", forged, run="r")
        OrderSide("another run").authority.signed(Authority(sent_mono_ns=ground.now_ns))
        ground.step(10.0)
    assert ground.gateway.gate.state == "shut"
    assert ground.gateway.report()["refused"] == {REFUSED.format("authority"): 20}


def test_what_was_heard_and_is_said_again_moves_nothing() -> None:
    ground = in_charge()
    order = ground.orders.command.signed(command(ground))
    for _ in range(4):
        ground.bus.publish("vehicle_command", order, run="r")
        ground.step(25.0)
    assert sent(ground) == 1
    (reason,) = ground.gateway.report()["refused"]
    assert "replayed" in reason


def test_a_signature_of_another_run_counts_as_none() -> None:
    ground, other = in_charge(), OrderSide("another")
    ground.bus.publish("vehicle_command", other.command.signed(command(ground)), run="r")
    ground.step()
    assert sent(ground) == 0
    assert ground.gateway.report()["refused"] == {REFUSED.format("vehicle_command"): 1}


def test_a_signed_command_that_is_old_is_held() -> None:
    ground = in_charge()
    order = ground.orders.command.signed(command(ground))
    for _ in range(2):
        ground.now_ns += 100_000_000
        ground.orders.say(ground.bus, Authority(sent_mono_ns=ground.now_ns))
        ground.step()
    ground.bus.publish("vehicle_command", order, run="r")
    ground.step()
    assert sent(ground) == 0
    assert ground.gateway.report()["gate"] == {"command too old": 1}


@pytest.mark.parametrize("data", [b"", b"hello", encode(Authority(sent_mono_ns=1))[:30]])
def test_bytes_that_are_no_order_are_counted(data: bytes) -> None:
    ground = in_charge()
    orders = ground.gateway._orders
    assert orders is not None
    key = "foretwin/v1/run/r/authority"
    orders._inbox.put(Received("authority", key, data, Authority))
    ground.step()
    assert sum(ground.gateway.report()["refused"].values()) == 1
    assert ground.gateway.gate.state == "open"


def test_a_flood_of_forged_orders_does_not_keep_the_dead_man_from_looking() -> None:
    ground = in_charge()
    looked = []
    look = ground.gateway.gate.look
    ground.gateway.gate.look = lambda **how: looked.append(1) or look(**how)  # type: ignore[method-assign, func-returns-value]
    orders = ground.gateway._orders
    assert orders is not None
    check = orders._checked

    def flooded(item: Received) -> object:
        ground.bus.publish("vehicle_command", command(ground), run="r")
        return check(item)

    orders._checked = flooded  # type: ignore[method-assign]
    ground.bus.publish("vehicle_command", command(ground), run="r")
    ground.gateway._take_orders()
    assert looked
    assert sum(ground.gateway.report()["refused"].values()) == 64


def test_without_keys_nobodys_word_counts() -> None:
    ground = Ground(enabled=True, flag=True, keys=False)
    ground.say_everything()
    assert ground.gateway.gate.state == "waiting"
    assert sent(ground) == 0
