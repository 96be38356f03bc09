"""The bus of one host: a socket of this user's, else the loopback with the same passwords."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.local_bus import make_local_bus, member_of, private_files

MEMBERS = (member_of("worker", "w0"), member_of("orchestrator", "orchestrator"))


def open_below(folder: Path) -> list[Path]:
    """Return the files below a folder that this process has open, removed ones too."""
    files = [Path(os.path.realpath(one)) for one in Path("/proc/self/fd").iterdir()]
    return [file for file in files if file.is_relative_to(folder)]


def test_members_meet_on_a_socket_that_nobody_else_can_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    local = make_local_bus("b", MEMBERS, run_id="r1", lossless=True, instead=tmp_path / "run")
    assert (local.trouble, local.router.lossless) == ("", True)
    with private_files():
        router = ZenohBus(local.router, router=True)
    with router:
        socket = local.folder / "bus"
        assert socket.is_socket()
        assert socket.stat().st_mode & 0o077 == 0
        for one in MEMBERS:
            with ZenohBus(local.setup_of(one.name)) as bus:
                assert bus.connected
    assert open_below(local.folder)
    local.remove()
    assert not local.folder.exists()
    assert not open_below(local.folder)


def test_where_there_can_be_no_socket_it_says_why_and_is_on_the_loopback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / ("x" * 120)))
    (tmp_path / ("x" * 120)).mkdir()
    local = make_local_bus("b", MEMBERS, run_id="r1", lossless=False, instead=tmp_path / "run")
    assert "longer than the 107 bytes" in local.trouble
    assert local.router.endpoint.startswith("tcp/127.0.0.1:")
    with (
        ZenohBus(local.router, router=True),
        ZenohBus(local.setup_of("worker-w0")) as bus,
    ):
        assert bus.connected
    assert local.folder.stat().st_mode & 0o777 == 0o700


def test_the_passwords_of_a_killed_run_go_with_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def made(name: str) -> Path:
        return make_local_bus(
            name, MEMBERS, run_id="r1", lossless=True, instead=tmp_path / name
        ).folder

    process = os.fork()
    if not process:
        made("killed")
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(process, 0)
    killed = tmp_path / "foretwin" / "killed"
    assert (killed / "users").exists()
    first = make_local_bus("first", MEMBERS, run_id="r1", lossless=True, instead=tmp_path / "a")
    assert not killed.exists()
    second = make_local_bus("second", MEMBERS, run_id="r1", lossless=True, instead=tmp_path / "b")
    assert first.folder.exists()  # its owner lives
    for one in (first, second):
        one.remove()
    assert list((tmp_path / "foretwin").iterdir()) == []


def test_a_process_is_named_with_its_role_unless_it_is_the_only_one_of_it() -> None:
    named = [("orchestrator", "orchestrator"), ("worker", "w0"), ("worker", "z9"), ("car", "a")]
    assert [member_of(role, process).name for role, process in named] == [  # type: ignore[arg-type]
        "orchestrator", "worker-w0", "worker-z9", "car-a",
    ]  # fmt: skip
    assert member_of("car", "a", vehicle_id="ego") == ("car-a", "car", "a", "ego", ())
