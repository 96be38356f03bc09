"""`foretwin set KEY=VALUE`: finds the running drive and asks it to change."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.bus import Bus, BusUnreachable, ZenohBus, ask
from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import RunningDrive, newest_running, running_drive
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.tuning import SetReply, SetRequest
from foretwin.orchestrator.campaign.joining import own_certificate
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.which_run import run_folder

ANSWER_S = 120.0
"""A change waits for the drive to begin and for the round in progress; that may take a while."""


def set_in_drive(
    assignment: str, *, run: Path | None, out: Path, secure: Path | None = None
) -> CommandResult:
    """Ask the drive `run`, or the newest running one below `out`; returns what counts now.

    Raises UserError, in one line, where the assignment or the run cannot be used or the drive
    refuses.
    """
    key, equals, value = assignment.partition("=")
    if not (equals and key.strip() and value.strip()):
        raise UserError(f"{assignment}: must be KEY=VALUE, such as role.ego=shadow")
    drive = newest_running(out) if run is None else running_drive(run_folder(run, out))
    request = SetRequest(key=key.strip(), value=value.strip())
    try:
        with ZenohBus(_bus_of(drive, secure)) as bus:
            text = ask_drive(bus, drive.run_id, request)
            return CommandResult({"run": drive.run_id, "now": text}, f"{drive.run_id}: {text}")
    except BusUnreachable as error:
        if drive.endpoint.startswith("tls/"):
            raise UserError(f"{drive.folder}: {error}") from None
        raise UserError(
            f"{drive.folder}: nobody listens at {drive.endpoint}, though the drive goes on"
        ) from None


def _bus_of(drive: RunningDrive, secure: Path | None) -> BusSetup:
    """Return how to reach a drive; over a network as its operator."""
    if not drive.endpoint.startswith("tls/"):
        return drive.bus("operator")
    if secure is None:
        raise UserError(
            f"{drive.folder}: the drive listens at {drive.endpoint}: --secure FOLDER, with the "
            "operator's certificate (foretwin secure add operator)"
        )
    return BusSetup(endpoint=drive.endpoint, tls=own_certificate(secure, "operator"))


def ask_drive(bus: Bus, run_id: str, request: SetRequest, *, timeout_s: float = ANSWER_S) -> str:
    """Return what counts now; raises UserError where the drive refuses or does not answer."""
    try:
        reply: SetReply = ask(bus, "set", request, timeout_s=timeout_s, run=run_id)
    except TimeoutError as silent:
        raise UserError(f"run {run_id} does not answer: {silent}") from None
    if not reply.done:
        raise UserError(reply.text)
    return reply.text
