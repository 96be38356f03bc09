"""The run's tables, written by a thread of their own: no disk blocks a drive."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
import time
from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

from foretwin.contracts.errors import one_line
from foretwin.contracts.forecast import ForecastOutcome
from foretwin.contracts.gap import GapSample
from foretwin.contracts.marks import EventMark
from foretwin.contracts.roles import VehicleEncounter
from foretwin.contracts.siblings import SiblingFuture
from foretwin.contracts.side_by_side import Disagreement, DrivenSegment
from foretwin.contracts.simulation import (
    Comparison,
    Event,
    HorizonError,
    MirroredVehicle,
    MirrorSample,
    PlanComparison,
)
from foretwin.contracts.trace import span, traced
from foretwin.contracts.tuning import ParameterChange, ParameterEstimate
from foretwin.contracts.virtual_traffic import VIRTUAL_ROAD_USER
from foretwin.orchestrator.keep import Keep
from foretwin.orchestrator.record.derive import derive, streams_in
from foretwin.orchestrator.record.durable import sync_folder
from foretwin.orchestrator.record.kept_parts import KeptParts
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.orchestrator.record.run_state import made_by_recover
from foretwin.orchestrator.record.run_streams import Rows, RunStreams
from foretwin.orchestrator.record.so_far import write_so_far
from foretwin.sim_worker.futures.columns import columns, columns_of, schema
from foretwin.sim_worker.futures.job_tables import JOB_TABLES, metric_rows, played_with

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
    "independent along_std_m across_std_m yaw_std_rad speed_std_mps"
)
"""Which fields of messages stand in the tables of these names, in this order."""
_FLIP = "flip_{0}_factor:float flip_{0}_m:float"

_COLUMNS = {
    "comparisons": columns_of(Comparison),
    "forecasts": columns_of(ForecastOutcome),
    "plan_comparisons": columns_of(PlanComparison, PLAN)
    | columns_of(HorizonError)
    | {"path_offset_m": float},
    "disagreements": columns_of(Disagreement, "vehicle_id segment aspect kind stamp_ns")
    | columns("end_stamp_ns:int duration_s:float lat_deg:float lon_deg:float")
    | columns_of(Disagreement, "junction_id route_m lateral_m along_m speed_mps"),
    "driven_segments": columns_of(DrivenSegment),
    "agreement": columns(
        "round_id:int stamp_ns:int drive_time_s:float intersection_id:str outcome:str "
        "simulated:str driven:str observable:str simulated_fails:str driven_fails:str "
        "not_observable:str gap_along_m:float gap_across_m:float "
        + " ".join(_FLIP.format(direction) for direction in ("along", "across", "both"))
        + " flip_along_fails:str flip_across_fails:str flip_both_fails:str"
    ),
    "windows": columns("round_id:int stamp_ns:int world_id:str vehicle:str window:bytes"),
    "siblings": columns_of(SiblingFuture),
    "mirror": columns_of(MirrorSample, MIRROR),
    "mirrored": {"stamp_ns": int, **columns_of(MirroredVehicle, MIRRORED)},
    "virtual_road_users": columns(VIRTUAL_ROAD_USER),
    "touches": columns("stamp_ns:int one:str other:str"),
    "encounters": columns_of(VehicleEncounter),
    "changes": columns("stamp_ns:int asked_stamp_ns:int key:str before:str value:str"),
    "parameters": {"version": int, **columns_of(ParameterChange, PARAMETER)},
    "identifications": columns("stamp_ns:int from_stamp_ns:int")
    | columns_of(ParameterEstimate)
    | {"taken": bool},
    "gaps": columns_of(GapSample, GAP),
    "verdicts": columns(
        "stamp_ns:int since_stamp_ns:int culprit:str cause:str text:str evidence:str "
        "confidence:float"
    ),
    "junctions": columns(
        "id:str kind:str name:str control:str lat:float lon:float seen_at_s:float "
        "arrived_at_s:float built_at_s:float within_radius_at_s:float world_ready_before_s:float"
    ),
    "events": columns_of(Event),
    "marks": columns_of(EventMark),
}
_ROUNDS = columns(
    "round_id:int stamp_ns:int drive_time_s:float intersection_id:str world_id:str futures:int "
    "distinct:int collided:int cruise_speed_mps:float latency_ms:float sim_seconds:float "
    "cpu_seconds:float sha256:str vehicle_version:int late:bool"
)
TABLES: dict[str, pa.Schema] = {
    "rounds": schema(_ROUNDS),
    **JOB_TABLES,
    **{name: schema(of) for name, of in _COLUMNS.items()},
}
"""Every table of `results/` with its columns."""

WRITE_S, SYNC_S = 0.5, 1.0
"""How often rows are appended, which outlives a kill, and synced, which outlives a power cut.

