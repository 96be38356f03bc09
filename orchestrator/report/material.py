"""What a run left, as far as a report tells it: read once, nothing where it is missing."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.segments import DRIVE_FILE
from foretwin.contracts.world import World
from foretwin.orchestrator.record.recorded_messages import CarRecorded, car_recorded
from foretwin.orchestrator.record.run_folder import table_at
from foretwin.orchestrator.record.run_state import check_finished, read_record
from foretwin.orchestrator.record.table_parts import read_parts
from foretwin.orchestrator.report.driven_track import CarTrack, driven_track
from foretwin.sim_worker.world_file import load_world

FUTURE_COLUMNS = (
    "future_id",
    "job_sha256",
    "round_id",
    "index",
    "name",
    "world_id",
    "junction_id",
    "planner",
    "scenario",
    "valid",
    "failure",
    "left_out",
    "collided",
    "collision_time_s",
    "collision_with",
    "likelihood",
    "criticality",
    "min_clearance_m",
    "progress_m",
    "accident_kind",
    "trajectory_sha256",
)
"""Columns of the table of futures that a report of a drive reads, and of a sweep but for rounds."""

TableRow = dict[str, Any]


_BREAKS_OFF_S = 2.0
"""A kill of the recorder may cost a second of what it had."""


class KeptWorlds:
    """The Worlds that a run or a sweep left, each read when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "worlds"
        self._read: dict[str, World | None] = {}

    def get(self, world_id: str | None) -> World | None:
        """Return a World, None where its file is gone or of another foretwin."""
        if not world_id:
            return None
        if world_id not in self._read:
            try:
                self._read[world_id] = load_world(self._folder, world_id)
            except (OSError, SchemaMismatch):
                self._read[world_id] = None
        return self._read[world_id]

    def those_of(self, world_ids: Iterable[str]) -> list[World]:
        """Return those that can be read, each once."""
        found = map(self.get, dict.fromkeys(world_ids))
        return [world for world in found if world is not None]


def most_critical(
    futures: pa.Table, most: int, *, of: Callable[[TableRow], Hashable]
) -> tuple[TableRow, ...]:
    """Return the worst futures, the most critical first, one of each that `of` holds for the same;
    those in which nothing happens are none of them, and collisions of which nobody knows how grave
    they are come before all."""
    order = [
        ("criticality", "descending"),
        ("likelihood", "descending"),
        ("future_id", "ascending"),
    ]
    found: dict[Hashable, TableRow] = {}
    unknown = pc.field("collided") & pc.field("criticality").is_null()
    sorts = (futures.filter(one) for one in (unknown, pc.field("criticality") > 0.0))
    for row in itertools.chain(*(one.sort_by(order).to_pylist() for one in sorts)):
        found.setdefault(of(row), row)
        if len(found) == most:
            break
    return tuple(found.values())


