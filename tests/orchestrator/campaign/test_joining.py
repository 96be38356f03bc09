"""A drive over a network begins only where each of its processes can join."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.campaign import certificate_in, role_files
from foretwin.contracts.certificates import read_certificate
from foretwin.contracts.errors import UserError
from foretwin.contracts.fleet import ClockAnswer, ClockQuestion
from foretwin.contracts.keys import alive_key, process_of_alive_key
from foretwin.contracts.ports import free_port
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.campaign.joining import (
    LOCAL_ROLES,
    admission,
    check_campaign,
    ends,
    own_certificate,
)
from foretwin.orchestrator.drive.plan import read_inputs
from foretwin.orchestrator.drive.processes import PROCESSES, ROUTER, member, process_ids
from tests.contracts.bus_sides import take
from tests.orchestrator.campaign.campaigns import campaign, expired, now
from tests.orchestrator.trip import town_plan

ENDPOINT = "tls/localhost:7447"


def test_a_campaign_is_looked_through_before_anything_begins(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", age_days=3.0)
    check_campaign(folder, ENDPOINT, car=True)
    with pytest.raises(UserError, match="not for car-pc"):
        check_campaign(folder, "tls/car-pc:7447", car=True)
    expired(folder, "car")
    check_campaign(folder, ENDPOINT, car=False)
    with pytest.raises(UserError, match=r"car/certificate\.pem: expired"):
        check_campaign(folder, ENDPOINT, car=True)
    with pytest.raises(UserError, match=r"empty: no folder of a campaign; `foretwin secure init"):
        check_campaign(tmp_path / "empty", ENDPOINT, car=True)
    (folder / "viewer" / "key.pem").unlink()
    with pytest.raises(UserError, match=r"viewer/key\.pem: missing; `foretwin secure add viewer"):
        check_campaign(folder, ENDPOINT, car=False)


def test_the_first_certificate_that_ends_ends_the_links(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    assert ends(folder, car=False) == ends(folder, car=True)
    first = issue(folder, "car", days=2, now=now())
    assert ends(folder, car=True) == read_certificate(first / "certificate.pem").last
    assert ends(folder, car=False) > ends(folder, car=True)


def test_every_process_has_a_role_and_shows_its_own_certificate(tmp_path: Path) -> None:
    folder, plan = campaign(tmp_path / "c"), town_plan(tmp_path)
    config = msgspec.structs.replace(plan.config, secure=str(folder), endpoint=ENDPOINT)
    secured = dataclasses.replace(plan, config=config, bus=BusSetup(endpoint=ENDPOINT))
    shown = {}
    for row in PROCESSES:
        for process_id in process_ids(row, secured):
            setup = row.setup(secured, process_id)
            role = "router" if row.name == ROUTER else member(secured, process_id).role
            assert setup.bus.tls == role_files(folder, role)
            assert (setup.bus.admits is not None) is (role == "router")
            shown[process_id] = role
    assert shown["router"] == "router"
    assert shown["vehicle"] == "car"
    assert {shown[name] for name in ("w0", "w1", "mirror", "builder", "tuning")} == {"worker"}
    assert set(shown.values()) | {"orchestrator"} == {*LOCAL_ROLES, "car"}
    assert [row.setup(plan, row.name).bus.tls for row in PROCESSES if row.name == "router"] == [
        None
    ]


def test_a_role_joins_from_the_campaign_or_from_its_own_folder(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c", age_days=3.0)
    own = own_certificate(folder, "operator")
    assert own == own_certificate(folder / "operator", "operator")
    assert own == certificate_in(folder / "operator")
    expired(folder, "operator")
    with pytest.raises(UserError, match="expired"):
        own_certificate(folder, "operator")


def test_ros_has_no_certificate_of_the_runs_bus(tmp_path: Path) -> None:
    config = msgspec.structs.replace(
        town_plan(tmp_path).config,
        secure=str(campaign(tmp_path / "c")),
        endpoint=ENDPOINT,
        insecure=False,
        source="live",
        ros2="autoware",
    )
    with pytest.raises(UserError, match="endpoint must be named, that of the car"):
        read_inputs(config)


def test_a_machine_speaks_for_its_own_workers_alone(tmp_path: Path) -> None:
    folder, endpoint = campaign(tmp_path / "c"), f"tls/localhost:{free_port()}"
    for role in ("worker-laptop", "worker-desk"):
        issue(folder, role, days=2, now=now())

    def joined(role: str) -> ZenohBus:
        return ZenohBus(BusSetup(endpoint=endpoint, tls=role_files(folder, role)))

    router = BusSetup(
        endpoint=endpoint, tls=role_files(folder, "router"), admits=admission("r", folder)
    )
    seen, asked = Mailbox(16), Mailbox(16)
    with ZenohBus(router, router=True), joined("orchestrator") as orchestrator:
        orchestrator.watch_alive(alive_key(run="r", process="*"), seen)
        with joined("worker-laptop") as laptop, joined("worker-desk") as desk:
            for process in ("w0", "mirror", "w-desk-0", "w-laptop-0"):
                laptop.declare_alive(alive_key(run="r", process=process))
                laptop.serve("clock", asked, run="r", process=process)
            desk.declare_alive(alive_key(run="r", process="w-desk-1"))
            found = {process_of_alive_key(take(seen).key) for _ in range(2)}
            assert found == {"w-laptop-0", "w-desk-1"}
            assert seen.take_last(0.3) is None
            answers = Mailbox(4)
            for process in ("w-desk-0", "w0", "w-laptop-0"):
                ids = {"run": "r", "process": process}
                orchestrator.request("clock", ClockQuestion(), answers, timeout_s=1.0, **ids)
            take(asked).reply(ClockAnswer(utc_ns=1))
            assert sorted(str(take(answers).error) for _ in range(3)) == [
                "None",
                *["no answer"] * 2,
            ]
            assert asked.take() is None
    # Whose folder is gone is let in by its certificate, and may say nothing.
    assert '"worker-desk"' in admission("r", folder).access
    shutil.rmtree(folder / "worker-desk")
    assert '"worker-desk"' not in admission("r", folder).access
