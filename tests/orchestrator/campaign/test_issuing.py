"""The authority of a campaign: short-lived certificates, each for one role and one purpose."""

from __future__ import annotations

import datetime
import os
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from foretwin.contracts.campaign import AUTHORITY, CAMPAIGN_ROLES, CERTIFICATE, role_files
from foretwin.contracts.certificates import read_certificate, troubles
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.campaign.issuing import LOCAL_HOSTS, issue, make_authority
from tests.orchestrator.campaign.campaigns import campaign, now

DAY = datetime.timedelta(days=1)


def test_every_role_is_whom_its_certificate_names(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    for role in CAMPAIGN_ROLES:
        files = role_files(folder, role)
        assert read_certificate(Path(files.certificate)).name == role
        assert list(troubles(files, now=now())) == []


def test_the_router_alone_serves_and_nobody_else_can_pose_as_it(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    for role in CAMPAIGN_ROLES:
        data = (folder / role / CERTIFICATE).read_bytes()
        certificate = x509.load_pem_x509_certificate(data)
        (purpose,) = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        serves = purpose == ExtendedKeyUsageOID.SERVER_AUTH
        assert serves is (role == "router")
        assert purpose in (ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH)
        limits = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value
        assert not limits.ca


def test_all_files_are_their_owners_alone_whatever_the_umask_is(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        folder = campaign(tmp_path / "c")
    finally:
        os.umask(before)
    for path in (folder, *folder.rglob("*")):
        wanted = 0o700 if path.is_dir() else 0o600
        assert path.stat().st_mode & 0o777 == wanted, path
    assert not list(folder.rglob("*.partial"))


def test_no_certificate_outlives_its_campaign(tmp_path: Path) -> None:
    folder = tmp_path / "c"
    make_authority(folder, name="c", days=2, now=now())
    issue(folder, "car", days=300, now=now())
    ends = [read_certificate(folder / name).last for name in (AUTHORITY, f"car/{CERTIFICATE}")]
    assert ends[0] == ends[1]


def test_a_certificate_holds_for_its_days_and_began_a_moment_ago(tmp_path: Path) -> None:
    folder, begun = campaign(tmp_path / "c"), now()
    issue(folder, "car", days=3, now=begun)
    car = read_certificate(folder / "car" / CERTIFICATE)
    assert abs((car.last - begun) - 3 * DAY) < DAY / 1000
    assert begun - DAY / 100 < car.first < begun


def test_renewing_makes_another_key(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    first = Path(role_files(folder, "car").key).read_bytes()
    issue(folder, "car", days=1, now=now())
    assert Path(role_files(folder, "car").key).read_bytes() != first
    assert list(troubles(role_files(folder, "car"), now=now())) == []


def test_the_router_stands_for_its_hosts(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    issue(folder, "router", days=1, now=now(), hosts=("car-pc", "10.0.0.7", "[fd00::7]"))
    hosts = read_certificate(folder / "router" / CERTIFICATE).hosts
    assert hosts == (*LOCAL_HOSTS, "car-pc", "10.0.0.7", "fd00::7")


def test_a_renewed_router_stands_for_the_same_hosts_and_for_more(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    issue(folder, "router", days=1, now=now(), hosts=("car-pc",))
    issue(folder, "router", days=1, now=now())
    issue(folder, "router", days=1, now=now(), hosts=("10.0.0.7", "car-pc"))
    hosts = read_certificate(folder / "router" / CERTIFICATE).hosts
    assert hosts == (*LOCAL_HOSTS, "car-pc", "10.0.0.7")
    (folder / "router" / CERTIFICATE).write_text("torn")
    issue(folder, "router", days=1, now=now())
    assert read_certificate(folder / "router" / CERTIFICATE).hosts == LOCAL_HOSTS


NO_HOSTS = (
    "",
    "twin-pc:7447",
    "tls/twin-pc",
    "twin pc",
    "*.car.local",
    "a..b",
    "-a",
    "Straße",
    "a\n",
)


@pytest.mark.parametrize("host", NO_HOSTS)
def test_what_names_no_host_is_refused(tmp_path: Path, host: str) -> None:
    folder = campaign(tmp_path / "c")
    with pytest.raises(UserError, match="a host's name or address alone"):
        issue(folder, "router", days=1, now=now(), hosts=(host,))


def test_what_cannot_be_made_is_said_in_a_line(tmp_path: Path) -> None:
    folder = campaign(tmp_path / "c")
    with pytest.raises(UserError, match="a new one needs a new folder"):
        make_authority(folder, name="c", days=1, now=now())
    with pytest.raises(UserError, match="--host is of the router alone"):
        issue(folder, "car", days=1, now=now(), hosts=("x",))
    with pytest.raises(UserError, match="--host 'Straße"):
        issue(folder, "router", days=1, now=now(), hosts=("Straße 1",))
    for days in (0, 367):
        with pytest.raises(UserError, match=f"--days {days}: 1 to 366"):
            issue(folder, "car", days=days, now=now())
        with pytest.raises(UserError, match=f"--campaign-days {days}: 1 to 366"):
            make_authority(tmp_path / "d", name="d", days=days, now=now())
    with pytest.raises(UserError, match="the campaign ended"):
        issue(folder, "car", days=1, now=now() + 31 * DAY)
    with pytest.raises(UserError, match="clock says 1970-01-01 00:05"):
        issue(folder, "car", days=1, now=datetime.datetime(1970, 1, 1, 0, 5, tzinfo=datetime.UTC))
    (folder / "ca.key").write_text("torn")
    with pytest.raises(UserError, match=r"ca\.key: no private key"):
        issue(folder, "car", days=1, now=now())
    (folder / "ca.key").unlink()
    with pytest.raises(UserError, match="made where the campaign began"):
        issue(folder, "car", days=1, now=now())
