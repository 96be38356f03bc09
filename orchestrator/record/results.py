"""The run's tables: Parquet files written by a thread of their own: no disk blocks a drive."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.errors import one_line
from foretwin.orchestrator.record.job_tables import JOB_TABLES, metric_rows, played_with

log = logging.getLogger("results")

_F, _I, _S, _B = pa.float64(), pa.int64(), pa.string(), pa.bool_()
_ERROR = ("ade_m", "fde_m", "lateral_m", "longitudinal_m", "heading_rad")

_CORRECTION = [(f"correction_{what}", _F) for what in ("along_mps2", "across_mps2", "yaw_radps2")]


def _poses(*names: str) -> list[tuple[str, pa.DataType]]:
    pose = ("x_m", "y_m", "yaw_rad", "speed_mps")
    return [(f"{name}_{what}", _F) for name in names for what in pose]


TABLES: dict[str, pa.Schema] = {
    "rounds": pa.schema(
        [
            ("round_id", _I), ("stamp_ns", _I), ("drive_time_s", _F), ("intersection_id", _S),
            ("world_id", _S), ("futures", _I), ("distinct", _I), ("collided", _I),
            ("cruise_speed_mps", _F), ("latency_ms", _F), ("sim_seconds", _F), ("cpu_seconds", _F),
            ("sha256", _S), ("vehicle_version", _I),
        ]
    ),
    **JOB_TABLES,
    "comparisons": pa.schema(
        [("round_id", _I), ("stamp_ns", _I), ("intersection_id", _S), ("horizon_s", _F)]
        + [
            (f"{who}_{what}", _F)
            for who in ("nominal", "constant_velocity", "constant_turn_rate")
            for what in _ERROR
        ]
    ),
    "plan_comparisons": pa.schema(
        [("round_id", _I), ("stamp_ns", _I), ("plan_stamp_ns", _I), ("horizon_s", _F)]
        + [(what, _F) for what in _ERROR]
        + [("path_offset_m", _F)]
    ),
    "disagreements": pa.schema(
        [
            ("vehicle_id", _S), ("segment", _I), ("aspect", _S), ("kind", _S), ("stamp_ns", _I),
            ("end_stamp_ns", _I), ("duration_s", _F), ("lat_deg", _F), ("lon_deg", _F),
            ("junction_id", _S), ("route_m", _F), ("lateral_m", _F), ("along_m", _F),
            ("speed_mps", _F),
        ]
    ),
    "driven_segments": pa.schema(
        [
            ("number", _I), ("control_mode", _S), ("from_stamp_ns", _I), ("to_stamp_ns", _I),
            ("plans", _I), ("cut", _I), ("too_short", _I), ("lateral_m", _F), ("along_m", _F),
            ("speed_mps", _F), ("disagreements", _I),
        ]
    ),
    "agreement": pa.schema(
        [
            ("round_id", _I), ("stamp_ns", _I), ("drive_time_s", _F), ("intersection_id", _S),
            ("outcome", _S), ("observable", _S), ("simulated_fails", _S), ("driven_fails", _S),
            ("gap_along_m", _F), ("gap_across_m", _F),
            *((f"flip_{direction}_{what}", _F) for direction in ("along", "across", "both")
              for what in ("factor", "m")),
            *((f"flip_{direction}_fails", _S) for direction in ("along", "across", "both")),
        ]
    ),
    "mirror": pa.schema(
        [
            ("stamp_ns", _I), ("world_id", _S),
            *_poses("real", "twin", "shadow", "ghost", "free"),
            ("gap_m", _F), ("gap_along_m", _F), ("gap_across_m", _F), ("gap_yaw_rad", _F),
            ("gap_speed_mps", _F), ("since_reset_s", _F), ("independent", _B),
            ("role", _S), *_CORRECTION,
        ]
    ),
    "mirrored": pa.schema(
        [
            ("stamp_ns", _I), ("vehicle_id", _S), ("role", _S), *_poses("real", "shown"),
            *_CORRECTION,
        ]
    ),
    "touches": pa.schema([("stamp_ns", _I), ("one", _S), ("other", _S)]),
    "changes": pa.schema(
        [("stamp_ns", _I), ("asked_stamp_ns", _I), ("key", _S), ("before", _S), ("value", _S)]
    ),
    "parameters": pa.schema(
        [
            ("version", _I), ("stamp_ns", _I), ("name", _S), ("before", _F), ("value", _F),
            ("std", _F), ("origin", _S), ("pinned", _B),
        ]
    ),
    "identifications": pa.schema(
        [
            ("stamp_ns", _I), ("from_stamp_ns", _I), ("name", _S), ("value", _F), ("low", _F),
            ("high", _F), ("prior", _F), ("reason", _S), ("taken", _B),
        ]
    ),
    "gaps": pa.schema(
        [("stamp_ns", _I), ("horizon_s", _F), ("manoeuvre", _S)]
        + [
            (what, _F)
            for what in (
                "along_m", "across_m", "yaw_rad", "yaw_rate_radps", "speed_mps", "accel_mps2",
            )
        ]
        + [("independent", _B)]
    ),
    "verdicts": pa.schema(
        [
            ("stamp_ns", _I), ("since_stamp_ns", _I), ("culprit", _S), ("cause", _S), ("text", _S),
            ("evidence", _S), ("confidence", _F),
        ]
    ),
    "events": pa.schema([("stamp_ns", _I), ("level", _S), ("source", _S), ("text", _S)]),
}  # fmt: skip
"""Every table of `results/` with its columns."""

FLUSH_ROWS, FLUSH_JOBS = 2000, 128
QUEUE_DEPTH = 4096
CLOSE_S, LOCK_STEP_CLOSE_S = 10.0, 120.0
"""How long the last rows may take to be written, live and where nothing may be missing."""


class ResultTables:
    """Collects rows and writes them; `add` never raises, and blocks in lock step alone."""

    def __init__(
        self, folder: Path, metadata: Mapping[str, str], *, lossless: bool = False
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._metadata = {**metadata, **played_with()}
        self._queue: queue.Queue[tuple[str, Sequence[Mapping[str, Any]]] | None] = queue.Queue(
            QUEUE_DEPTH
        )
        self._lossless = lossless
        self.dropped = 0
        self.failed: str | None = None
        self._thread = threading.Thread(target=self._run, name="results", daemon=True)
        self._thread.start()
        self.add("metrics", metric_rows())

    def add(self, table: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Hand over rows for one table of TABLES; what does not fit the queue is counted."""
        try:
            self._queue.put((table, rows), block=self._lossless and self._thread.is_alive())
        except queue.Full:
            self.dropped += len(rows)

    def close(self, timeout_s: float | None = None) -> None:
        """Write everything and close the files; `failed` says where that takes too long."""
        if timeout_s is None:
            timeout_s = LOCK_STEP_CLOSE_S if self._lossless else CLOSE_S
        with contextlib.suppress(queue.Full):
            self._queue.put(None, timeout=timeout_s)
            self._thread.join(timeout_s)
        if self._thread.is_alive():
            self.failed = self.failed or f"results were not written within {timeout_s:g} s"

    def _run(self) -> None:
        writers = {}
        pending: dict[str, list[Mapping[str, Any]]] = {name: [] for name in TABLES}
        try:
            for name, schema in TABLES.items():
                writers[name] = pq.ParquetWriter(
                    self._folder / f"{name}.parquet",
                    schema.with_metadata(self._metadata),
                    compression="zstd",
                )
            while (item := self._queue.get()) is not None:
                name, rows = item
                pending[name].extend(rows)
                if len(pending[name]) >= (FLUSH_JOBS if name == "jobs" else FLUSH_ROWS):
                    _write(writers[name], name, pending[name])
            for name, rows in pending.items():
                _write(writers[name], name, rows)
        except Exception as error:
            self.failed = f"results cannot be written: {one_line(error)}"
            log.error("%s", self.failed)
        finally:
            for writer in writers.values():
                try:
                    writer.close()
                except (OSError, pa.ArrowException) as error:
                    self.failed = self.failed or f"results cannot be closed: {error}"


def _write(writer: pq.ParquetWriter, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    if rows:
        writer.write_table(
            pa.Table.from_pylist(list(rows), schema=TABLES[name]).replace_schema_metadata(
                writer.schema.metadata
            )
        )
        if isinstance(rows, list):
            rows.clear()
