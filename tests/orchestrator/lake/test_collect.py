from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake import collect as collecting
from foretwin.orchestrator.lake.collect import collect, damaged
from foretwin.orchestrator.lake.store import FolderStore
from tests.orchestrator.lake.made_runs import (
    contents,
    lake_table,
    made_run,
    made_sweep,
    manifest_of,
    rows_by_run,
)

TABLES = "futures", "rounds", "runs"


def three_runs(tmp_path: Path) -> list[Path]:
    return [made_run(tmp_path / "runs", number, futures=4 + number) for number in range(3)]


def test_runs_of_one_partition_share_a_file_of_each_table(tmp_path: Path) -> None:
    runs = three_runs(tmp_path)

    done = collect(FolderStore(tmp_path / "lake"), runs)

    assert sorted(done.added) == [run.name for run in runs]
    assert done.rows == (4 + 5 + 6) + 3 + 3
    files = [name for name in contents(tmp_path / "lake") if name.endswith(".parquet")]
    where = "run_day=2026-11-23/run_vehicle=ego/run_map=osm-5e87b1fe11c1/part-00000.parquet"
    assert sorted(files) == [f"{table}/{where}" for table in TABLES]
    assert rows_by_run(tmp_path / "lake", "futures") == {
        run.name: 4 + number for number, run in enumerate(runs)
    }
    table = lake_table(tmp_path / "lake", "futures").to_pylist()
    assert {row["end_x_m"] for row in table if row["run_id"] == runs[2].name} == {
        2.0 + index / 8.0 for index in range(6)
    }
    assert {row["run_vehicle"] for row in table} == {"ego"}


def test_runs_are_counted_as_their_rows_are_written_and_not_before(tmp_path: Path) -> None:
    runs = [*three_runs(tmp_path), made_run(tmp_path / "killed", 3, exit="running")]
    lake = tmp_path / "lake"
    counted: list[tuple[str, int]] = []

    def advance(what: str, *, by: int = 1) -> None:
        counted.append((what, by))

    collect(FolderStore(lake), runs, advance=advance)

    by_what: dict[str, int] = {}
    for what, by in counted:
        by_what[what] = by_what.get(what, 0) + by
    assert sum(by_what.values()) == len(runs)
    assert [by_what[f"reading {run.name}"] for run in runs] == [0] * 4
    assert by_what[runs[3].name] == 1  # refused
    assert by_what["futures"] >= 1
    assert by_what["published"] == 1
    assert max(by for _, by in counted) == 1

    counted.clear()
    collect(FolderStore(lake), runs[:3], advance=advance)
    assert [what for what, by in counted if by] == [run.name for run in runs[:3]]


def test_the_same_runs_again_change_no_byte(tmp_path: Path) -> None:
    runs, lake = three_runs(tmp_path), tmp_path / "lake"
    collect(FolderStore(lake), runs)
    before = contents(lake)

    done = collect(FolderStore(lake), [*runs, runs[0]])

    assert sorted(done.there) == sorted([*(run.name for run in runs), runs[0].name])
    assert (done.added, done.rows) == ([], 0)
    assert contents(lake) == before


