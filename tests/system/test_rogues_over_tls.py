"""Rogues at a drive whose bus is a network's: none gets further than its certificate allows, and
the drive goes on untouched."""

from __future__ import annotations

import datetime
import json
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.bus import BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.campaign import TlsFiles, role_files
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.keys import key
from foretwin.contracts.ports import free_port
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.zenoh_config import zenoh_config
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.campaign.joining import admission
from tests.contracts.bus_sides import publish_until_received
from tests.orchestrator.campaign.campaigns import campaign, expired, now
from tests.system.foretwin_command import Finished, run_folder, started, wait_for
from tests.system.rogue_drives import Bus, assert_all_were_refused, begun, play

LIVE = ("--futures", "6", "--rate", "1")


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaigns")
    campaign(folder / "ours", age_days=3.0)
    campaign(folder / "other")
    shutil.copytree(folder / "ours", folder / "old")
    expired(folder / "old", "worker")
    return folder


def config_of(endpoint: str, tls: TlsFiles | None) -> Any:
    config = zenoh_config(BusSetup(endpoint=endpoint, tls=tls), router=False)
    config.insert_json5("connect/timeout_ms", "600")
    return config


def strangers(campaigns: Path, endpoint: str) -> dict[str, Any]:
    ours, other = campaigns / "ours", role_files(campaigns / "other", "worker")
    authority = str(ours / "ca.pem")
    bare = config_of(endpoint, role_files(ours, "worker"))
    settings = {"root_ca_certificate": authority, "enable_mtls": False}
    bare.insert_json5("transport/link/tls", json.dumps(settings))
    foreign = TlsFiles(authority=authority, certificate=other.certificate, key=other.key)
    return {
        "no certificate": bare,
        "another campaign's certificate": config_of(endpoint, foreign),
        "an expired certificate": config_of(endpoint, role_files(campaigns / "old", "worker")),
        "plain TCP": config_of(endpoint.replace("tls/", "tcp/"), None),
        "the router's own certificate": config_of(endpoint, role_files(ours, "router")),
    }


@pytest.mark.judge  # the same table is played on the socket in the fast suite
def test_a_drive_over_tls_is_untouched_by_every_rogue(tmp_path: Path, campaigns: Path) -> None:
    out, endpoint = tmp_path / "runs", f"tls/localhost:{free_port()}"
    secured = ("--endpoint", endpoint, "--secure", str(campaigns / "ours"))
    bus = Bus(
        "tls",
        as_member=lambda rogue: config_of(endpoint, role_files(campaigns / "ours", rogue.role)),
        as_stranger=strangers(campaigns, endpoint).__getitem__,
    )
    with started(out, *LIVE, *secured) as process:
        wait_for(lambda: begun(out), "the first World")
        run = run_folder(out)
        assert run is not None
        heard = play(bus, run)
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=240.0)
    assert_all_were_refused(Finished(process.returncode, screen, run), "tls", heard)


def router_of(campaigns: Path, endpoint: str) -> BusSetup:
    tls = role_files(campaigns / "ours", "router")
    return BusSetup(endpoint=endpoint, tls=tls, admits=admission("r"))


@pytest.mark.judge
def test_a_link_closes_when_its_certificate_expires(tmp_path: Path, campaigns: Path) -> None:
    endpoint, short = f"tls/localhost:{free_port()}", tmp_path / "short"
    shutil.copytree(campaigns / "ours", short)
    begun_at = now() - datetime.timedelta(days=1) + datetime.timedelta(seconds=8)
    issue(short, "car", days=1, now=begun_at)
    car_setup = BusSetup(endpoint=endpoint, tls=role_files(short, "car"))
    heard = Mailbox(1000)
    with ZenohBus(router_of(campaigns, endpoint), router=True) as router:
        router.subscribe("speed", heard, vehicle="ego")
        with ZenohBus(car_setup) as car:
            publish_until_received(car, heard)
            assert car.connected
            wait_for(lambda: not car.connected, "the link to close")
            while heard.take() is not None:
                pass
            car.publish("speed", SpeedSample(stamp_ns=1, speed_mps=3.0), vehicle="ego")
            assert heard.take(1.0) is None
        with pytest.raises(BusUnreachable, match="expired"):
            ZenohBus(car_setup)


def test_the_rules_let_each_role_say_what_it_has_to_and_no_more(campaigns: Path) -> None:
    endpoint = f"tls/localhost:{free_port()}"
    heard, refused = Mailbox(1000), Mailbox(1000)
    with (
        ZenohBus(router_of(campaigns, endpoint), router=True),
        ZenohBus(
            BusSetup(endpoint=endpoint, tls=role_files(campaigns / "ours", "orchestrator"))
        ) as orchestrator,
        ZenohBus(BusSetup(endpoint=endpoint, tls=role_files(campaigns / "ours", "car"))) as car,
        ZenohBus(BusSetup(endpoint=endpoint, tls=role_files(campaigns / "ours", "worker"))) as w,
    ):
        orchestrator.subscribe("speed", heard, vehicle="*")
        orchestrator.subscribe("run_end", refused, run="*")
        publish_until_received(car, heard)
        for number in range(20):
            w.publish("speed", SpeedSample(stamp_ns=number, speed_mps=99.0), vehicle="ego")
        car.publish("speed", SpeedSample(stamp_ns=7, speed_mps=5.0), vehicle="ego")
        item = heard.take(30.0)
        assert item is not None
        assert item.message().speed_mps == 5.0
        assert heard.take(0.3) is None
        assert key("speed", vehicle="ego") == item.key
