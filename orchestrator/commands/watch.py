"""The command `watch`: the co-pilot display of a drive that goes on, or of one that is over."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.campaign import role_files
from foretwin.contracts.certificates import host_trouble
from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import RunningDrive, newest_running, running_drive
from foretwin.contracts.local_bus import WATCH
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.page_address import USUAL_PORT
from foretwin.contracts.ports import LOOPBACK, LOOPBACKS, free_or, listen_place
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.setup import CopilotSetup, ViewerSetup, read_setup, write_setup
from foretwin.orchestrator.campaign.joining import own_certificate
from foretwin.orchestrator.drive.exit_words import EXIT_DONE
from foretwin.orchestrator.record.run_state import RUNNING, read_record
from foretwin.orchestrator.record.which_run import run_folder

MODULE = "foretwin.viewer.copilot"


class WatchRequest(NamedTuple):
    """What the command line says."""

    run: Path | None
    out: Path
    listen: str | None = None
    secure: Path | None = None
    operate: bool = False
    name: str = "watch"


def watch(request: WatchRequest) -> int:
    """Serve the display until the drive is over or somebody ends it; returns an exit code.

    Raises UserError for what cannot be used.
    """
    folder = None if request.run is None else run_folder(request.run, request.out)
    if folder is not None and read_record(folder)["exit"] != RUNNING:
        if request.listen is not None or request.operate:
            raise UserError(f"{folder}: is over, and shown again on this machine alone")
        return _run("--replay", str(folder), "--port", str(free_or(USUAL_PORT)))
    drive = newest_running(request.out) if folder is None else running_drive(folder)
    with temporary_folder("foretwin-watch-") as made:
        setup = watch_setup(drive, request, made)
        file = made / "watch.json"
        write_setup(setup, file)
        return _run("--setup", str(file))


def watch_setup(drive: RunningDrive, request: WatchRequest, made: Path) -> CopilotSetup:
    """Return how the display's process is set; its log lies in the folder `made`."""
    viewer = read_setup(drive.folder / "processes" / "viewer.json", ViewerSetup)
    host, port, page_tls = LOOPBACK, None, None
    if request.listen is not None:
        host, port = listen_place(request.listen)
        if host not in LOOPBACKS:
            if request.secure is None:
                raise UserError(
                    f"--listen {request.listen}: over a network with --secure FOLDER alone "
                    "(foretwin secure init)"
                )
            if request.operate:
                raise UserError("--operate: not over a network, where nobody asks who looks on")
            page_tls = role_files(request.secure, "router")
            if trouble := host_trouble(page_tls, host):
                raise UserError(trouble)
    return CopilotSetup(
        run_id=drive.run_id,
        process_id="watch",
        vehicle_id=viewer.vehicle_id,
        bus=_bus_of(drive, request.secure, WATCH, "viewer"),
        log_file=str(made / "watch.jsonl"),
        drive_frame=viewer.drive_frame,
        worlds_dir=viewer.worlds_dir,
        start_stamp_ns=viewer.start_stamp_ns,
        attribution=viewer.attribution,
        host=host,
        port=free_or(USUAL_PORT) if port is None else port,
        seat=request.name,
        operator=_bus_of(drive, request.secure, "operator", "operator")
        if request.operate
        else None,
        page_tls=page_tls,
        awaited=False,
    )


def _bus_of(drive: RunningDrive, secure: Path | None, user: str, role: str) -> BusSetup:
    """Return how to join; over a network by the certificate of a role."""
    if not drive.endpoint.startswith("tls/"):
        return drive.bus(user)
    if secure is None:
        raise UserError(
            f"{drive.folder}: the drive listens at {drive.endpoint}: --secure FOLDER, with the "
            f"certificate of the {role}"
        )
    return BusSetup(
        endpoint=drive.endpoint,
        tls=own_certificate(secure, "operator" if role == "operator" else "viewer"),
    )


def _run(*arguments: str) -> int:
    """Run the display's process until it ends, or somebody ends this one: so a display is closed,
    and nothing is interrupted by it."""
    process = subprocess.Popen([sys.executable, "-P", "-m", MODULE, *arguments])
    try:
        return process.wait()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        return EXIT_DONE