def test_a_later_run_goes_into_the_file_that_is_there(tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    for run in three_runs(tmp_path):
        collect(FolderStore(lake), [run])

    assert len([name for name in contents(lake) if name.startswith("futures/")]) == 1
    assert rows_by_run(lake, "futures").total() == 15
    assert damaged(FolderStore(lake)) == []


def test_the_manifest_says_of_each_run_what_it_was_and_where_its_rows_are(tmp_path: Path) -> None:
    run = made_run(tmp_path, futures=7)
    collect(FolderStore(tmp_path / "lake"), [run])

    told = manifest_of(tmp_path / "lake")

    of_run = told["runs"][run.name]
    assert (of_run["kind"], of_run["result_schema"]) == ("drive", 1)
    assert len(of_run["source_sha256"]) == 64
    assert of_run["tables"]["futures"] == {"rows": 7, "files": ["part-00000.parquet"]}
    assert all(len(file["sha256"]) == 64 for file in told["files"].values())


def test_a_run_that_changed_is_refused_and_replaced_only_when_asked(tmp_path: Path) -> None:
    lake, first = tmp_path / "lake", made_run(tmp_path / "runs", 1)
    other = made_run(tmp_path / "runs", 2)
    collect(FolderStore(lake), [first, other])
    shutil.rmtree(first)
    changed = made_run(tmp_path / "runs", 1, futures=9)

    refused = collect(FolderStore(lake), [changed])
    assert "is another one since: --replace" in refused.refused[0]
    assert rows_by_run(lake, "futures")[first.name] == 5

    done = collect(FolderStore(lake), [changed], replace=True)
    assert done.replaced == [first.name]
    assert rows_by_run(lake, "futures") == {first.name: 9, other.name: 5}
    assert manifest_of(lake)["runs"][first.name]["tables"]["futures"]["rows"] == 9
    assert damaged(FolderStore(lake)) == []


def test_a_replaced_run_leaves_its_earlier_partition(tmp_path: Path) -> None:
    lake, run = tmp_path / "lake", made_run(tmp_path / "runs", 1)
    collect(FolderStore(lake), [run])
    shutil.rmtree(run)
    changed = made_run(tmp_path / "runs", 1, vehicle_id="another", futures=2)

    collect(FolderStore(lake), [changed], replace=True)

    rows = lake_table(lake, "futures").to_pylist()
    assert [(row["run_vehicle"], row["run_id"]) for row in rows] == 2 * [("another", run.name)]


def test_two_folders_that_say_they_are_one_run_and_differ_are_told_apart(tmp_path: Path) -> None:
    one, two = made_run(tmp_path / "a"), made_run(tmp_path / "b", futures=6)

    done = collect(FolderStore(tmp_path / "lake"), [one, two])

    assert done.added == [one.name]
    assert done.refused == [f"{two}: is called {one.name} as {one} is"]


def test_a_run_whose_pages_are_damaged_is_refused_and_the_others_are_taken(tmp_path: Path) -> None:
    runs, lake = three_runs(tmp_path), tmp_path / "lake"
    file = runs[1] / "results" / "futures.parquet"
    data = bytearray(file.read_bytes())
    data[4:2000] = bytes(1996)
    file.write_bytes(data)

    done = collect(FolderStore(lake), runs)

    assert done.added == [runs[0].name, runs[2].name]
    assert len(done.refused) == 1
    assert str(file) in done.refused[0]
    assert set(rows_by_run(lake, "runs")) == {runs[0].name, runs[2].name}


def test_a_run_that_goes_away_meanwhile_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = three_runs(tmp_path)
    staged = collecting.write_parts

    def removing(*given: Any, **more: Any) -> Any:
        shutil.rmtree(runs[1], ignore_errors=True)
        return staged(*given, **more)

    monkeypatch.setattr(collecting, "write_parts", removing)
    done = collect(FolderStore(tmp_path / "lake"), runs)

    assert done.added == [runs[0].name, runs[2].name]
    assert str(runs[1]) in done.refused[0]


class Killed(BaseException):
    """Ends a collect as a kill does: nobody handles it."""


class MortalStore(FolderStore):
    """Dies before one of its writes."""

    def __init__(self, folder: Path, dies_at: int) -> None:
        super().__init__(folder)
        self.left = dies_at

    def _count(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise Killed

    def write(self, name: str, data: bytes) -> None:
        self._count()
        super().write(name, data)

    def renew(self) -> None:
        self._count()

    def publish(self, name: str) -> None:
        self._count()
        super().publish(name)


def died(lake: Path, runs: list[Path], at: int) -> bool:
    try:
        collect(MortalStore(lake, at), runs)
    except Killed:
        return True
    return False


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    """A lake with two runs, and four further ones."""
    folder = tmp_path_factory.mktemp("before")
    runs = [made_run(folder / "runs", number, day=day) for day in ("20261123", "20261124")
            for number in range(3)]  # fmt: skip
    collect(FolderStore(folder / "lake"), runs[:2])
    return folder / "lake", runs


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.judge)])
def test_killed_anywhere_it_leaves_whole_runs_and_the_next_one_finishes(
    tmp_path: Path,
    before: tuple[Path, list[Path]],
    monkeypatch: pytest.MonkeyPatch,
    every: int,
) -> None:
    monkeypatch.setattr(collecting, "STEP_BYTES", 1)  # one run in each step
    lake_before, runs = before
    names = {run.name for run in runs}
    kills = 0
    for at in range(0, 1000, every):
        lake = tmp_path / f"lake{at}"
        shutil.copytree(lake_before, lake)
        if not died(lake, runs, at):
            break
        kills += 1
        seen = {table: rows_by_run(lake, table) for table in TABLES}
        assert all(count == 5 for count in seen["futures"].values())
        assert all(count == 1 for count in seen["runs"].values())
        assert set(seen["runs"]) >= {run.name for run in runs[:2]}
        assert set(seen["runs"]) <= set(seen["futures"])  # who is in runs is there whole
        done = collect(FolderStore(lake), runs)
        assert done.refused == []
        assert rows_by_run(lake, "futures") == dict.fromkeys(names, 5)
        assert damaged(FolderStore(lake)) == []
        assert not [name for name in contents(lake) if name.startswith("_staged")]
    assert kills > 30 // every


def test_what_is_damaged_in_a_lake_is_named(tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    collect(FolderStore(lake), three_runs(tmp_path))
    one, other = sorted(lake.rglob("*.parquet"))[:2]
    one.write_bytes(one.read_bytes()[:-1] + b"?")
    other.unlink()

    assert damaged(FolderStore(lake)) == [
        f"{one}: is not what was written", f"{other}: is not there",
    ]  # fmt: skip


def test_a_lake_that_is_damaged_where_rows_are_added_says_so(tmp_path: Path) -> None:
    lake, runs = tmp_path / "lake", three_runs(tmp_path)
    collect(FolderStore(lake), runs[:1])
    next(iter(lake.glob("futures/*/*/*/*.parquet"))).write_bytes(b"no Parquet")

    with pytest.raises(UserError, match="the lake is damaged there"):
        collect(FolderStore(lake), runs)


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda out: made_run(out, exit="running"), "foretwin recover"),
        (lambda out: made_sweep(out / "s", complete=False), "`foretwin sweep` goes on"),
        (lambda out: made_sweep(out / "s", shard="1/3"), "shard 1/3 of a sweep: `foretwin"),
        (lambda out: made_run(out, told={"result_schema": "0"}), r"schema of results 0; this one"),
        (lambda out: made_run(out, told={}), r"schema of results not told; this one reads 1"),
    ],
)
def test_what_cannot_be_collected_is_told_in_one_line(
    tmp_path: Path, spoil: Callable[[Path], Any], told: str
) -> None:
    good = made_run(tmp_path / "good", 7)

    done = collect(FolderStore(tmp_path / "lake"), [spoil(tmp_path / "bad"), good])

    assert done.added == [good.name]
    assert len(done.refused) == 1
    assert told in done.refused[0]
    assert "\n" not in done.refused[0]
