"""Another seat: how it joins a drive, where its page may be, and what a run that is over shows."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.credentials import make_credentials
from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import RunningDrive
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.setup import ViewerSetup, write_setup
from foretwin.orchestrator.commands import watch as command
from foretwin.orchestrator.commands.watch import WatchRequest, watch, watch_setup
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer.copilot.test_replayed import run_with_frames
from tests.viewer.scene import DRIVE_FRAME

COVERS = ("foretwin.orchestrator.commands.cli_watch",)


@pytest.fixture
def drive(tmp_path: Path) -> RunningDrive:
    """A drive that goes on, as far as its files say."""
    folder = tmp_path / "runs" / "r1"
    (folder / "processes").mkdir(parents=True)
    setup = ViewerSetup(
        run_id="r1",
        process_id="viewer",
        vehicle_id="ego",
        bus=BusSetup(endpoint="x"),
        log_file="x",
        file="x",
        worlds_dir=str(folder / "worlds"),
        drive_frame=DRIVE_FRAME,
        start_stamp_ns=7,
    )
    write_setup(setup, folder / "processes" / "viewer.json")
    make_credentials(tmp_path, ["viewer-watch", "operator"])
    return RunningDrive("r1", folder, "unixsock-stream/x", tmp_path)


def request(tmp_path: Path, **fields: Any) -> WatchRequest:
    return WatchRequest(**{"run": None, "out": tmp_path / "runs", **fields})


def test_a_seat_is_a_viewer_on_this_machine_that_nobody_waits_for(
    drive: RunningDrive, tmp_path: Path
) -> None:
    setup = watch_setup(drive, request(tmp_path, name="back seat"), tmp_path)
    assert setup.bus.credentials == str(tmp_path / "viewer-watch.json")
    assert (setup.host, setup.page_tls, setup.operator) == ("127.0.0.1", None, None)
    assert (setup.awaited, setup.seat, setup.start_stamp_ns) == (False, "back seat", 7)
    assert setup.drive_frame == DRIVE_FRAME
    assert setup.frames_file is None, "the drive's own display keeps what it showed"


def test_who_operates_joins_as_the_operator_as_well(drive: RunningDrive, tmp_path: Path) -> None:
    setup = watch_setup(drive, request(tmp_path, operate=True), tmp_path)
    assert setup.operator is not None
    assert setup.operator.credentials == str(tmp_path / "operator.json")


def test_the_page_may_be_at_another_port_of_this_machine(
    drive: RunningDrive, tmp_path: Path
) -> None:
    setup = watch_setup(drive, request(tmp_path, listen="localhost:8111"), tmp_path)
    assert (setup.host, setup.port, setup.page_tls) == ("localhost", 8111, None)


def test_over_a_network_it_is_with_certificates_and_as_a_viewer_alone(
    drive: RunningDrive, tmp_path: Path
) -> None:
    listen = "0.0.0.0:8111"
    with pytest.raises(UserError, match="with --secure FOLDER alone"):
        watch_setup(drive, request(tmp_path, listen=listen), tmp_path)
    with pytest.raises(UserError, match="not over a network"):
        watch_setup(
            drive, request(tmp_path, listen=listen, secure=tmp_path, operate=True), tmp_path
        )


@pytest.mark.parametrize("listen", ["8111", "host:", "host:0", "host:99999", ":8111"])
def test_what_is_no_place_is_said(drive: RunningDrive, tmp_path: Path, listen: str) -> None:
    with pytest.raises(UserError, match=r"--listen .*: must be HOST:PORT"):
        watch_setup(drive, request(tmp_path, listen=listen), tmp_path)


def test_a_drive_on_a_secure_bus_is_joined_by_a_viewers_certificate(
    drive: RunningDrive, tmp_path: Path
) -> None:
    secure = drive._replace(endpoint="tls/host:7447", credentials=None)
    with pytest.raises(UserError, match="certificate of the viewer"):
        watch_setup(secure, request(tmp_path), tmp_path)


def test_a_run_that_is_over_is_shown_again_on_this_machine_alone(
    drive: RunningDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (drive.folder / "run.json").write_text(json.dumps({"run_id": "r1", "exit": "completed"}))
    started: list[tuple[str, ...]] = []
    monkeypatch.setattr(command, "_run", lambda *what: started.append(what) or 0)
    assert watch(request(tmp_path, run=Path("r1"))) == 0
    assert started[0][:2] == ("--replay", str(drive.folder))
    with pytest.raises(UserError, match="shown again on this machine alone"):
        watch(request(tmp_path, run=Path("r1"), operate=True))
    with pytest.raises(UserError, match="no drive is running"):
        watch(request(tmp_path))


@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGINT])
def test_a_display_that_somebody_ends_is_closed_and_not_interrupted(
    tmp_path: Path, by: signal.Signals
) -> None:
    shown = run_with_frames(tmp_path / "r1")
    (shown / "run.json").write_text(json.dumps({"run_id": "r1", "exit": "completed"}))
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "foretwin", "watch", str(shown)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as watching:  # fmt: skip
        assert watching.stdout is not None
        assert "co-pilot display: http" in watching.stdout.readline()
        watching.send_signal(by)
        _, said = watching.communicate(timeout=DEADLINE_S)
    assert (watching.returncode, said) == (0, "")
