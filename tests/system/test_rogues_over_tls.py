"""Rogues at a drive whose bus is a network's: none gets further than its certificate allows, and
the drive goes on untouched."""

from __future__ import annotations

import datetime
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from foretwin.contracts.bus import BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.campaign import TlsFiles, role_files
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.keys import TELEMETRY_CHANNELS, key
from foretwin.contracts.ports import free_port
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.zenoh_config import zenoh_config
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.campaign.joining import admission
from tests.contracts.bus_sides import publish_until_received
from tests.orchestrator.campaign.campaigns import campaign, expired, now
from tests.system.foretwin_command import Finished, log_lines, run_folder, started, wait_for
from tests.system.rogues import OF_A_WORKER, ROGUE, ROGUES

LIVE = ("--end", "40", "--futures", "6", "--workers", "1", "--rate", "1")
LET_NOBODY_IN: dict[str, str] = {
    "no certificate": "no certificate",
    "another campaign's certificate": "another campaign's certificate",
    "an expired certificate": "an expired certificate",
    "plain TCP": "no TLS",
    "the router's own certificate": "a certificate that is no client's",
}
"""Who is not let in at all, and as what the router counts it."""


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


def begun(out: Path) -> Callable[[], bool]:
    def look() -> bool:
        folder = run_folder(out)
        return folder is not None and any(
            line["text"].startswith("world ") for line in log_lines(folder)
        )

    return look


def test_a_drive_over_tls_is_untouched_by_every_rogue(tmp_path: Path, campaigns: Path) -> None:
    out, endpoint = tmp_path / "runs", f"tls/localhost:{free_port()}"
    secured = ("--endpoint", endpoint, "--secure", str(campaigns / "ours"))
    heard: dict[str, Any] = {}
    with started(out, *LIVE, *secured) as process:
        wait_for(begun(out), "the first World")
        folder = run_folder(out)
        assert folder is not None
        for name, config in strangers(campaigns, endpoint).items():
            with pytest.raises(zenoh.ZError):
                zenoh.open(config)
            assert name in LET_NOBODY_IN
        for rogue in ROGUES:
            with zenoh.open(config_of(endpoint, role_files(campaigns / "ours", rogue.role))) as one:
                heard[rogue.name] = rogue.act(one, folder.name)
        screen, _ = process.communicate(timeout=240.0)
    done = Finished(process.returncode, screen, run_folder(out))
    record = done.record()
    assert record["exit"] == "completed", screen
    not_let_in = {one["kind"] for one in record["refused_by_router"]["by_role"] if not one["name"]}
    assert not_let_in >= set(LET_NOBODY_IN.values())
    reasons = {(one["sender"], one["reason"]) for one in record["refused"]["by_sender"]}
    own = f"run/{folder.name}"
    wanted = {(f"{own}/{channel}", "no message") for channel in OF_A_WORKER}
    wanted |= {(f"vehicle/ego/telemetry/{one}", "no message") for one in TELEMETRY_CHANNELS}
    wanted |= {(f"{own}/mirror", "too large"), ("vehicle/ego/telemetry/gnss", "too large")}
    assert wanted - reasons == set()
    assert reasons - wanted == set()
    # What a role may not say came nowhere: no sample of it, no token, no word, no change.
    assert record["telemetry"]["lost"] < 100
    assert record["ledger"]["telemetry"]["lost_by"]["never_came"] == 0
    assert record["workers"]["strangers"] == 0
    assert record["workers"]["restarted"] == 0
    assert record["changes"] == []
    assert heard["a viewer changes the drive"] == []
    (answer,) = heard["an operator names a path"]
    assert "etc/passwd" in bytes((answer.ok or answer.err).payload).decode(errors="replace")
    assert not [line for line in log_lines(folder) if ROGUE in line["text"]]
    assert not [line for line in log_lines(folder) if "traceback" in line]
    assert done.rows("rounds")


def router_of(campaigns: Path, endpoint: str) -> BusSetup:
    tls = role_files(campaigns / "ours", "router")
    return BusSetup(endpoint=endpoint, tls=tls, admits=admission("r"))


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
