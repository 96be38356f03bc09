"""A role's files are found whole, or the line says what is missing and what makes it."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.campaign import (
    CAMPAIGN_ROLES,
    certificate_in,
    named_workers,
    role_files,
    worker_name,
)
from foretwin.contracts.errors import UserError


def role_folder(campaign: Path, role: str) -> Path:
    folder = campaign / role
    folder.mkdir(parents=True)
    for name in ("ca.pem", "certificate.pem", "key.pem"):
        (folder / name).write_text(name)
        (folder / name).chmod(0o600)
    return folder


@pytest.mark.parametrize("role", CAMPAIGN_ROLES)
def test_a_roles_files_are_named_whole(tmp_path: Path, role: str) -> None:
    folder = role_folder(tmp_path, role)
    files = role_files(tmp_path, role)
    assert files == certificate_in(folder)
    assert [Path(one).read_text() for one in (files.authority, files.certificate, files.key)] == [
        "ca.pem", "certificate.pem", "key.pem"
    ]  # fmt: skip


@pytest.mark.parametrize("missing", ["ca.pem", "certificate.pem", "key.pem"])
def test_what_is_missing_is_named_with_what_makes_it(tmp_path: Path, missing: str) -> None:
    (role_folder(tmp_path, "car") / missing).unlink()
    with pytest.raises(UserError, match=f"{missing}: missing; `foretwin secure add car --folder"):
        role_files(tmp_path, "car")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_key_that_others_may_read_is_none(tmp_path: Path, mode: int) -> None:
    (role_folder(tmp_path, "car") / "key.pem").chmod(mode)
    with pytest.raises(UserError, match=f"mode 0{mode & 0o77:02o}"):
        role_files(tmp_path, "car")


def test_a_machine_has_a_role_of_its_own(tmp_path: Path) -> None:
    assert worker_name("worker-laptop2") == "laptop2"
    assert [worker_name(one) for one in ("worker", "worker-", "worker-a-b", "worker-A", "car")] == (
        [None] * 5
    )
    for name in ("worker-b", "worker-a", "worker", "worker-a-b"):
        (tmp_path / name).mkdir()
    (tmp_path / "worker-file").write_text("")
    assert named_workers(tmp_path) == ("worker-a", "worker-b")
