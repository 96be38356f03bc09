"""Rogues on the bus of one host: with no, a wrong and another's password, and with their own. The
drive is untouched, and tells who was refused."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.credentials import (
    SOCKET,
    Credentials,
    credentials_file,
    read_credentials,
)
from foretwin.contracts.joining import RunningDrive, running_drive
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.zenoh_config import zenoh_config
from tests.system.foretwin_command import Finished, started
from tests.system.rogue_drives import Bus, assert_all_were_refused, play
from tests.system.test_faults import assert_nothing_left, under_way

LIVE = ("--futures", "6", "--rate", "1", "--tuning", "report")
NOBODY = 65534
CONNECTS = """
import os, socket, sys
os.setuid(int(sys.argv[1]))
try:
    socket.socket(socket.AF_UNIX).connect(sys.argv[2])
except PermissionError:
    print("refused")
"""


def config_of(drive: RunningDrive, credentials: str | None) -> Any:
    setup = BusSetup(endpoint=drive.endpoint, credentials=credentials)
    config = zenoh_config(setup, router=False)
    config.insert_json5("connect/timeout_ms", "600")
    return config


def shown(folder: Path, name: str, password: str) -> str:
    file = folder / f"{name}-{password}.json"
    file.touch(0o600)
    file.write_bytes(msgspec.json.encode(Credentials(user=name, password=password)))
    return str(file)


def bus_of(drive: RunningDrive, folder: Path) -> Bus:
    known = drive.credentials
    assert known is not None
    worker = read_credentials(credentials_file(known, "worker-w0"))
    strangers = {
        "no password": None,
        "a guessed password": shown(folder, "car-vehicle", "guessed"),
        "another role's password": shown(folder, "car-vehicle", worker.password),
        "a name that nobody has": shown(folder, "car", worker.password),
    }
    return Bus(
        "socket",
        as_member=lambda rogue: config_of(drive, str(credentials_file(known, rogue.user))),
        as_stranger=lambda shows: config_of(drive, strangers[shows]),
    )


def passwords_of(drive: RunningDrive) -> list[str]:
    assert drive.credentials is not None
    return [
        msgspec.json.decode(file.read_bytes(), type=Credentials).password
        for file in drive.credentials.glob("*.json")
    ]


def test_a_drive_on_its_own_socket_is_untouched_by_every_rogue(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE) as process:
        run = under_way(out)
        drive = running_drive(run)
        assert drive.credentials is not None
        if os.geteuid() == 0:  # the kernel refuses another user, so nobody can count it
            at = str(drive.credentials / SOCKET)
            other = [sys.executable, "-S", "-c", CONNECTS, str(NOBODY), at]
            said = subprocess.run(other, cwd="/", capture_output=True, text=True, check=False)
            assert said.stdout == "refused\n", said.stderr
        heard = play(bus_of(drive, tmp_path), run)
        passwords = passwords_of(drive)
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=240.0)
    assert_all_were_refused(Finished(process.returncode, screen, run), "socket", heard)
    assert len(passwords) > 8
    texts = [file.read_bytes() for file in run.rglob("*") if file.is_file()]
    assert not any(password.encode() in text for password in passwords for text in texts)
    assert not drive.credentials.exists()
    assert_nothing_left(run)