Until then they lie in the queue: to wake up for each costs more than to keep it.
"""
LOOK_EVERY_S = 5.0
"""How often a table may be put away, and parts of the run removed."""
QUEUE_DEPTH = 4096
CLOSE_S, LOCK_STEP_CLOSE_S = 10.0, 120.0
"""How long the disk may take nothing at the end, live and where nothing may be missing."""


class ResultTables:
    """Collects rows and writes them; `add` never raises, and blocks in lock step alone.

    While a run goes on, each table is a stream that only grows; at its end they become Parquet.
    """

    def __init__(
        self,
        folder: Path,
        metadata: Mapping[str, str],
        *,
        lossless: bool = False,
        keep: Keep | None = None,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        told = {**metadata, **played_with()}
        schemas = {name: schema.with_metadata(told) for name, schema in TABLES.items()}
        self._streams = RunStreams(folder, schemas)
        self._queue: queue.Queue[tuple[str, Rows]] = queue.Queue(QUEUE_DEPTH)
        self._over = threading.Event()
        self._lossless, self._roll = lossless, (keep or Keep()).tables
        self._kept = KeptParts(folder.parent, keep or Keep())
        self._left, self._dropped = False, 0
        self.lost_before = 0
        """Rows that an orchestrator before this one could not write."""
        self.troubles: list[str] = []
        """What is lost or not in Parquet, and why; complete once closed."""
        self._so_far = b""
        self._news: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._moved_s, self._look_s = time.monotonic(), 0.0
        self._thread = threading.Thread(target=self._run, name="results", daemon=True)
        begun = bool(kept_rows(folder, "metrics", "name"))  # by an orchestrator before this one
        self._thread.start()
        if not begun:
            self.add("metrics", metric_rows())

    @property
    def dropped(self) -> int:
        """Rows that are lost, whatever the reason."""
        return self.lost_before + self._dropped + self._streams.lost.total()

    @traced("rows to a table")
    def add(self, table: str, rows: Rows) -> None:
        """Hand over rows for one table of TABLES; what does not fit the queue is counted."""
        try:
            self._queue.put((table, rows), block=self._lossless and self._thread.is_alive())
        except queue.Full:
            self._dropped += len(rows)

    def keep_so_far(self, data: bytes) -> None:
        """Hand over what the run's record would say now; of several the last is written."""
        self._so_far = data

    def take_news(self) -> list[str]:
        """Return what newly goes wrong while the run goes on, or is well again."""
        return [self._news.get() for _ in range(self._news.qsize())]

    def close(self, timeout_s: float | None = None) -> None:
        """Write everything and make Parquet of it; `troubles` says what that did not come to.

        Gives up where nothing moves for `timeout_s`: the streams stay, for `foretwin recover`.
        """
        if timeout_s is None:
            timeout_s = LOCK_STEP_CLOSE_S if self._lossless else CLOSE_S
        self._moved()
        self._over.set()
        while (
            self._thread.is_alive()
            and (left_s := self._moved_s + timeout_s - time.monotonic()) > 0.0
        ):
            self._thread.join(left_s)
        if self._thread.is_alive():
            self.troubles.append(
                f"results are not in Parquet: nothing was written for {timeout_s:g} s; {self._how}"
            )
        if self.lost_before:
            self.troubles.append(
                f"{self.lost_before} rows are lost: not written in time for the "
                "orchestrator that died"
            )
        if self._dropped:
            self.troubles.append(
                f"{self._dropped} rows are lost: they came faster than they could be written"
            )

    def leave(self, timeout_s: float = CLOSE_S) -> None:
        """Write everything, and leave the streams to who goes on with them."""
        self._left = True
        self._over.set()
        self._thread.join(timeout_s)

    @property
    def _how(self) -> str:
        return made_by_recover(self._folder.parent)

    def _moved(self) -> None:
        self._moved_s = time.monotonic()

    def _run(self) -> None:
        try:
            self._write_streams()
            if not self._left:
                self._make_parquet()
        except Exception as error:
            log.exception("results cannot be written")
            self.troubles.append(f"results cannot be written: {one_line(error)}")

    def _write_streams(self) -> None:
        """Append what comes until the end."""
        streams = self._streams
        sync_s = time.monotonic()
        over = False
        while not over:
            over = self._over.wait(WRITE_S)
            for _ in range(self._queue.qsize()):
                streams.take(*self._queue.get_nowait())
            # At the end it is the Parquet files that are synced.
            sync, before = not over and time.monotonic() >= sync_s, streams.failing
            with span("write tables", sync=sync):
                streams.write(sync=sync)
            self._tell(before, streams.failing)
            if sync:
                self._write_so_far()
                self._keep_small(streams)
                sync_s = time.monotonic() + SYNC_S - WRITE_S / 2
        streams.close()
        self.troubles += [f"{rows} rows are lost: {why}" for why, rows in streams.lost.items()]

    def _write_so_far(self) -> None:
        data, self._so_far = self._so_far, b""
        if data:
            with contextlib.suppress(OSError):  # a disk that is full leaves what it said before
                write_so_far(self._folder.parent, data)

    def _keep_small(self, streams: RunStreams) -> None:
        """Make Parquet of what is large enough, and remove what is more than is kept."""
        if time.monotonic() < self._look_s:
            return
        self._look_s = time.monotonic() + LOOK_EVERY_S
        try:
            for ended in streams.put_away(self._roll):
                if derive(ended).rows is not None:
                    ended.unlink()
            begun = not self._kept.gone
            self._kept.look()
            if begun and self._kept.gone:
                self._news.put("the oldest parts of the run go from here on, as --keep says")
        except (OSError, pa.ArrowException) as error:  # what is there stays
            log.warning("the run's folder cannot be kept small now: %s", one_line(error))

    def _tell(self, before: str | None, now: str | None) -> None:
        if now is not None and before is None:
            self._news.put(f"results cannot be written now, and wait: {now}")
        elif now is None and before is not None:
            self._news.put("results are written again")

    def _make_parquet(self) -> None:
        """Make Parquet of the streams, and remove those that are no longer needed."""
        derived, left = [], {}
        for stream in streams_in(self._folder):
            try:
                table = derive(stream, each_group=self._moved)
            except (OSError, pa.ArrowException) as error:
                left[stream.stem] = one_line(error)
            else:
                derived += [stream] if table.rows is not None else []
            self._moved()
        sync_folder(self._folder)
        for stream in derived:
            stream.unlink()
        if left:
            names, why = ", ".join(left), next(iter(left.values()))
            self.troubles.append(f"not in Parquet: {names}: {why}; {self._how}")
