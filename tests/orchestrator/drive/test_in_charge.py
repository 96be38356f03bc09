"""Who is in charge says so only where both switches are on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.setup import Ros2Setup
from foretwin.contracts.signing import COMMAND_KEY, OrderCheck, OrderSigner
from foretwin.orchestrator.drive.in_charge import InCharge, sworn_in
from foretwin.orchestrator.drive.processes import PROCESSES
from foretwin.orchestrator.plan import DrivePlan
from foretwin.telemetry.ros2.mapping import AUTOWARE, MappingFile, parse_mapping
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.trip import town_plan


def plan_with(folder: Path, *, enabled: bool, flag: bool) -> DrivePlan:
    text = AUTOWARE.read_text(encoding="utf-8")
    if enabled:
        text = text.replace("enabled = false", "enabled = true")
    plan = town_plan(folder)
    config = msgspec.structs.replace(
        plan.config, source="live", ros2="autoware", towards_vehicle=flag
    )
    ros2 = MappingFile("m.toml", text, parse_mapping(text, name="m.toml"))
    return replace(plan, config=config, ros2=ros2)


def ros2_row() -> Any:
    return next(row for row in PROCESSES if row.name == "ros2")


@pytest.mark.parametrize(("enabled", "flag"), [(False, False), (True, False), (False, True)])
def test_no_word_without_both_switches(tmp_path: Path, enabled: bool, flag: bool) -> None:
    plan = plan_with(tmp_path, enabled=enabled, flag=flag)
    assert not plan.towards_vehicle
    signer = OrderSigner.with_new_key(run_id=plan.run_id, channel="authority")
    with pytest.raises(ValueError, match="a switch is off"):
        InCharge(MemoryBus(), plan, signer)
    with sworn_in(plan) as sworn:
        assert sworn == (plan, None)
        assert not (plan.folder / COMMAND_KEY).exists()


def test_the_word_is_said_fifty_times_a_second_at_most(tmp_path: Path) -> None:
    plan, bus, inbox = plan_with(tmp_path, enabled=True, flag=True), MemoryBus(), Mailbox(1000)
    bus.subscribe("authority", inbox, run=plan.run_id)
    times_ns = iter(range(0, 10**9, 5_000_000))
    with sworn_in(plan) as (sworn, signer):
        in_charge = InCharge(bus, sworn, signer, mono_ns=lambda: next(times_ns))
        for _ in range(200):
            in_charge.say()
        assert sworn.order_keys is not None
    check = OrderCheck(sworn.order_keys.authority, run_id=plan.run_id, channel="authority")
    assert len(inbox) == 50
    words = [inbox.take().message() for _ in range(50)]  # type: ignore[union-attr]
    assert words[0].sent_mono_ns == 0
    for word in words:
        check.check(word, where="authority")


def test_the_gateway_trusts_the_keys_of_this_run_alone(tmp_path: Path) -> None:
    plan = plan_with(tmp_path, enabled=True, flag=True)
    with sworn_in(plan) as (sworn, signer), sworn_in(plan) as (again, _):
        setup = ros2_row().setup(sworn, "ros2")
        assert signer is not None
        assert setup.order_keys.authority == signer.public_key
        assert sworn.order_keys != again.order_keys


def test_the_key_of_commands_is_its_owners_and_goes_with_the_drive(tmp_path: Path) -> None:
    plan = plan_with(tmp_path, enabled=True, flag=True)
    file = plan.folder / COMMAND_KEY
    file.write_bytes(b"left by a drive that was killed")
    with sworn_in(plan) as (sworn, signer):
        assert file.stat().st_mode & 0o777 == 0o600
        assert sworn.order_keys is not None
        assert OrderSigner.of_commands(plan.folder).public_key == sworn.order_keys.vehicle_command
        assert signer is not None
        own = signer._key.private_bytes_raw()
        assert not [p for p in plan.folder.rglob("*") if p.is_file() and own in p.read_bytes()]
    with pytest.raises(FileNotFoundError):
        OrderSigner.of_commands(plan.folder)


def test_the_gateway_gets_the_mapping_as_it_was_checked(tmp_path: Path) -> None:
    plan = plan_with(tmp_path, enabled=True, flag=False)
    assert ros2_row().runs(plan)
    setup = ros2_row().setup(plan, "ros2")
    assert isinstance(setup, Ros2Setup)
    assert plan.ros2 is not None
    assert setup.mapping == plan.ros2.text
    assert not setup.towards_vehicle
    assert ros2_row().when_dead == "end_drive"  # never restarted: nothing resumes by itself


def test_no_gateway_unless_asked_for(tmp_path: Path) -> None:
    assert not ros2_row().runs(town_plan(tmp_path))
