"""The folder of a sweep: what it is of, its plan, and its rows, so that a sweep can go on."""

from __future__ import annotations

import hashlib
import shutil
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import msgspec

from foretwin.contracts.arithmetic import arithmetic_sha256
from foretwin.contracts.codec import SchemaMismatch, encode, read_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.setup import STACK_LOGS
from foretwin.contracts.versions import processor, versions
from foretwin.orchestrator.record.run_folder import (
    METRICS_FILE,
    REPEATED,
    SUMMARY,
    SWEPT_TABLES,
    VEHICLES,
)
from foretwin.orchestrator.sweep.lock import LOCK, folder_lock
from foretwin.orchestrator.sweep.manifest import MANIFEST
from foretwin.orchestrator.sweep.places import PLACES
from foretwin.orchestrator.sweep.plan import BACKWARDS_PLANNER
from foretwin.orchestrator.sweep.road_users import digest_of
from foretwin.orchestrator.sweep.shard import WHOLE, Shard
from foretwin.orchestrator.sweep.spec import Loaded
from foretwin.sim_worker.futures.columns import RESULT_SCHEMA_VERSION
from foretwin.sim_worker.planners.registry import planner_origin
from foretwin.world_gen.build import GENERATOR_VERSION

PLAN, WORLDS, LOG = "places.msgpack", "worlds", "log.jsonl"


class FoundPlaces(msgspec.Struct, frozen=True, kw_only=True):
    """What a sweep found out before it played anything."""

    fingerprint: str
    worlds: tuple[str, ...]
    """Ids of those that scenarios were placed on, in the order of the plan."""
    failures: dict[str, str]
    """Junctions or Worlds of which nothing is known, and why: tried again at the next start."""


class SweepFolder:
    """One folder for one sweep, locked while it is entered.

    Entering raises UserError where it holds something else or another process sweeps there.
    """

    def __init__(self, path: Path, fingerprint: str, *, fresh: bool, shard: Shard = WHOLE) -> None:
        self.path, self.fingerprint, self._shard = path, fingerprint, shard
        self._fresh = fresh
        self._held = ExitStack()

    def is_new(self) -> bool:
        """Return whether no sweep was begun there; UserError where it holds something else."""
        self._refuse_strangers()
        return not (self.path / SUMMARY).is_file()

    def __enter__(self) -> Self:
        self._refuse_strangers()
        self.path.mkdir(parents=True, exist_ok=True)
        with ExitStack() as held:
            held.enter_context(folder_lock(self.path))
            if self._fresh:
                _clear(self.path)
            self._check()
            self.worlds_dir.mkdir(exist_ok=True)
            self._held = held.pop_all()
        return self

    def __exit__(self, *what: object) -> None:
        self._held.close()

    @property
    def worlds_dir(self) -> Path:
        """Return where the Worlds are."""
        return built_worlds(self.path)

    @property
    def places_dir(self) -> Path:
        """Return where it is kept where scenarios take place in each World."""
        return self.path / PLACES

    def _refuse_strangers(self) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise UserError(f"--out {self.path}: is a file; a sweep writes into a folder")
        there = {entry.name for entry in self.path.iterdir()} if self.path.is_dir() else set()
        if there and not {SUMMARY, LOCK} & there:
            raise UserError(f"--out {self.path}: holds other files and no sweep")

    def _check(self) -> None:
        summary = self.path / SUMMARY
        if not summary.is_file():
            return
        try:
            said = msgspec.json.decode(summary.read_bytes())
            known, shard = said.get("fingerprint"), said.get("shard", "")
        except (msgspec.DecodeError, AttributeError) as error:
            raise UserError(f"{summary}: is no summary of a sweep: {error}") from error
        if known != self.fingerprint:
            raise UserError(
                f"--out {self.path}: holds a sweep of another spec, map, planner or version; "
                "--fresh starts anew, another --out keeps both"
            )
        if said.get("arithmetic", arithmetic_sha256()) != arithmetic_sha256():
            raise UserError(
                f"--out {self.path}: holds rows of {said.get('processor')}, where numpy comes to "
                "other bits than here; another --out keeps both"
            )
        if shard != self._of_shard().get("shard", ""):
            holds = f"shard {shard}" if shard else "the whole"
            raise UserError(
                f"--out {self.path}: holds {holds} of this sweep; each shard, and the whole, has "
                "a folder of its own"
            )

    def begin(self, loaded: Loaded) -> None:
        """Note what the folder is for, where nothing is there yet."""
        if not (self.path / SUMMARY).is_file():
            self.summarise(
                {"complete": False, "spec": loaded.spec, "planners": planner_origins(loaded)}
            )

    def summarise(self, what: dict[str, Any]) -> dict[str, Any]:
        """Write the summary; returns the whole of it."""
        whole = {
            "fingerprint": self.fingerprint,
            **self._of_shard(),
            "versions": versions(),
            "processor": processor(),
            "arithmetic": arithmetic_sha256(),
            **what,
        }
        self._write(SUMMARY, msgspec.json.format(msgspec.json.encode(whole), indent=2) + b"\n")
        return whole

    def save_found(self, worlds: tuple[str, ...], failures: dict[str, str]) -> FoundPlaces:
        """Keep on which Worlds scenarios were placed: it need not be found out again."""
        places = FoundPlaces(fingerprint=self.fingerprint, worlds=worlds, failures=failures)
        self._write(PLAN, encode(places))
        return places

    def _of_shard(self) -> dict[str, str]:
        return {} if self._shard == WHOLE else {"shard": str(self._shard)}

    def _write(self, name: str, data: bytes) -> None:
        """Write a file that is whole or not there."""
        partial = self.path / f"{name}.writing"
        partial.write_bytes(data)
        partial.replace(self.path / name)

    def found(self) -> FoundPlaces | None:
        """Return what was kept, None where there is nothing."""
        try:
            kept = read_message(self.path / PLAN, FoundPlaces)
        except (FileNotFoundError, SchemaMismatch):
            return None
        return kept if kept.fingerprint == self.fingerprint else None


