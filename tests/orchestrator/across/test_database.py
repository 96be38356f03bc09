from __future__ import annotations

import datetime
import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.database import AskedRows, ask, columns_in, tables_asked
from foretwin.orchestrator.across.places import found_in
from foretwin.orchestrator.across.tables import RunTables
from foretwin.orchestrator.lake.collect import collect
from foretwin.orchestrator.lake.store import FolderStore
from tests.orchestrator.lake.made_runs import TOLD, contents, flip_a_byte, made_run, made_sweep

COVERS = ("foretwin.orchestrator.across.tables",)
COUNTS = "SELECT run, count(*) FROM futures GROUP BY run ORDER BY run"


class Asked:
    """Tables of some places, and what was told of them."""

    def __init__(self, *places: Path) -> None:
        self.told: list[str] = []
        self.tables = RunTables(found_in([str(place) for place in places]), self.told.append)

    def __call__(self, sql: str) -> list[tuple[object, ...]]:
        return ask(self.tables, sql).rows


def three(tmp_path: Path) -> list[Path]:
    return [made_run(tmp_path / "runs", number, futures=2 + number) for number in range(3)]


def test_rows_of_all_runs_are_one_table_that_says_whose_they_are(tmp_path: Path) -> None:
    runs = three(tmp_path)

    answer = ask(Asked(tmp_path / "runs").tables, COUNTS)

    assert answer == AskedRows(["run", "count_star()"], [(runs[n].name, 2 + n) for n in range(3)])


def test_runs_sweeps_and_lakes_are_asked_together_each_run_once(tmp_path: Path) -> None:
    runs, sweep = three(tmp_path), made_sweep(tmp_path / "sweep")
    collect(FolderStore(tmp_path / "lake"), [*runs[1:], sweep])

    asked = Asked(tmp_path / "runs" / runs[0].name, runs[1], tmp_path / "lake")

    counts = [(run.name, 2 + n) for n, run in enumerate(runs)]
    assert asked(COUNTS) == [*counts, ("sweep-0cdb5ed7a3db79d9", 6)]
    told = asked("SELECT run, kind, seed, map FROM runs ORDER BY run")
    assert told[:3] == [(run.name, "drive", n, "town.osm") for n, run in enumerate(runs)]
    assert told[3][:2] == ("sweep-0cdb5ed7a3db79d9", "sweep")
    joined = "SELECT count(*) FROM futures JOIN runs USING (run) WHERE runs.kind = 'sweep'"
    assert asked(joined) == [(6,)]


def test_tables_are_named_in_letters_of_any_case(tmp_path: Path) -> None:
    three(tmp_path)
    asked = Asked(tmp_path / "runs")

    assert asked("SELECT count(*) FROM FUTURES NATURAL JOIN Runs") == asked(
        "SELECT count(*) FROM futures NATURAL JOIN runs"
    )
    assert len(asked("PIVOT Futures ON Planner USING count(*) GROUP BY run")) == 3


def test_an_instant_has_its_time_zone(tmp_path: Path) -> None:
    three(tmp_path)

    answer = ask(
        Asked(tmp_path / "runs").tables,
        "SELECT to_timestamp(0.5) AS t, [to_timestamp(0)] AS t, TIMESTAMPTZ 'infinity', "
        "NULL::TIMESTAMPTZ, 1::HUGEINT FROM runs LIMIT 1; -- the first",
    )

    assert answer.columns[:2] == ["t", "t_1"]
    ((half, (zero,), never, none, one),) = answer.rows
    assert half == datetime.datetime(1970, 1, 1, 0, 0, 0, 500_000, tzinfo=datetime.UTC)
    assert datetime.datetime.fromisoformat(zero).timestamp() == 0
    assert (never, none, one) == ("infinity", None, 1)


