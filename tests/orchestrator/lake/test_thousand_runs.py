"""A thousand runs, copies of a real one, collected twice, and with a kill at any instant.

FORETWIN_LAKE_RUN names a finished run to copy; without it one is driven.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

from tests.orchestrator.lake.copied_runs import DAYS, MAPS, VEHICLES, copies_of
from tests.orchestrator.lake.killed_collect import PHASES, Killing, Whole, phase_of
from tests.orchestrator.lake.made_runs import contents, lake_table
from tests.system.foretwin_command import environment, foretwin

pytestmark = [pytest.mark.judge, pytest.mark.timeout(1800)]
COUNT, STEPS, QUERY_S = 1000, 4, 3.0
OF_EACH_KIND = 3
"""So many kills of each of seven kinds; see `drawn_kills`."""
SEED = int(os.environ.get("FORETWIN_KILL_SEED", "0")) or random.SystemRandom().randrange(1, 10**6)


class Copies(NamedTuple):
    """Folder of the copies, and rows of each table in each of them."""

    folder: Path
    rows: dict[str, int]
    size_bytes: int
    """Of all tables."""


@pytest.fixture(scope="module")
def copies(tmp_path_factory: pytest.TempPathFactory) -> Copies:
    folder = tmp_path_factory.mktemp("lake")
    given = os.environ.get("FORETWIN_LAKE_RUN")
    driven = "--speed", "max", "--end", "12", "--futures", "32"
    run = Path(given) if given else foretwin(folder / "driven", *driven).run
    assert run is not None
    rows = {
        path.stem: pq.read_metadata(path).num_rows for path in (run / "results").glob("*.parquet")
    }
    written = copies_of(run, folder / "runs", COUNT)
    size_bytes = sum(path.stat().st_size for one in written for path in one.rglob("*.parquet"))
    there = {name: count for name, count in rows.items() if count}
    return Copies(folder / "runs", there, size_bytes)


def collecting(copies: Copies, lake: Path) -> subprocess.Popen[str]:
    asked = [sys.executable, "-P", "-m", "foretwin", "collect", str(copies.folder), "--into", lake]
    return subprocess.Popen(
        asked, env=environment(lake.parent / "cache"), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def collected(copies: Copies, lake: Path) -> tuple[str, float]:
    """Collect to the end; returns what it said, and how long it took."""
    begun_s = time.monotonic()
    with collecting(copies, lake) as process:
        said, _ = process.communicate(timeout=1200)
    assert process.returncode == 0, said
    return said.removeprefix(f"{lake}: ").strip(), time.monotonic() - begun_s


def size_mb(files: dict[str, bytes], choose: Callable[[str], bool] = bool) -> float:
    return sum(len(data) for name, data in files.items() if choose(name)) / 1e6


def test_a_thousand_runs_collected_twice_are_the_same_lake(copies: Copies, tmp_path: Path) -> None:
    lake = tmp_path / "lake"

    first, first_s = collected(copies, lake)
    before = contents(lake)
    second, second_s = collected(copies, lake)

    assert contents(lake) == before
    assert first == f"{COUNT} collected; {COUNT * (sum(copies.rows.values()) + 1)} rows added"
    assert second == f"{COUNT} were there; 0 rows added"
    parts = [name for name in before if name.endswith(".parquet")]
    # One file of each table in each partition: none is large enough for a second.
    assert len(parts) <= DAYS * VEHICLES * MAPS * (len(copies.rows) + 1)
    given = contents(copies.folder)
    tables = [name for name in given if name.endswith(".parquet")]
    print(
        f"\n{COUNT} runs, {len(tables)} files, {size_mb(given):.1f} MB → {len(parts)} files, "
        f"{size_mb(before):.1f} MB, of these the manifest "
        f"{size_mb(before, lambda name: name == 'manifest.json'):.2f} MB; "
        f"{first_s:.1f} s, again {second_s:.1f} s"
    )
    assert lake_table(lake, "futures").num_rows == COUNT * copies.rows["futures"]


@pytest.mark.parametrize(
    "sql",
    [
        "SELECT run, count(*) AS n, avg(collided::INT) AS collided FROM futures GROUP BY run",
        "SELECT vehicle_id, scenario, count(*) AS n, min(min_clearance_m) AS clearance_m "
        "FROM futures JOIN runs USING (run) GROUP BY ALL",
        "SELECT run, count(*) AS n, max(latency_ms) AS latency_ms FROM rounds GROUP BY run",
        "SELECT state, count(*) AS n FROM runs GROUP BY state",
    ],
)
def test_a_thousand_runs_answer_a_question_in_three_seconds(copies: Copies, sql: str) -> None:
    asked = [sys.executable, "-P", "-m", "foretwin", "query", sql, str(copies.folder), "--json"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun_s = time.monotonic()

    said = subprocess.run(
        asked, env=environment(copies.folder.parent / "cache"), text=True, check=True,
        stdout=subprocess.PIPE, timeout=300,
    ).stdout  # fmt: skip

    took_s = time.monotonic() - begun_s
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # All its threads one after the other: what it takes at most where nobody else runs.
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"\n{cpu_s:.2f} s of processor time, {took_s:.2f} s: {sql}")
    wanted = copies.rows["rounds"] if "rounds" in sql else copies.rows["futures"]
    total = COUNT if "state" in sql else COUNT * wanted
    assert sum(row["n"] for row in json.loads(said)) == total
    assert min(cpu_s, took_s) < QUERY_S


class Kill(NamedTuple):
    """When a collect is ended: before an event, or after a share of its processor time."""

    before_event: int | None = None
    after_share: float | None = None


def drawn_kills(whole: Whole, drawn: random.Random) -> list[Kill]:
    """Return kills over the whole of a collect's work: before events of each kind, and where its
    processor time goes, which is at files in the middle of their writing."""
    steps, events = whole.steps, whole.events
    first_file = next(at for at, (_, name) in enumerate(events) if name.endswith(".parquet"))
    of_kind = (
        list(range(first_file)),
        [step.manifest for step in steps],
        [step.published[0] for step in steps],
        [at for step in steps for at in step.published[1:]],
        [step.published[-1] + 1 for step in steps],
        list(range(len(events))),
    )
    chosen = [[Kill(before_event=at) for at in drawn.sample(of, OF_EACH_KIND)] for of in of_kind]
    shares = [(number + drawn.random()) / OF_EACH_KIND for number in range(OF_EACH_KIND)]
    chosen.append([Kill(after_share=share) for share in shares])
    return [kill for turn in zip(*chosen, strict=True) for kill in turn]


def killed(copies: Copies, lake: Path, kill: Kill, whole: Whole | None) -> Whole | None:
    """Collect until the kill; returns what was done where it came to the end before."""
    told = lake.with_suffix(".told")
    told.unlink(missing_ok=True)
    asked = Killing(
        lake=str(lake), runs=str(copies.folder), step_bytes=copies.size_bytes // STEPS,
        before_event=kill.before_event, told=str(told),
        after_cpu_s=kill.after_share and whole and kill.after_share * whole.cpu_s,
    )  # fmt: skip
    words = ("-m", "tests.orchestrator.lake.killed_collect", msgspec.json.encode(asked).decode())
    ended = subprocess.run(
        [sys.executable, "-P", *words], env=environment(lake.parent / "cache"), check=False,
        timeout=1200,
    )  # fmt: skip
    if told.exists():
        return msgspec.json.decode(told.read_bytes(), type=Whole)
    assert ended.returncode in (-signal.SIGKILL, -signal.SIGPROF)
    return None


def test_a_collect_that_is_killed_leaves_a_lake_of_whole_runs(
    copies: Copies, tmp_path: Path
) -> None:
    print(f"\nFORETWIN_KILL_SEED={SEED}")
    whole = killed(copies, tmp_path / "whole", Kill(), None)
    assert whole is not None
    wanted = hashes(tmp_path / "whole")
    phases: Counter[str] = Counter()
    for number, kill in enumerate(drawn_kills(whole, random.Random(SEED))):
        lake = tmp_path / f"lake{number}"
        if killed(copies, lake, kill, whole) is not None:  # it took less this time
            phases["after its end"] += 1
            continue
        phase = phase_of(lake, whole)
        phases[phase] += 1
        seen = runs_in(lake, "runs")
        assert all(count == 1 for count in seen.values())
        for table, rows in copies.rows.items():
            there = runs_in(lake, table)
            assert set(there.values()) <= {rows}, table
            assert seen.keys() <= there.keys(), table
        print(f"{kill}: {phase}, {len(seen)} runs there")

        killed(copies, lake, Kill(), None)

        assert hashes(lake) == wanted, kill
        shutil.rmtree(lake)
    print(f"{phases.total()} kills of {len(whole.events)} events: {dict(phases)}")
    assert phases.keys() >= PHASES


def hashes(lake: Path) -> dict[str, str]:
    return {name: hashlib.sha256(data).hexdigest() for name, data in contents(lake).items()}


def runs_in(lake: Path, table: str) -> Counter[str]:
    """Count rows by run, as any user of Arrow can; no other column of so many is read."""
    if not any((lake / table).rglob("*.parquet")):  # no file of it is published yet
        return Counter()
    found = ds.dataset(lake / table, partitioning="hive").to_table(columns=["run_id"])
    return Counter(
        {one["values"]: one["counts"] for one in found["run_id"].value_counts().to_pylist()}
    )
