"""The command `drive`: one drive, told of on stderr as it goes on; at its end its record."""

from __future__ import annotations

from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive import drive as driving
from foretwin.orchestrator.record.run_state import read_record


def drive(config: DriveConfig) -> CommandResult:
    """Drive to the end; its body is what run.json says of the run, with its folder before it."""
    code, folder = driving.drive(config)
    return CommandResult(lambda: {"folder": folder, **read_record(folder)}, code=code)
