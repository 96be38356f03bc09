"""`foretwin secure` makes a campaign, adds roles to it, and says what holds."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from foretwin.contracts.campaign import CAMPAIGN_ROLES, role_files
from foretwin.contracts.certificates import troubles
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.campaign.joining import LOCAL_ROLES
from foretwin.orchestrator.commands.cli import run
from tests.orchestrator.campaign.campaigns import campaign, expired, now

COVERS = ("foretwin.orchestrator.commands.cli_secure",)


def secure(*words: str) -> int:
    return run(["secure", *words])


def test_a_campaign_from_its_beginning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(tmp_path / "c")
    assert secure("init", "--folder", folder, "--host", "car-pc") == 0
    for role in set(CAMPAIGN_ROLES) - set(LOCAL_ROLES):
        assert not (tmp_path / "c" / role).exists()
        assert secure("add", role, "--folder", folder, "--days", "2") == 0
    capsys.readouterr()
    assert secure("show", "--folder", folder) == 0
    shown = capsys.readouterr().out
    assert all(f"{role}: until 20" in shown for role in CAMPAIGN_ROLES)
    assert "for localhost, 127.0.0.1, ::1, car-pc" in shown
    for role in CAMPAIGN_ROLES:
        assert list(troubles(role_files(tmp_path / "c", role), now=now())) == []


def test_a_campaign_that_cannot_be_begun_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(tmp_path / "c")
    assert secure("init", "--folder", folder, "--host", "twin-pc:7447") == 2
    assert "--host 'twin-pc:7447'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert secure("init", "--folder", folder, "--host", "twin-pc") == 0


def test_show_says_what_is_of_no_use_any_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "c"
    campaign(folder, age_days=3.0)
    issue(folder, "car", days=3, now=now() + datetime.timedelta(days=2))
    expired(folder, "viewer")
    capsys.readouterr()
    assert secure("show", "--folder", str(folder)) == 3
    faults = capsys.readouterr().err.splitlines()
    assert len(faults) == 2
    assert any("viewer/certificate.pem: expired" in line for line in faults)
    assert any("which is before the certificate begins" in line for line in faults)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("add", "cat"), "role 'cat': one of router, orchestrator"),
        (("add", "car"), "certificates are made where the campaign began"),
        (("show",), "missing; foretwin secure init"),
        (("init", "--days", "0"), "--days 0: 1 to 366"),
        (("init", "--campaign-days", "0"), "--campaign-days 0: 1 to 366"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert secure(*words, "--folder", str(tmp_path / "c")) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert not (tmp_path / "c").exists()
