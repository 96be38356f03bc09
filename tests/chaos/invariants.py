"""What holds of every drive, whatever befell it: looked at from outside, once it has ended."""

from __future__ import annotations

import json
import random
import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from foretwin.contracts.segments import segments_of
from tests.chaos.faults import ENDERS
from tests.chaos.left import Left
from tests.chaos.losses import wrong_losses
from tests.chaos.power_cut import read_syncs, unsynced, wrong_after
from tests.telemetry.own_recordings import read_drive

KILLED = ("kill", "segv")
UNIQUE = {
    "rounds": ("round_id",), "futures": ("round_id", "index"), "jobs": ("job_sha256",),
    "comparisons": ("round_id", "horizon_s"), "mirror": ("stamp_ns",),
}  # fmt: skip
"""What no two rows of a table have in common."""
CUTS = 4
"""At so many syncs besides each instant that was drawn."""
_TEMPORARY = ("*.writing", "*.arrows", "*.stderr", "*.tmp", "*.partial")
_MOST_PUBLISHED = 1_000_000
"""A car sends 300 a second, bursts and strangers some thousands."""
_LAST_WORDS = ("lost: ", "failed: ", "error: ")
_STILL = frozenset({"recorder", "mirror", "vehicle", "orchestrator", "router", "disk", "link"})
"""Where none of these was disturbed, what they write comes to the disk in time."""


def wrong_with(left: Left) -> list[str]:
    """Return what is wrong, in words."""
    found = [*_wrong_codes(left), *_wrong_files(left)]
    try:
        record = json.loads((left.run / "run.json").read_text(encoding="utf-8"))
        found += [*_wrong_ledger(left, record), *_wrong_words(left, record)]
        found += [*_wrong_tables(left.run / "results"), *wrong_losses(left, record)]
        found += _wrong_power(left)
    except Exception as error:
        found.append(f"cannot be looked at: {type(error).__name__}: {error}")
    return found


def fitting_codes(left: Left) -> set[int]:
    """Return the exit codes that fit what befell a drive."""
    codes = {0, 3}
    asked = left.befell("orchestrator", "supervisor", what=("term", "hup"))
    if asked:
        codes = {130}
    if left.befell("vehicle", what=ENDERS):
        codes = codes | {3, 130} if asked else {3}
    if left.befell("supervisor", "orchestrator", what=("memory",)):
        codes = codes | {1}
    for one in left.befell("supervisor", what=KILLED):
        codes = codes | {-9 if one.fault.what == "kill" else -11}
    return codes


def _wrong_codes(left: Left) -> Iterator[str]:
    codes = fitting_codes(left)
    if left.code not in codes:
        last = left.screen.strip().splitlines()[-1:]
        yield f"exit code {left.code}, where {sorted(codes)} would fit: {last}"
    if "Traceback" in left.screen:
        yield f"a traceback on the screen: {left.screen[-800:]}"
    if left.recovered is not None and left.recovered[0] not in (0, 3):
        yield f"recover ended with {left.recovered[0]}: {left.recovered[1][-400:]}"


def _wrong_words(left: Left, record: dict[str, Any]) -> Iterator[str]:
    """Whether a run that lost anything says so last, and one that did not ends as done."""
    if left.recovered is not None:
        return
    last = next(iter(left.screen.strip().splitlines()[-1:]), "")
    told = last.startswith(_LAST_WORDS)
    if left.code == 0 and (told or record["troubles"] or record["ledger"]["telemetry"]["lost"]):
        yield f"exit code 0, and something is lost: {last}"
    if left.code == 3 and not told:
        yield f"exit code 3, and the last line does not say of what: {last}"
    partly = {"completed", "vehicle_ended"}
    words = {0: {"completed"}, 3: partly, 130: {"interrupted"}, 1: {"failed"}}
    if record["exit"] not in words.get(left.code, {record["exit"]}):
        yield f"exit code {left.code}, and run.json says {record['exit']!r}"


