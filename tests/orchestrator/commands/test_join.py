"""`foretwin join`: what cannot be used is told in one line, before anything is started."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.contracts.credentials import make_credentials
from foretwin.contracts.ports import free_port
from foretwin.contracts.process import hold
from foretwin.orchestrator.commands.cli import run
from tests.orchestrator.campaign.campaigns import campaign

COVERS = ("foretwin.orchestrator.commands.cli_join",)
LOT = """
[lot]
lat_deg = 51.0
lon_deg = 13.8
yaw_deg = 30.0
[world]
lat_deg = 52.5
lon_deg = 13.4
yaw_deg = 0.0
"""


@pytest.fixture
def lot(tmp_path: Path) -> str:
    file = tmp_path / "lot.toml"
    file.write_text(LOT, encoding="utf-8")
    return str(file)


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return the one line that a command says which cannot be met."""
    assert run(["join", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line.removeprefix("foretwin: ")


def running(out: Path, endpoint: str) -> Path:
    """A drive that seems to go on, with a seat for `second`, and nobody at its endpoint."""
    folder = out / "20261121-100000-aaaa"
    folder.mkdir(parents=True)
    make_credentials(out, ["car-of-second"])
    record = {
        "run_id": folder.name, "exit": "running", "endpoint": endpoint, "credentials": str(out),
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")
    (folder / "log.jsonl").touch()
    hold(folder / "log.jsonl")
    return out


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), "no drive is running there; --run names one elsewhere"),
        (("--run", "none"), "none: no such folder"),
        (("--way", "5"), "--way 5: above 5"),
        (("--speed", "0"), "--speed 0: above 0"),
        (("--log", "a.mcap", "--ros2", "b.toml"), "--log and --ros2: one of them, or none for"),
        (("--log", "none.mcap"), "none.mcap: no such file"),
        (("--ros2", "autoware"), "autoware: endpoint must be named"),
        (("--connect", "tcp/127.0.0.1:1"), "--connect tcp/127.0.0.1:1: whoever reaches it may"),
        (("--connect", "tls/127.0.0.1:1"), "--connect tls/127.0.0.1:1: needs --secure FOLDER"),
        (("--connect", "tcp/127.0.0.1:1", "--insecure"), "nobody answers there: is the drive"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    lot: str,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    text: str,
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    given = ("second", "--anchor", lot, "--out", str(tmp_path), *words)
    assert text in said(capsys, *given)


def test_without_an_anchor_it_asks_for_one(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "--anchor" in said(capsys, "second")
    assert "no anchor file none.toml" in said(capsys, "second", "--anchor", "none.toml")


def test_a_name_that_is_none_is_refused(capsys: pytest.CaptureFixture[str], lot: str) -> None:
    assert "'a/b': one word, the id of one of" in said(capsys, "a/b", "--anchor", lot)


def test_who_has_no_seat_in_the_drive_here_is_told_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lot: str
) -> None:
    out = running(tmp_path / "runs", f"tcp/127.0.0.1:{free_port()}")
    line = said(capsys, "third", "--anchor", lot, "--out", str(out))
    assert "third has no seat here: seats are those of [[vehicles]] with live = true" in line


def test_a_drive_that_does_not_answer_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    out = running(tmp_path / "runs", endpoint := f"tcp/127.0.0.1:{free_port()}")
    line = said(capsys, "second", "--anchor", lot, "--out", str(out))
    assert f"nobody listens at {endpoint}" in line


@pytest.mark.parametrize(
    ("folder", "text"),
    [
        ("worker", "is of worker, not of a car"),
        ("none", "missing"),
    ],
)
def test_a_certificate_that_is_none_of_a_car_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lot: str, folder: str, text: str
) -> None:
    ours = campaign(tmp_path / "campaign")
    words = ("second", "--anchor", lot, "--connect", "tls/127.0.0.1:1")
    assert text in said(capsys, *words, "--secure", str(ours / folder))


def test_a_drive_over_a_network_wants_a_certificate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lot: str
) -> None:
    out = running(tmp_path / "runs", "tls/twin-pc:7447")
    line = said(capsys, "second", "--anchor", lot, "--out", str(out))
    assert "tls/twin-pc:7447: needs --secure FOLDER" in line