def test_the_record_of_a_run_is_asked_as_json(tmp_path: Path) -> None:
    made_run(tmp_path / "runs", told_by_nobody={"deep": [1, 2]})

    assert Asked(tmp_path / "runs")("SELECT record->>'$.told_by_nobody.deep[1]' FROM runs") == [
        ("2",)
    ]


def test_only_the_files_of_a_run_that_is_asked_for_are_opened(tmp_path: Path) -> None:
    runs = three(tmp_path)
    asked = Asked(tmp_path / "runs")
    damage_pages(runs[0] / "results" / "futures.parquet")

    assert asked(f"SELECT count(DISTINCT future_id) FROM futures WHERE run = '{runs[2].name}'") == [
        (4,)
    ]
    assert asked.told == []


def test_columns_that_a_run_lacks_are_null_and_types_that_widened_are_the_newest(
    tmp_path: Path,
) -> None:
    old = made_run(tmp_path / "runs", 1, futures=1)
    new = made_run(tmp_path / "runs", 2, futures=1)
    for run, columns in ((old, {"index": [7], "gone": ["x"]}), (new, {"index": [0.5], "new": [1]})):
        table = pa.table(columns).replace_schema_metadata(TOLD)
        pq.write_table(table, run / "results" / "futures.parquet")

    rows = Asked(tmp_path / "runs")("SELECT run, index, new, gone FROM futures ORDER BY run")

    assert rows == [(old.name, 7.0, None, "x"), (new.name, 0.5, 1, None)]


def test_a_table_that_no_run_has_is_empty_and_has_its_columns(tmp_path: Path) -> None:
    asked = Asked(made_sweep(tmp_path / "sweep"))

    assert asked("SELECT count(latency_ms) FROM rounds JOIN runs USING (run)") == [(0,)]
    assert asked("SELECT count(latency_ms) FROM rounds") == [(0,)]


def test_parts_of_a_table_are_one(tmp_path: Path) -> None:
    run = made_run(tmp_path, futures=3)
    shutil.copy(run / "results/futures.parquet", run / "results/futures-001.parquet")

    assert Asked(run)(COUNTS) == [(run.name, 6)]


@pytest.mark.parametrize("name", ["it's", "a[1]*?", '"quoted"', "é ü"])
def test_folders_may_be_called_anything(tmp_path: Path, name: str) -> None:
    run = made_run(tmp_path / name, futures=4)

    assert Asked(tmp_path / name)(COUNTS) == [(run.name, 4)]


def damage_pages(file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[4:2000] = bytes(1996)
    file.write_bytes(data)


def cut_short(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-1])


@pytest.mark.parametrize("spoil", [damage_pages, flip_a_byte, cut_short])
def test_a_damaged_file_is_left_out_and_told(tmp_path: Path, spoil: object) -> None:
    runs = three(tmp_path)
    file = runs[1] / "results" / "futures.parquet"
    spoil(file)  # type: ignore[operator]
    asked = Asked(tmp_path / "runs")

    rows = asked("SELECT run, count(DISTINCT future_id) FROM futures GROUP BY run ORDER BY run")

    assert rows == [(runs[0].name, 2), (runs[2].name, 4)]
    (told,) = asked.told
    assert told.startswith(f"left out: {file}: ")
    assert "\n" not in told


def test_what_runs_or_was_killed_is_in_runs_alone(tmp_path: Path) -> None:
    whole, killed = made_run(tmp_path, 1), made_run(tmp_path, 2, exit="running")
    asked = Asked(tmp_path)

    assert asked(COUNTS) == [(whole.name, 5)]
    assert asked("SELECT run, state FROM runs ORDER BY run")[1] == (killed.name, "killed")
    assert asked.told == [f"{killed}: killed: only its row in runs can be asked"]


