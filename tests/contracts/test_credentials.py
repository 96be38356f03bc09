"""Where passwords lie: in a folder that is this user's alone, or nowhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.credentials import (
    bus_folder,
    make_credentials,
    read_credentials,
    runtime_folder,
)
from foretwin.contracts.errors import UserError


def test_the_folder_of_a_bus_is_made_below_the_systems_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = bus_folder("r1")
    assert folder == tmp_path / "foretwin" / "r1"
    assert {one.stat().st_mode & 0o777 for one in (folder, folder.parent)} == {0o700}


def test_without_a_session_it_is_in_the_temporary_folder_of_this_user(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    assert runtime_folder().name.startswith("foretwin-")
    assert runtime_folder().parent == Path("/tmp")


@pytest.mark.parametrize("mode", [0o755, 0o770, 0o701])
def test_a_folder_that_others_can_open_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "foretwin").mkdir()
    (tmp_path / "foretwin").chmod(mode)
    with pytest.raises(UserError, match="of this user alone"):
        runtime_folder()


def test_a_link_in_its_place_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / "foretwin").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UserError, match="of this user alone"):
        runtime_folder()


def test_a_path_that_no_socket_can_have_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(UserError, match="longer than the 107 bytes"):
        bus_folder("r" * 100)
    assert not (tmp_path / "foretwin" / ("r" * 100)).exists()


def test_who_has_laid_a_file_in_the_place_of_a_password_learns_none(tmp_path: Path) -> None:
    (tmp_path / "a.json").touch(0o666)
    with pytest.raises(FileExistsError):
        make_credentials(tmp_path, ["a"])
    assert (tmp_path / "a.json").read_bytes() == b""


def test_a_password_that_others_can_read_is_refused(tmp_path: Path) -> None:
    make_credentials(tmp_path, ["a"])
    (tmp_path / "a.json").chmod(0o644)
    with pytest.raises(UserError, match="others can read it"):
        read_credentials(tmp_path / "a.json")


def test_what_is_no_password_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.json").touch(0o600)
    for file in (tmp_path / "a.json", tmp_path / "b.json"):
        with pytest.raises(UserError, match="no credentials for a bus"):
            read_credentials(file)


def test_where_no_folder_can_be_it_says_why_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "file"))
    with pytest.raises(UserError) as refused:
        runtime_folder()
    assert str(refused.value) == f"{tmp_path / 'file' / 'foretwin'}: not a directory"
