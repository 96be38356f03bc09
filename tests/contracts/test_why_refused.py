"""A client that is refused finds out why: real routers and real handshakes on loopback."""

from __future__ import annotations

import contextlib
import shutil
import ssl
from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.contracts import zenoh_config
from foretwin.contracts.bus import BusUnreachable, ZenohBus
from foretwin.contracts.campaign import TlsFiles, role_files
from foretwin.contracts.ports import free_port, tls_place
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.why_refused import _answer, _meaning, likely_causes
from tests.orchestrator.campaign.campaigns import campaign, expired


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaigns")
    campaign(folder / "ours", age_days=3.0)
    campaign(folder / "other")
    return folder


@pytest.fixture(scope="module")
def endpoint(campaigns: Path) -> Iterator[str]:
    where = f"tls/localhost:{free_port()}"
    tls = role_files(campaigns / "ours", "router")
    with ZenohBus(BusSetup(endpoint=where, tls=tls), router=True):
        yield where


def cause(endpoint: str, tls: TlsFiles) -> str:
    (line,) = likely_causes(BusSetup(endpoint=endpoint, tls=tls))
    return line


def answer(endpoint: str, tls: TlsFiles) -> str:
    """What the router itself says, whatever our own look at the files finds."""
    place = tls_place(endpoint)
    assert place is not None
    line = _answer(tls, place)
    assert line is not None
    return line


def test_who_is_let_in_has_no_cause(campaigns: Path, endpoint: str) -> None:
    setup = BusSetup(endpoint=endpoint, tls=role_files(campaigns / "ours", "car"))
    assert list(likely_causes(setup)) == []
    with ZenohBus(setup) as bus:
        assert bus.connected


def test_another_campaign(campaigns: Path, endpoint: str) -> None:
    tls = role_files(campaigns / "other", "car")
    assert cause(endpoint, tls).startswith("the router is not of this campaign")
    mixed = TlsFiles(
        authority=str(campaigns / "ours" / "ca.pem"), certificate=tls.certificate, key=tls.key
    )
    assert answer(endpoint, mixed) == "the router is of another campaign than this certificate"


def test_expired(campaigns: Path, endpoint: str, tmp_path: Path) -> None:
    shutil.copytree(campaigns / "ours", tmp_path / "old")
    tls = expired(tmp_path / "old", "car")
    assert "expired" in cause(endpoint, tls)
    assert answer(endpoint, tls).startswith("the router says that the certificate has expired")


def test_a_host_that_the_router_does_not_stand_for(campaigns: Path, endpoint: str) -> None:
    place = tls_place(endpoint)
    assert place is not None
    tls = role_files(campaigns / "ours", "car")
    assert "foretwin secure add router --host" in cause(f"tls/127.0.0.2:{place.port}", tls) or (
        "nobody listens" in cause(f"tls/127.0.0.2:{place.port}", tls)
    )


def test_a_certificate_that_is_gone(campaigns: Path, endpoint: str, tmp_path: Path) -> None:
    shutil.copytree(campaigns / "ours", tmp_path / "gone")
    tls = role_files(tmp_path / "gone", "car")
    Path(tls.key).unlink()
    assert cause(endpoint, tls) == f"[Errno 2] No such file or directory: '{tls.key}'"


def test_a_name_that_no_host_can_have(campaigns: Path) -> None:
    tls = role_files(campaigns / "ours", "car")
    for name in ("twin..pc", ".twin-pc", 70 * "x"):
        assert cause(f"tls/{name}:7447", tls) == f"{name}: no name of a host"


def test_nobody_there_and_somebody_who_speaks_no_tls(campaigns: Path) -> None:
    tls, port = role_files(campaigns / "ours", "car"), free_port()
    assert f"nobody listens at localhost:{port}" in cause(f"tls/localhost:{port}", tls)
    with ZenohBus(BusSetup(endpoint=f"tcp/localhost:{port}"), router=True):
        assert "speaks no TLS" in cause(f"tls/localhost:{port}", tls)


def test_the_error_of_a_refused_client_says_why(
    campaigns: Path, endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(zenoh_config, "CONNECT_S", 0.5)
    for role, said in (("car", "the router is not of this campaign"),):
        setup = BusSetup(endpoint=endpoint, tls=role_files(campaigns / "other", role))
        with pytest.raises(BusUnreachable, match=said), contextlib.closing(ZenohBus(setup)):
            pass


@pytest.mark.parametrize(
    ("reason", "verify", "said"),
    [
        ("CERTIFICATE_VERIFY_FAILED", "Hostname mismatch, no host", "does not stand for this host"),
        ("CERTIFICATE_VERIFY_FAILED", "IP address mismatch, no ip", "does not stand for this host"),
        ("CERTIFICATE_VERIFY_FAILED", "certificate has expired", "has expired, or this clock"),
        ("CERTIFICATE_VERIFY_FAILED", "unable to get issuer", "the router is not of this campaign"),
        ("SSLV3_ALERT_CERTIFICATE_EXPIRED", "", "the router says that the certificate has expired"),
        ("TLSV1_ALERT_UNKNOWN_CA", "", "the router is of another campaign than this"),
        ("TLSV1_ALERT_DECRYPT_ERROR", "", "the router is of another campaign than this"),
        ("SSLV3_ALERT_BAD_CERTIFICATE", "", "the router does not take this certificate"),
        ("TLSV13_ALERT_CERTIFICATE_REQUIRED", "", "wants a certificate and got none"),
        ("WRONG_VERSION_NUMBER", "", "what listens there speaks no TLS"),
        ("OF_TOMORROW", "", "TLS: OF_TOMORROW"),
    ],
)
def test_every_word_of_tls_has_its_meaning(reason: str, verify: str, said: str) -> None:
    error = ssl.SSLError(1, f"[SSL: {reason}] of some line")
    error.reason = reason
    if verify:
        error.verify_message = verify  # type: ignore[attr-defined]
    assert said in _meaning(error)
