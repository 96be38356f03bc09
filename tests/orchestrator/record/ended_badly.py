"""A run's folder as a kill leaves it: streams, a record that says running, a recording."""

from __future__ import annotations

import json
from pathlib import Path

from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import GeoPoint
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_streams import RunStreams
from foretwin.telemetry.logs.write_mcap import create

ROUNDS = 3


def killed_run(folder: Path, *, seconds: int = 5) -> Path:
    """Write what a drive left that was killed, with a recording of so many seconds."""
    for sub in ("results", "worlds", "processes"):
        (folder / sub).mkdir(parents=True)
    (folder / "run.json").write_text(
        json.dumps({"run_id": "r1", "exit": "running", "seed": 7, "endpoint": "tcp/x:1"})
    )
    (folder / "processes" / "w0.stderr").write_text("what it said last\n")
    told = {name: schema.with_metadata({"run_id": "r1"}) for name, schema in TABLES.items()}
    streams = RunStreams(folder / "results", told)
    for number in range(ROUNDS):
        streams.take("rounds", [round_row(number)])
        streams.take("events", [event(number)])
        streams.write(sync=True)
    streams.close()
    record(folder / "drive.mcap", seconds)
    return folder


def round_row(number: int) -> dict[str, object]:
    return {
        "round_id": number, "stamp_ns": number * 500_000_000, "drive_time_s": number * 0.5,
        "futures": 12, "distinct": 10 + number, "latency_ms": 100.0 + number, "sim_seconds": 96.0,
        "cpu_seconds": 0.25, "sha256": f"{number:064x}",
    }  # fmt: skip


def event(number: int) -> dict[str, object]:
    return {"stamp_ns": number, "level": "info", "source": "test", "text": f"event {number}"}


def record(file: Path, seconds: int) -> None:
    info = VehicleInfo(vehicle_id="car", time_base="utc", start_stamp_ns=0, sends=("gnss",))
    with create(file, info=info) as writer:
        for second in range(seconds):
            place = GeoPoint(50.0, 8.0 + 1e-4 * second)
            writer.add("gnss", GnssFix(stamp_ns=second * 1_000_000_000, position=place))
            writer.flush()