@pytest.mark.parametrize(
    ("sql", "told"),
    [
        ("SELECT colided FROM futures", r"no column 'colided' \(did you mean collided"),
        ("SELECT colided FROM futures", r"DESCRIBE futures lists its \d+ columns"),
        ("SELECT nothing FROM events", r"no column 'nothing'; events has run, "),
        ("SELECT r.fles FROM runs r", r"no column 'fles' .*; runs has run, kind, time, state"),
        ("SELECT * FROM futurs", r"no table 'futurs' \(did you mean futures\?\): agreement, "),
        ("SELEC 1", r"syntax error at or near \"SELEC\" \(in line 1\)"),
        ("", "one SELECT is asked for"),
        ("SELECT 1; SELECT 2", "one SELECT is asked for"),
        ("FROM futurs JOIN runs USING (run)", r"no table 'futurs' \(did you mean futures\?"),
        ("SELECT nofunction(run) FROM runs", "nofunction does not exist"),
        ("SELECT run::INT FROM runs", "Could not convert string"),
    ],
)
def test_what_is_wrong_with_a_question_is_one_line(tmp_path: Path, sql: str, told: str) -> None:
    asked = Asked(made_run(tmp_path))

    with pytest.raises(UserError, match=told) as found:
        asked(sql)

    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    "sql",
    [
        "COPY futures TO 'FILE'",
        "COPY (SELECT 1) TO 'RUN/results/futures.parquet'",
        "WITH a AS (COPY (SELECT 1) TO 'FILE') SELECT * FROM a",
        "CREATE TABLE t AS SELECT 1",
        "SELECT * FROM read_text('RUN/run.json')",
        "SELECT * FROM read_parquet('RUN/results/futures.parquet')",
        "SELECT * FROM 'RUN/results/futures.parquet'",
        "SELECT * FROM glob('RUN/*')",
        "ATTACH 'FILE'",
        "SET enable_external_access = true",
        "SELECT set_config('enable_external_access', 'true')",
        "INSTALL httpfs",
        "LOAD httpfs",
        "PRAGMA enable_external_access",
        "DELETE FROM futures",
        "SELECT * FROM asked",
        "SELECT * FROM read_csv('http://127.0.0.1:1/a.csv')",
    ],
)
def test_a_question_reaches_nothing_but_the_tables_and_changes_nothing(
    tmp_path: Path, sql: str
) -> None:
    run = made_run(tmp_path / "runs")
    asked, before = Asked(run), contents(tmp_path)

    with pytest.raises(UserError):
        asked(sql.replace("RUN", str(run)).replace("FILE", str(tmp_path / "written")))

    assert contents(tmp_path) == before


def test_a_question_is_given_the_tables_that_it_names(tmp_path: Path) -> None:
    tables = Asked(made_run(tmp_path)).tables

    assert tables_asked(tables, "SELECT 1 FROM futures, rounds") == ["futures", "rounds"]
    assert tables_asked(tables, "WITH x AS (FROM jobs) SELECT * FROM x") == ["jobs"]
    assert tables_asked(tables, "FROM futures f JOIN runs r USING (run)") == ["futures", "runs"]
    assert "gaps" in tables_asked(tables, "SHOW TABLES")
    assert tables_asked(tables, "PIVOT futures ON planner USING count(*)") == ["futures"]


def test_columns_of_views_are_told_with_their_types(tmp_path: Path) -> None:
    columns = columns_in(Asked(made_run(tmp_path)).tables, ["events", "runs"])

    assert next(iter(columns["events"])) == "run"
    assert columns["runs"]["futures"] == "BIGINT"


@pytest.mark.parametrize("spoil", [damage_pages, flip_a_byte])
def test_a_damaged_lake_is_told(tmp_path: Path, spoil: Callable[[Path], None]) -> None:
    collect(FolderStore(tmp_path / "lake"), three(tmp_path))
    spoil(next(tmp_path.glob("lake/futures/*/*/*/*.parquet")))

    with pytest.raises(UserError, match="the lake is damaged there"):
        Asked(tmp_path / "lake")("SELECT max(future_id) FROM futures")
