"""The doctor: one line per finding, and code 3 where a drive could not run."""

from __future__ import annotations

import importlib.metadata
import os
from pathlib import Path

import pytest

from foretwin.contracts.ports import free_port
from foretwin.orchestrator import config
from foretwin.orchestrator.commands import doctor
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.doctor import CheckResult, examine
from tests.orchestrator.campaign.campaigns import campaign, expired


def findings() -> dict[str, CheckResult]:
    return {finding.what: finding for finding in (check() for check in doctor.CHECKS)}


def test_a_machine_that_runs_the_tests_can_drive() -> None:
    found = examine()
    assert found.code == 0
    assert isinstance(found.words, str)
    lines = found.words.splitlines()

    assert len(lines) == len(doctor.CHECKS)
    assert any(line.startswith("ok") and "Zenoh over loopback" in line for line in lines)
    assert not any(line.startswith("MISSING") for line in lines)


def test_a_missing_library_is_named_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    known = importlib.metadata.version

    def version(name: str) -> str:
        if name == "osmium":
            raise importlib.metadata.PackageNotFoundError(name)
        return known(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    monkeypatch.setattr(doctor, "CHECKS", (doctor._packages, doctor._python))

    found = examine()
    assert found.code == 3
    assert isinstance(found.words, str)
    first, second = found.words.splitlines()
    assert first == "MISSING  packages: not installed: osmium; run make setup"
    assert second.startswith("ok")


@pytest.mark.parametrize(("cores", "verdict"), [(1, "note"), (2, "ok"), (None, "note")])
def test_one_core_is_few_but_no_reason_to_stay(
    cores: int | None, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: cores)

    assert doctor._cores().verdict == verdict


@pytest.mark.parametrize("folder", [None, "missing", "there"])
def test_real_data_is_welcome_and_not_needed(
    folder: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "there").mkdir()
    monkeypatch.delenv("FORETWIN_DATA", raising=False)
    if folder:
        monkeypatch.setenv("FORETWIN_DATA", str(tmp_path / folder))

    assert doctor._data().verdict == ("ok" if folder == "there" else "note")


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_a_display_is_what_the_environment_says(
    variable: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not config.has_display()
    monkeypatch.setenv(variable, ":0")
    assert config.has_display()


def test_it_says_whether_a_drive_watches_its_vehicle_here_and_why() -> None:
    found = findings()["tuning"]
    mode, why = found.text.split("; ")
    assert (mode, found.verdict) in (("report", "ok"), ("off", "note"))
    assert "processor" in why
    assert "2 workers" in why


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((), 3, "cause    nobody listens at localhost:"),
        (("--role", "cat"), 2, "--role cat: did you mean car? one of router, orchestrator"),
        (("--endpoint", "tcp/localhost:1"), 2, "doctor needs both --endpoint tls/HOST:PORT"),
        (("--role", "viewer"), 3, "expired"),
    ],
)
def test_who_is_not_let_in_asks_it_why(
    words: tuple[str, ...], code: int, said: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder = campaign(tmp_path / "c", age_days=3.0)
    expired(folder, "viewer")
    endpoint = () if "--endpoint" in words else ("--endpoint", f"tls/localhost:{free_port()}")
    assert run(["doctor", *endpoint, "--secure", str(folder), *words]) == code
    out = capsys.readouterr()
    assert said in out.out + out.err
