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
from foretwin.contracts.gap import GapSample
from foretwin.contracts.side_by_side import Disagreement, DrivenSegment
from foretwin.contracts.simulation import (
    Comparison,
    Event,
    HorizonError,
    MirroredVehicle,
    MirrorSample,
    PlanComparison,
)
from foretwin.contracts.tuning import ParameterChange, ParameterEstimate
from foretwin.orchestrator.record.columns import columns, columns_of, schema
from foretwin.orchestrator.record.job_tables import JOB_TABLES, metric_rows, played_with

log = logging.getLogger("results")

PLAN = "round_id stamp_ns plan_stamp_ns horizon_s"
MIRROR = (
    "stamp_ns world_id real twin shadow ghost free gap_m gap_along_m gap_across_m gap_yaw_rad "
    "gap_speed_mps since_reset_s independent role correction"
)
MIRRORED = "vehicle_id role real shown correction"
PARAMETER = "stamp_ns name before value std origin pinned"
GAP = (
    "stamp_ns horizon_s manoeuvre along_m across_m yaw_rad yaw_rate_radps speed_mps accel_mps2 "
    "independent"
)
"""Which fields of messages stand in the tables of these names, in this order."""
_FLIP = "flip_{0}_factor:float flip_{0}_m:float"

_COLUMNS = {
    "comparisons": columns_of(Comparison),
    "plan_comparisons": {
        **columns_of(PlanComparison, PLAN),
        **columns_of(HorizonError),
        "path_offset_m": float,
    },
    "disagreements": {
        **columns_of(Disagreement, "vehicle_id segment aspect kind stamp_ns end_stamp_ns"),
        **columns("duration_s:float lat_deg:float lon_deg:float"),
        **columns_of(Disagreement, "junction_id route_m lateral_m along_m speed_mps"),
    },
    "driven_segments": columns_of(DrivenSegment),
    "agreement": columns(
        "round_id:int stamp_ns:int drive_time_s:float intersection_id:str outcome:str "
        "observable:str simulated_fails:str driven_fails:str gap_along_m:float gap_across_m:float "
        + " ".join(_FLIP.format(direction) for direction in ("along", "across", "both"))
        + " flip_along_fails:str flip_across_fails:str flip_both_fails:str"
    ),
    "mirror": columns_of(MirrorSample, MIRROR),
    "mirrored": {"stamp_ns": int, **columns_of(MirroredVehicle, MIRRORED)},
    "touches": columns("stamp_ns:int one:str other:str"),
    "changes": columns("stamp_ns:int asked_stamp_ns:int key:str before:str value:str"),
    "parameters": {"version": int, **columns_of(ParameterChange, PARAMETER)},
    "identifications": {
        **columns("stamp_ns:int from_stamp_ns:int"),
        **columns_of(ParameterEstimate),
        "taken": bool,
    },
    "gaps": columns_of(GapSample, GAP),
    "verdicts": columns(
        "stamp_ns:int since_stamp_ns:int culprit:str cause:str text:str evidence:str "
        "confidence:float"
    ),
    "events": columns_of(Event),
}
_ROUNDS = columns(
    "round_id:int stamp_ns:int drive_time_s:float intersection_id:str world_id:str futures:int "
    "distinct:int collided:int cruise_speed_mps:float latency_ms:float sim_seconds:float "
    "cpu_seconds:float sha256:str vehicle_version:int"
)
TABLES: dict[str, pa.Schema] = {
    "rounds": schema(_ROUNDS),
    **JOB_TABLES,
    **{name: schema(of) for name, of in _COLUMNS.items()},
}
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
