"""What a drive of the chaos is made of besides itself: what its car drives, and a log of it."""

from __future__ import annotations

import functools
import io
import json
import tempfile
from pathlib import Path

from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.plan import MAP_FILE, read_inputs
from foretwin.telemetry.logs.write_mcap import DriveWriter
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import read_path
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.chaos.faults import DRIVING_S

TOWN = MAP_FILE
END_S = DRIVING_S + 4.0


@functools.cache
def _town_path() -> str:
    standin = read_inputs(DriveConfig(source="standin")).standin
    assert standin is not None
    return json.dumps(standin.as_json())


def path_file(folder: Path) -> Path:
    """Write what a car drives: the route of the drawn town."""
    file = folder / "path.json"
    file.write_text(_town_path(), encoding="utf-8")
    return file


def log_file(folder: Path) -> Path:
    """Write a recorded drive of the town: the stand-in car's samples."""
    file = folder / "log.mcap"
    file.write_bytes(recorded())
    return file


@functools.cache
def recorded(end_s: float = END_S) -> bytes:
    """Return the stand-in car's whole drive as it is recorded."""
    parameters = read_parameters(None)
    with tempfile.TemporaryDirectory() as folder:
        path = read_path(path_file(Path(folder)), driver=parameters.driver)
        source = StandinSource(path, parameters, vehicle_id="ego", end_s=end_s)
        file = Path(folder) / "log.mcap"
        with io.FileIO(file, "w") as raw, DriveWriter(raw, info=source.info) as writer:
            for channel, message in source.advance(START_STAMP_NS + round(end_s * 1e9)):
                writer.add(channel, message)
        return file.read_bytes()
