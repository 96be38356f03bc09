"""Puts the shards of a sweep together: into the folder that one sweep would have left."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say
from foretwin.orchestrator.record.run_folder import SUMMARY, VEHICLES
from foretwin.orchestrator.sweep.folder import PLAN, WORLDS, SweepFolder
from foretwin.orchestrator.sweep.manifest import Manifest, PartEntry
from foretwin.orchestrator.sweep.places import PLACES
from foretwin.orchestrator.sweep.rows import Parts, link_whole, part_file, sha256_of
from foretwin.orchestrator.sweep.shard import Shard
from foretwin.orchestrator.sweep.spec import SweepSpec
from foretwin.orchestrator.sweep.summary import summed

_OF_A_SHARD = frozenset(
    {
        "shard",
        "ledger",
        "jobs_played",
        "playing_s",
        "rows_sha256",
        "scenarios",
        "processor",
        "arithmetic",
    }
)
"""What a shard's summary says of itself alone."""


class SweptShard(NamedTuple):
    """A folder, which of the shards it holds, and what it says of it."""

    folder: Path
    shard: Shard
    summary: dict[str, Any]


def merge(folders: Sequence[Path], out: Path) -> dict[str, Any]:
    """Put the shards in folders together, and return the summary of the whole.

    What is there already stays. Raises UserError, in one line, where they are not all there, not
    done, or not of one sweep; then nothing is written.
    """
    shards = _one_of_each([_read(folder) for folder in folders])
    first = shards[0]
    jobs = first.summary["jobs_of_all"]
    with SweepFolder(out, first.summary["fingerprint"], fresh=False) as folder:
        for name in (WORLDS, PLACES, VEHICLES):
            (out / name).mkdir(exist_ok=True)
            for file in sorted((first.folder / name).iterdir()):
                link_whole(file, out / name / file.name)
        link_whole(first.folder / PLAN, out / PLAN)
        with Parts(out, jobs=jobs, attribution=first.summary["attribution"]) as parts:
            for one in shards:
                for entry in _listed(one, jobs):
                    if not parts.hold(entry.job, entry.job_sha256):
                        parts.adopt(entry, _checked(one, entry))
            spec = msgspec.convert(first.summary["spec"], SweepSpec)
            whole = summed(spec, parts.entries())
    told = {name: said for name, said in first.summary.items() if name not in _OF_A_SHARD}
    playing_s = round(sum(one.summary["playing_s"] for one in shards), 3)
    now = {"jobs": jobs, "jobs_played": 0, "playing_s": playing_s, "shards": len(shards)}
    return folder.summarise(told | whole | now)


def _read(folder: Path) -> SweptShard:
    try:
        summary = msgspec.json.decode((folder / SUMMARY).read_bytes(), type=dict[str, Any])
        shard = Shard.named(summary["shard"]) if "shard" in summary else None
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f"--merge {folder}: holds no sweep") from None
    except (msgspec.DecodeError, UserError) as error:
        raise UserError(f"--merge {folder}: {SUMMARY} is damaged: {error}") from error
    if shard is None:
        raise UserError(f"--merge {folder}: holds a whole sweep, no shard of one")
    if not summary["complete"]:
        raise UserError(
            f"--merge {folder}: shard {shard} is not done; the same command goes on with it"
        )
    return SweptShard(folder, shard, summary)


def _one_of_each(found: Sequence[SweptShard]) -> list[SweptShard]:
    """Return the shards in their order, each once; raises UserError where one does not fit."""
    first, by_index = found[0], dict[int, SweptShard]()
    for one in found:
        if one.shard.of != first.shard.of:
            raise UserError(
                f"--merge {one.folder}: shard {one.shard}, but {first.folder} is {first.shard}"
            )
        if wrong := _difference(first, one):
            raise UserError(f"--merge {one.folder}: {wrong}")
        twin = by_index.setdefault(one.shard.number, one)
        if twin is one:
            continue
        if twin.summary["rows_sha256"] != one.summary["rows_sha256"]:
            raise UserError(
                f"--merge {one.folder}: shard {one.shard} is in {twin.folder} too, with other rows"
            )
        say(f"shard {one.shard} is in {twin.folder} and in {one.folder}: the same rows", error=True)
    missing = [index for index in range(first.shard.of) if index not in by_index]
    if missing:
        names = ", ".join(str(Shard(index, first.shard.of)) for index in missing)
        raise UserError(f"--merge: missing shard{'s' * (len(missing) > 1)} {names}")
    shards = [by_index[index] for index in sorted(by_index)]
    if len({one.summary["arithmetic"] for one in shards}) > 1:
        on = sorted({one.summary["processor"] for one in shards})
        say(
            "played where numpy comes to other bits: one machine would come to other rows "
            f"({'; '.join(on)})",
            error=True,
        )
    return shards


def _difference(first: SweptShard, one: SweptShard) -> str:
    """Return in what a shard is of another sweep than the first, "" where it is of the same."""
    ours, theirs = first.summary, one.summary
    for what in ("versions", "spec"):
        for name in ours[what].keys() | theirs[what].keys():
            known, other = ours[what].get(name), theirs[what].get(name)
            if known != other:
                words = "of another spec" if what == "spec" else "swept with another version"
                return f"{words} than {first.folder}: {name} is {other}, there {known}"
    if ours["fingerprint"] != theirs["fingerprint"]:
        return f"of another map, scenario, vehicle or planner than {first.folder}"
    if ours["places_sha256"] != theirs["places_sha256"]:
        failed = [*ours["failures"], *theirs["failures"]]
        why = f" ({', '.join(failed)} failed: try that shard again)" if failed else ""
        return f"has other places than {first.folder}{why}"
    return ""


def _listed(one: SweptShard, jobs: int) -> Iterator[PartEntry]:
    with Manifest(one.folder, jobs=jobs) as manifest:
        for job in one.shard.numbers(jobs):
            entry = manifest.entry(job)
            if entry is None:
                raise UserError(
                    f"--merge {one.folder}: job {job} is missing; the same command plays it again"
                )
            yield entry


def _checked(one: SweptShard, entry: PartEntry) -> dict[str, Path]:
    """Return the files of a job; raises UserError for one that is not what was written."""
    files = {table: part_file(one.folder, table, entry.job) for table in entry.tables}
    for table, file in files.items():
        if sha256_of(file) != entry.tables[table]:
            raise UserError(
                f"--merge {file}: is not what was written; the command of shard {one.shard} plays "
                "it again"
            )
    return files
