"""What is wrong with a certificate is said in a line that tells what to do."""

from __future__ import annotations

import datetime
import shutil
from pathlib import Path

import pytest

from foretwin.contracts.campaign import role_files
from foretwin.contracts.certificates import host_trouble, read_certificate, troubles
from foretwin.contracts.errors import UserError
from tests.orchestrator.campaign.campaigns import campaign, expired, now


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return campaign(tmp_path_factory.mktemp("campaigns") / "ours")


def test_a_machine_that_woke_in_1970_is_told_to_set_its_clock(ours: Path) -> None:
    woken = datetime.datetime(1970, 1, 1, 0, 3, tzinfo=datetime.UTC)
    lines = list(troubles(role_files(ours, "car"), now=woken))
    assert len(lines) == 2  # the campaign's own certificate, and the role's
    for line in lines:
        assert "this machine's clock says 1970-01-01 00:03 UTC" in line
        assert "set the clock (timedatectl set-ntp true)" in line


def test_an_expired_certificate_is_told_apart_from_a_wrong_clock(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "old", age_days=3.0)
    (line,) = troubles(expired(folder, "car"), now=now())
    assert "expired" in line
    assert "foretwin secure add car" in line


def test_a_certificate_of_another_campaign_is_named(ours: Path, tmp_path: Path) -> None:
    other = campaign(tmp_path / "other")
    shutil.copy(ours / "ca.pem", other / "car" / "ca.pem")
    (line,) = troubles(role_files(other, "car"), now=now())
    assert "made by another authority than" in line


def test_a_key_of_another_certificate_is_named(ours: Path, tmp_path: Path) -> None:
    mixed = tmp_path / "car"
    shutil.copytree(ours / "car", mixed)
    shutil.copy(ours / "viewer" / "key.pem", mixed / "key.pem")
    (line,) = troubles(role_files(tmp_path, "car"), now=now())
    assert line.endswith(f"not the key of {mixed / 'certificate.pem'}")
    (mixed / "key.pem").write_text("torn")
    (line,) = troubles(role_files(tmp_path, "car"), now=now())
    assert "no private key" in line


def test_no_certificate_at_all_is_the_users_to_mend(tmp_path: Path) -> None:
    (tmp_path / "a.pem").write_bytes(b"hello")
    with pytest.raises(UserError, match=r"a\.pem: no certificate"):
        read_certificate(tmp_path / "a.pem")


def test_a_router_stands_for_its_hosts_alone(ours: Path) -> None:
    files = role_files(ours, "router")
    assert host_trouble(files, "localhost") is None
    for same in ("LocalHost", "[::1]", "[0:0:0:0:0:0:0:1]"):  # TLS takes them for the same
        assert host_trouble(files, same) is None
    line = host_trouble(files, "0.0.0.0")
    assert line is not None
    assert "foretwin secure add router --host 0.0.0.0" in line
    assert host_trouble(role_files(ours, "car"), "localhost") is not None
