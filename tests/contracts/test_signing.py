"""Orders are taken from who holds the run's key, once and in order, whatever the bus brings."""

from __future__ import annotations

import random
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.codec import decode, encode
from foretwin.contracts.guard import Refused
from foretwin.contracts.signing import COMMAND_KEY, OrderCheck, OrderSigner
from foretwin.contracts.towards_vehicle import Authority, VehicleCommand

COMMAND = VehicleCommand(
    stamp_ns=5, sent_mono_ns=7, tire_angle_rad=0.1, accel_mps2=-0.3, speed_mps=2.5
)


def signer(run_id: str = "r", key: bytes = b"k" * 32) -> OrderSigner:
    return OrderSigner(key, run_id=run_id, channel="vehicle_command")


def check() -> OrderCheck:
    return OrderCheck(signer().public_key, run_id="r", channel="vehicle_command")


def over_the_wire(order: VehicleCommand) -> VehicleCommand:
    return decode(encode(order), VehicleCommand).message


def refusal(checking: OrderCheck, order: VehicleCommand) -> str:
    with pytest.raises(Refused) as refused:
        checking.check(over_the_wire(order), where="run/r/vehicle_command")
    assert refused.value.sender == "run/r/vehicle_command"
    return refused.value.reason


def test_a_signed_order_counts_once_and_never_after_a_later_one() -> None:
    checking, first = check(), signer()
    orders = [first.signed(COMMAND) for _ in range(3)]
    checking.check(over_the_wire(orders[0]), where="w")
    assert "not new" in refusal(checking, orders[0])
    checking.check(over_the_wire(orders[2]), where="w")
    assert "not new" in refusal(checking, orders[1])


@pytest.mark.parametrize(
    "field", ["number", "stamp_ns", "sent_mono_ns", "tire_angle_rad", "accel_mps2", "speed_mps"]
)
def test_whoever_changes_an_order_breaks_its_signature(field: str) -> None:
    order = signer().signed(COMMAND)
    changed = msgspec.structs.replace(order, **{field: getattr(order, field) + 1})
    assert refusal(check(), changed) == "not signed with this run's key"


@pytest.mark.parametrize(
    "forged",
    [
        COMMAND,
        msgspec.structs.replace(COMMAND, number=2**61, signature=bytes(64)),
        msgspec.structs.replace(COMMAND, number=2**61, signature=b"short"),
        signer(key=b"x" * 32).signed(COMMAND),
        signer(run_id="another").signed(COMMAND),
        OrderSigner(b"k" * 32, run_id="r", channel="authority").signed(COMMAND),
    ],
    ids=["unsigned", "zeros", "short", "another key", "another run", "another channel"],
)
def test_forged_orders_are_refused_and_move_no_number(forged: VehicleCommand) -> None:
    checking, true = check(), signer()
    assert refusal(checking, forged) == "not signed with this run's key"
    checking.check(true.signed(COMMAND), where="w")


def test_run_and_channel_cannot_be_shifted_into_each_other() -> None:
    """`r` with `vehicle_command` is no other run with another channel, however ids are chosen."""
    order = OrderSigner(b"k" * 32, run_id="rvehicle", channel="vehicle_command").signed(COMMAND)
    assert refusal(check(), order) == "not signed with this run's key"


def test_no_flipped_bit_of_the_wire_counts() -> None:
    chance, taken = random.Random(0), 0
    data = encode(signer().signed(COMMAND))
    for _ in range(500):
        place, bit = chance.randrange(24, len(data)), 1 << chance.randrange(8)
        damaged = data[:place] + bytes([data[place] ^ bit]) + data[place + 1 :]
        try:
            order = decode(damaged, VehicleCommand).message
        except ValueError:
            continue
        taken += 1
        refusal(check(), order)
    assert taken > 100


def test_a_commander_that_is_started_again_goes_on(tmp_path: Path) -> None:
    run = tmp_path / "r"
    run.mkdir()
    first = signer()
    first.keep(run / COMMAND_KEY)
    assert (run / COMMAND_KEY).stat().st_mode & 0o777 == 0o600
    checking = check()
    for one in (first, OrderSigner.of_commands(run), OrderSigner.of_commands(run)):
        checking.check(one.signed(COMMAND), where="w")
        checking.check(one.signed(COMMAND), where="w")
    with pytest.raises(FileExistsError):
        first.keep(run / COMMAND_KEY)


def test_a_new_key_is_another_each_time() -> None:
    keys = {OrderSigner.with_new_key(run_id="r", channel="authority").public_key for _ in range(20)}
    assert len(keys) == 20


@pytest.mark.parametrize("length", [0, 31, 33])
def test_a_key_of_another_length_is_none(length: int) -> None:
    with pytest.raises(ValueError, match="32"):
        OrderSigner(bytes(length), run_id="r", channel="authority")
    with pytest.raises(ValueError, match="32"):
        OrderCheck(bytes(length), run_id="r", channel="authority")


def test_the_orchestrators_word_is_signed_alike() -> None:
    word = OrderSigner(b"a" * 32, run_id="r", channel="authority")
    checking = OrderCheck(word.public_key, run_id="r", channel="authority")
    checking.check(word.signed(Authority(sent_mono_ns=1)), where="w")