class RunMaterial:
    """A run's folder: its record, and its tables and Worlds, read when they are first asked for."""

    def __init__(self, folder: Path, *, called: str = "") -> None:
        self.folder = folder
        self.called = called or str(folder)
        """What commands in the report name it."""
        check_finished(folder)
        self.record = _known(folder, read_record(folder))
        self._tables: dict[str, pa.Table | None] = {}
        self._worlds = KeptWorlds(folder)
        self.damaged: dict[str, str] = {}
        """Why a table that was asked for cannot be read, by its name, though its file is there."""

    def table(self, name: str, columns: Sequence[str] | None = None) -> pa.Table | None:
        """Return a table of the run, None where it is missing, empty or cannot be read."""
        if name not in self._tables:
            self._tables[name] = self._read(name, columns)
        return self._tables[name]

    def _read(self, name: str, columns: Sequence[str] | None) -> pa.Table | None:
        try:
            found = read_parts(table_at(self.folder, name), columns=columns)
        except FileNotFoundError:
            return None
        except (OSError, pa.ArrowException) as error:
            self.damaged[name] = one_line(error)
            return None
        return found if found.num_rows else None

    def rows(self, name: str) -> list[TableRow]:
        """Return the rows of a table, none where there is none."""
        table = self.table(name)
        return [] if table is None else table.to_pylist()

    @cached_property
    def rounds(self) -> list[TableRow]:
        """Return the complete rounds in their order."""
        return sorted(self.rows("rounds"), key=lambda row: (row["stamp_ns"], row["round_id"]))

    @cached_property
    def futures(self) -> pa.Table | None:
        """Return what a report reads of the table of futures."""
        return self.table("futures", FUTURE_COLUMNS)

    @property
    def futures_unread(self) -> bool:
        """Whether futures were played that no table tells of: nothing is known of them then."""
        return self.futures is None and bool(part_of(self.record, "futures", "count"))

    @property
    def unread(self) -> tuple[str, ...]:
        """Return in words what there should be of the run and could not be read so far."""
        said = [] if self.record else ["its run.json holds no record of a drive"]
        said += [f"the table of {name} is damaged" for name in sorted(self.damaged)]
        if self.futures_unread and "futures" not in self.damaged:
            said.append("the table of futures is missing")
        if part_of(self.record, "ledger", "telemetry", "recorded") and not self.recorded.states:
            said.append(f"the recording of the car, {DRIVE_FILE}, cannot be read")
        if self.recorded.states and self.rounds:
            last_ns = max(state.stamp_ns for state in self.recorded.states)
            if (before_s := (self.rounds[-1]["stamp_ns"] - last_ns) / 1e9) > _BREAKS_OFF_S:
                ends = f"ends {before_s:.0f} s before the last round"
                said.append(f"the recording of the car, {DRIVE_FILE}, {ends}")
        return tuple(said)

    @cached_property
    def start_stamp_ns(self) -> int:
        """Return the stamp at which drive time begins, as the rounds tell it, else as the first
        recorded state does; 0 without either."""
        if self.rounds:
            first = self.rounds[0]
            start_ns: int = first["stamp_ns"] - round(first["drive_time_s"] * 1e9)
            return start_ns
        if not self.recorded.states:
            return 0
        began_s = part_of(self.record, "config", "start_s") or 0.0
        return min(state.stamp_ns for state in self.recorded.states) - round(began_s * 1e9)

    def world(self, world_id: str | None) -> World | None:
        """Return a World of the run, None where its file is gone or of another foretwin."""
        return self._worlds.get(world_id)

    def worlds(self) -> list[World]:
        """Return the Worlds that rounds were of, those that can be read."""
        return self._worlds.those_of(row["world_id"] for row in self.rounds)

    @cached_property
    def recorded(self) -> CarRecorded:
        """Return what is recorded of the car, read in one walk."""
        return car_recorded(self.folder / DRIVE_FILE)

    @cached_property
    def track(self) -> CarTrack | None:
        """Return where the car was as it was estimated then, None where nothing is recorded."""
        return driven_track(self.recorded.states, start_stamp_ns=self.start_stamp_ns)

    @property
    def attribution(self) -> str:
        """Return whose map it is."""
        told = self.record.get("map") or {}
        return str(told.get("attribution") or "")


def _known(folder: Path, record: dict[str, Any]) -> dict[str, Any]:
    """Return a record; UserError where it is none that a drive of this foretwin writes."""
    for key in ("map", "config", "futures", "ledger", "comparison", "agreement", "tuning"):
        if not isinstance(record.get(key) or {}, dict):
            raise UserError(f"{folder}/run.json: {key}: a table is asked for, as a drive writes it")
    for key in ("intersections", "troubles", "off_road"):
        if not isinstance(record.get(key) or [], list):
            raise UserError(f"{folder}/run.json: {key}: a list is asked for, as a drive writes it")
    return record


def changes_of_driver(segments: Sequence[TableRow], *, to: str) -> int:
    """Return how often driving went over to `manual` or to `autonomous` from the other, by rows of
    `driven_segments`: one that begins where nobody says who drives is no change."""
    modes = [one["control_mode"] for one in sorted(segments, key=lambda one: one["number"])]
    return sum(
        after == to and before not in (to, "unknown") for before, after in itertools.pairwise(modes)
    )


def in_lock_step(record: Mapping[str, Any]) -> bool:
    """Whether a drive waited for its rounds: how long they took says nothing of it then."""
    config = record.get("config") or {}
    return "speed" in config and config["speed"] is None


def part_of(record: Any, *path: str) -> Any:
    """Return what stands in a record below a path of keys, None where any of them is missing."""
    for key in path:
        if not isinstance(record, dict):
            return None
        record = record.get(key)
    return record
