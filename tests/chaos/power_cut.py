"""A run's folder as a power cut leaves it, made of what had come to the disk by then.

What was synced is there. Of what was written after that any part may be: nothing, some, or zeros
where the length came to the disk and the data did not.
"""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.orchestrator.record.durable import WRITING
from foretwin.orchestrator.record.recovery import recover
from foretwin.orchestrator.record.table_stream import SUFFIX, StreamReader
from foretwin.telemetry.logs.mend_mcap import look_through

SYNCS, SYNCS_LOG = "FORETWIN_CHAOS_SYNCS", "FORETWIN_CHAOS_SYNCS_LOG"
_KEPT_AS_IT_IS = ("processes", "worlds")
MOST_UNSYNCED_S = 3.0
"""Results are synced each second and a recording each second: with a busy machine's delays."""


class Sync(NamedTuple):
    """One file at one sync: so many of its bytes are on the disk from then on."""

    ns: int
    path: Path
    inode: int
    size: int


def log_of(copies: Path) -> Path:
    """Return where it is told what came to the disk: beside the disk that holds the copies."""
    return copies.parent.with_name("syncs.jsonl")


def read_syncs(copies: Path) -> list[Sync]:
    """Return what the processes of a drive told, in the order of time."""
    file, found = log_of(copies), []
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        told = json.loads(line)
        found.append(Sync(told["ns"], Path(told["path"]), told["inode"], told["bytes"]))
    return sorted(found)


def on_the_disk(syncs: list[Sync], run: Path, cut_ns: int) -> dict[str, Sync]:
    """Return the last sync before the cut of each file of a run, by its name in the folder."""
    found = {}
    for one in syncs:
        if one.ns <= cut_ns and run in one.path.parents:
            found[str(one.path.relative_to(run)).removesuffix(WRITING)] = one
    return found


def cut_power(run: Path, copies: Path, cut_ns: int, target: Path, chance: random.Random) -> None:
    """Write to `target` what is left of a run whose power was cut at an instant."""
    (target / "results").mkdir(parents=True)
    for name in _KEPT_AS_IT_IS:
        shutil.copytree(run / name, target / name)
    for name, sync in on_the_disk(read_syncs(copies), run, cut_ns).items():
        data = (copies / str(sync.inode)).read_bytes()
        later = data[sync.size : sync.size + chance.choice((0, 7, 300, 20_000))]
        tail = chance.choice((b"", later, bytes(len(later))))
        path = target / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data[: sync.size] + tail)
    for name in ("log.jsonl", "drive.tally.json"):  # never synced: whole, torn, zeros, or not there
        data = (run / name).read_bytes() if (run / name).exists() else b""
        data = data[: chance.randrange(len(data) + 1)]
        if (left := chance.choice((data, bytes(len(data)), None))) is not None:
            (target / name).write_bytes(left)


def wrong_after(run: Path, copies: Path, cut_ns: int, target: Path, seed: str) -> list[str]:
    """Cut the power of a run at an instant, recover it, and return what is wrong with the rest."""
    cut_power(run, copies, cut_ns, target, random.Random(seed))
    before = {path.name: whole_of(path) for path in parts_of(target)}
    wrong = [*_torn_below(target, on_the_disk(read_syncs(copies), run, cut_ns))]
    try:
        recovered = recover(target)
    except Exception as error:
        return [f"power cut: recover: {type(error).__name__}: {error}"]
    for name, count in before.items():
        told = [part.text for part in recovered.parts if part.text.startswith(f"{name_in(name)}:")]
        if not any(f" {count} rows" in text or f" {count} messages" in text for text in told):
            wrong.append(f"power cut: {name} held {count}, recovered: {told}")
    left = [path.name for path in target.rglob("*") if path.suffix in (SUFFIX, WRITING)]
    return wrong + ([f"power cut: recover leaves {left}"] if left else [])


def name_in(file: str) -> str:
    """Return what `recover` calls a file: a table by its name, a recording by its file's."""
    return file.removesuffix(SUFFIX)


def parts_of(folder: Path) -> list[Path]:
    """Return the streams and recordings of a run."""
    return [*sorted((folder / "results").glob(f"*{SUFFIX}")), *sorted(folder.glob("drive*.mcap"))]


def whole_of(path: Path) -> int:
    """Return how many rows or messages a file holds up to where it is torn."""
    if path.suffix == SUFFIX:
        return sum(rows.num_rows for rows in StreamReader(path).records())
    return look_through(path).messages


def _torn_below(target: Path, synced: dict[str, Sync]) -> Iterator[str]:
    """Say which files are torn before where they had been synced: not at the end of a record."""
    for path in parts_of(target):
        size = synced[str(path.relative_to(target))].size
        if path.suffix == SUFFIX:
            reader = StreamReader(path)
            for _ in reader.records():
                pass
            whole = reader.whole_bytes
        else:
            found = look_through(path)
            whole = size if found.ended else found.data_bytes
        if whole < size:
            yield f"power cut: {path.name} was synced up to {size}, and is whole up to {whole}"


def unsynced(syncs: list[Sync], run: Path, begun_ns: int, cut_ns: int) -> list[str]:
    """Return which of the files that grow all the time have not come to the disk for too long."""
    known = on_the_disk(syncs, run, cut_ns)
    wrong = []
    for name in ("results/mirror.arrows", "drive.mcap"):
        last_ns = max(begun_ns, known[name].ns if name in known else 0)
        if (age_s := (cut_ns - last_ns) * 1e-9) > MOST_UNSYNCED_S:
            wrong.append(f"power cut: {name} had not come to the disk for {age_s:.1f} s")
    return wrong
