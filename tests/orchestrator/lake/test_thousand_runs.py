"""A thousand runs, copies of a real one, collected twice, and with a kill at any instant.

FORETWIN_LAKE_RUN names a finished run to copy; without it one is driven.
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pyarrow.parquet as pq
import pytest

from tests.orchestrator.lake.copied_runs import DAYS, MAPS, VEHICLES, copies_of
from tests.orchestrator.lake.made_runs import contents, lake_table, rows_by_run
from tests.system.foretwin_command import environment, foretwin

pytestmark = [pytest.mark.judge, pytest.mark.timeout(1800)]
COUNT, KILLS, QUERY_S = 1000, 20, 3.0
SEED = int(os.environ.get("FORETWIN_KILL_SEED", "0")) or random.SystemRandom().randrange(1, 10**6)


class Copies(NamedTuple):
    """Folder of the copies, and rows of each table in each of them."""

    folder: Path
    rows: dict[str, int]


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
    copies_of(run, folder / "runs", COUNT)
    return Copies(folder / "runs", {name: count for name, count in rows.items() if count})


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


def test_a_collect_that_is_killed_leaves_a_lake_of_whole_runs(
    copies: Copies, tmp_path: Path
) -> None:
    drawn, lake = random.Random(SEED), tmp_path / "lake"
    print(f"\nFORETWIN_KILL_SEED={SEED}")
    seen = []
    for _ in range(KILLS):
        with collecting(copies, lake) as process:
            after_s = drawn.uniform(0.5, 12.0)
            try:
                process.wait(after_s)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
        runs = rows_by_run(lake, "runs")
        assert all(count == 1 for count in runs.values())
        for table, rows in copies.rows.items():
            there = rows_by_run(lake, table)
            assert set(there.values()) <= {rows}, table
            assert runs.keys() <= there.keys(), table
        seen.append(len(runs))
    print(f"runs in the lake after each kill: {seen}")

    collected(copies, lake)

    names = {path.name for path in copies.folder.iterdir()}
    for table, rows in copies.rows.items():
        assert rows_by_run(lake, table) == Counter(dict.fromkeys(names, rows)), table
