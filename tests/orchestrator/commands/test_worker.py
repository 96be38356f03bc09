"""`foretwin worker`: what cannot be used is told in one line, before anything is started."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.campaign import role_files
from foretwin.contracts.ports import free_port
from foretwin.contracts.process_setup import BusSetup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.campaign.joining import admission
from foretwin.orchestrator.commands import worker as worker_command
from foretwin.orchestrator.commands.cli import run
from tests.orchestrator.campaign.campaigns import campaign, expired, now

COVERS = ("foretwin.orchestrator.commands.cli_worker",)


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = campaign(tmp_path_factory.mktemp("campaigns") / "ours", age_days=3.0)
    for role in ("worker-laptop", "worker-old"):
        issue(folder, role, days=20, now=now())
    expired(folder, "worker-old")  # type: ignore[arg-type]
    return folder


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return the one line that a command says which cannot be met."""
    assert run(["worker", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("tcp/127.0.0.1:1",), "--connect tcp/127.0.0.1:1: whoever reaches it may speak"),
        (("tls/127.0.0.1:1",), "--connect tls/127.0.0.1:1: needs --secure FOLDER"),
        (("127.0.0.1", "--insecure"), "--connect '127.0.0.1': PROTOCOL/ADDRESS"),
        (("tcp/127.0.0.1:1", "--insecure", "--name", "My Car"), "--name 'My Car': small letters"),
        (("tcp/127.0.0.1:1", "--insecure", "--workers", "0"), "--workers 0: 1 to "),
        (("tcp/127.0.0.1:1", "--insecure", "--cache", "/proc/x"), "--cache /proc/x: "),
        (("tcp/127.0.0.1:1", "--insecure"), "--connect tcp/127.0.0.1:1: nobody answers there"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    text: str,
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    cache = () if "--cache" in words else ("--cache", str(tmp_path))
    assert said(capsys, "--connect", *words, *cache).startswith(f"foretwin: {text}")


@pytest.mark.parametrize(
    ("role", "text"),
    [
        ("worker", "worker/certificate.pem: is of worker, not of a machine; `foretwin secure add"),
        ("car", "car/certificate.pem: is of car, not of a machine"),
        ("worker-old", "worker-old/certificate.pem: expired"),
        ("worker-none", "worker-none/ca.pem: missing"),
    ],
)
def test_a_certificate_that_is_none_of_a_machine_is_refused(
    ours: Path, capsys: pytest.CaptureFixture[str], role: str, text: str
) -> None:
    words = ("--connect", "tls/127.0.0.1:1", "--secure", str(ours / role))
    assert text in said(capsys, *words)


def test_a_name_that_is_not_the_certificates_is_refused(
    ours: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--connect", "tls/127.0.0.1:1", "--secure", str(ours / "worker-laptop"))
    assert "--name desk: its certificate is that of laptop" in said(
        capsys, *words, "--name", "desk"
    )


def test_where_nobody_drives_it_says_so(
    ours: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_command, "DRIVE_S", 0.3)
    endpoint = f"tls/localhost:{free_port()}"
    router = BusSetup(
        endpoint=endpoint, tls=role_files(ours, "router"), admits=admission("r", ours)
    )
    words = ("--connect", endpoint, "--secure", str(ours / "worker-laptop"))
    with ZenohBus(router, router=True):
        line = said(capsys, *words, "--cache", str(tmp_path))
    assert line == f"foretwin: --connect {endpoint}: no drive has begun there in 0.3 s"