def _wrong_ledger(left: Left, record: dict[str, Any]) -> Iterator[str]:
    ledger = record["ledger"]
    telemetry, rounds, jobs = ledger["telemetry"], ledger["rounds"], ledger["jobs"]
    if left.recovered is not None and None in (telemetry, rounds, jobs):
        return  # killed before it had said anything
    if telemetry["published"] != telemetry["recorded"] + telemetry["lost"]:
        yield f"the ledger of telemetry does not balance: {telemetry}"
    if rounds["due"] != sum(count for name, count in rounds.items() if name != "due"):
        yield f"the ledger of rounds does not balance: {rounds}"
    if jobs["given"] != sum(count for name, count in jobs.items() if name != "given"):
        yield f"the ledger of jobs does not balance: {jobs}"
    if telemetry["published"] > _MOST_PUBLISHED:
        yield f"{telemetry['published']} samples are said to be published in half a minute"
    held = sum(1 for part in segments_of(left.run / "drive.mcap") for _ in read_drive(part))
    if held < telemetry["recorded"]:
        yield f"{telemetry['recorded']} samples are said to be recorded, {held} messages are there"


def _tables_in(results: Path) -> dict[str, list[dict[str, Any]]]:
    return {
        name: pq.read_table(results / f"{name}.parquet", columns=list(columns)).to_pylist()
        for name, columns in UNIQUE.items()
        if (results / f"{name}.parquet").exists()
    }


def twice_in(results: Path) -> Iterator[str]:
    """Say which tables of a run hold a result twice."""
    for name, rows in _tables_in(results).items():
        counts = Counter(tuple(row.values()) for row in rows)
        if twice := [key for key, count in counts.items() if count > 1]:
            yield f"twice in {name}: {twice[:3]} of {len(twice)}"


def _wrong_tables(results: Path) -> Iterator[str]:
    yield from twice_in(results)
    tables = _tables_in(results)
    if {"rounds", "futures", "jobs"} <= tables.keys():
        rounds = {row["round_id"] for row in tables["rounds"]}
        with_futures = {row["round_id"] for row in tables["futures"]}
        if rounds - with_futures:
            yield f"rounds without futures: {sorted(rounds - with_futures)[:5]}"


def _wrong_files(left: Left) -> Iterator[str]:
    temporary = [path.name for name in _TEMPORARY for path in left.run.rglob(name)]
    if temporary and not (left.code in (3, 130) and left.befell("disk")):
        yield f"temporary files in the run's folder: {sorted(temporary)}"
    cached = [path.name for name in _TEMPORARY for path in (left.scratch / "cache").rglob(name)]
    if cached and not left.befell("disk"):
        yield f"temporary files in the cache: {sorted(cached)}"
    for folder in left.temporary:
        files = (path for path in folder.rglob("*") if not path.is_dir())
        found = [path for path in files if str(path) not in left.screen]
        # The log of an internal error is named on the screen, for who reports it.
        if stays := sorted(str(path.relative_to(folder)) for path in found):
            yield f"stays in {folder.name}: {stays[:5]}"
    if not left.befell("viewer", "disk", "orchestrator", "supervisor"):
        shown = left.run / "monitor.rrd"
        if not shown.exists() or not shown.stat().st_size:
            yield "monitor.rrd is missing or empty"


def _wrong_power(left: Left) -> Iterator[str]:
    """Cut the power at a drawn instant, and where what was written up to a drawn sync is there."""
    syncs = read_syncs(left.syncs)
    of_run = [one.ns for one in syncs if left.run in one.path.parents]
    for number, one in enumerate(left.befell(what=("power",))):
        seed = f"{left.case.seed}/{left.case.number}/{number}"
        chance = random.Random(seed)
        cut_ns = one.at_ns + chance.randrange(1_000_000_000)
        before = {other.kind for other in left.done if other.at_ns <= cut_ns}
        if not before & _STILL and left.case.source != "live":
            yield from unsynced(syncs, left.run, left.begun_ns, cut_ns)
        for cut, at_ns in enumerate([cut_ns, *chance.choices(of_run, k=CUTS)]):
            target = left.scratch / f"power-cut-{number}-{cut}"
            yield from wrong_after(left.run, left.syncs, at_ns, target, f"{seed}/{cut}")
            yield from (f"power cut: {one}" for one in twice_in(target / "results"))
            shutil.rmtree(target)