def built_worlds(out: Path) -> Path:
    """Return where the Worlds of a sweep are, built or copied."""
    return out / WORLDS


def planner_origins(loaded: Loaded) -> dict[str, dict[str, str]]:
    """Return what each planner of a sweep is made of, by name; of a driving stack, what starts it
    and what it says that it is."""
    spec, stacks = loaded.spec, loaded.stacks
    # Egos that go backwards may be driven by one that the spec does not name.
    names = sorted({*spec.planners, BACKWARDS_PLANNER} - stacks.keys())
    return {name: planner_origin(name)._asdict() for name in names} | {
        name: {"command": spec.remote[name].command, "name": says.name, "version": says.version}
        for name, says in stacks.items()
    }


def fingerprint_of(loaded: Loaded, source: str) -> str:
    """Return a hash of everything that decides the rows of a sweep."""
    # How long one waits for a job, or for an answer in it, does not.
    remote = {name: stack.for_identity() for name, stack in loaded.spec.remote.items()}
    spec = msgspec.structs.replace(loaded.spec, job_timeout_s=1.0, remote=remote)
    parts = (
        spec,
        loaded.scenarios,
        loaded.vehicles,
        loaded.starts,
        None if loaded.road_users is None else digest_of(loaded.road_users),
        source,
        GENERATOR_VERSION,
        versions(),
        RESULT_SCHEMA_VERSION,
        planner_origins(loaded),
    )
    return hashlib.sha256(msgspec.json.encode(parts)).hexdigest()


def _clear(path: Path) -> None:
    """Remove what an earlier sweep left in its folder, and nothing else."""
    if not (path / SUMMARY).is_file():
        return
    for name in (SUMMARY, PLAN, LOG, METRICS_FILE, MANIFEST):
        (path / name).unlink(missing_ok=True)
    for name in (*SWEPT_TABLES.values(), VEHICLES, WORLDS, PLACES, REPEATED, STACK_LOGS):
        shutil.rmtree(path / name, ignore_errors=True)
