"""A drive over a network begins only where each of its processes can join."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.campaign import certificate_in, role_files
from foretwin.contracts.certificates import read_certificate
from foretwin.contracts.errors import UserError
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.campaign.joining import (
    LOCAL_ROLES,
    check_campaign,
    ends,
    own_certificate,
)
from foretwin.orchestrator.drive.plan import read_inputs
from foretwin.orchestrator.drive.processes import PROCESSES, ROUTER, member, process_ids
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
