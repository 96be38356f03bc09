from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake import part_files, sources
from foretwin.orchestrator.lake.collect import collect, damaged
from foretwin.orchestrator.lake.part_files import UncollectableError, widened
from foretwin.orchestrator.lake.sources import SourceTables, source_of
from foretwin.orchestrator.lake.store import FolderStore
from foretwin.orchestrator.record.results import TABLES
from tests.orchestrator.lake.made_runs import (
    CREDIT,
    TOLD,
    flip_a_byte,
    lake_table,
    made_run,
    manifest_of,
    rows_by_run,
    write,
)


def test_a_file_that_is_full_is_followed_by_another_and_left_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(part_files, "PART_BYTES", 1000)
    monkeypatch.setattr(part_files, "GROUP_ROWS", 50)
    monkeypatch.setattr(sources, "BATCH_ROWS", 50)
    lake = tmp_path / "lake"
    first, second = (made_run(tmp_path, number, futures=120) for number in range(2))
    collect(FolderStore(lake), [first])
    full = {path: path.stat().st_ino for path in lake.glob("futures/*/*/*/*.parquet")}
    assert sorted(path.name for path in full) == [f"part-0000{n}.parquet" for n in range(3)]

    collect(FolderStore(lake), [second])

    assert rows_by_run(lake, "futures") == {first.name: 120, second.name: 120}
    assert {path: path.stat().st_ino for path in full} == full
    told = manifest_of(lake)["runs"]
    assert told[first.name]["tables"]["futures"]["files"][-1] == "part-00002.parquet"
    assert told[second.name]["tables"]["futures"]["files"][0] == "part-00003.parquet"
    assert damaged(FolderStore(lake)) == []


def test_a_byte_that_flipped_in_a_file_that_is_written_anew_is_told(tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    collect(FolderStore(lake), [made_run(tmp_path, 1)])
    (file,) = lake.glob("futures/*/*/*/*.parquet")
    flip_a_byte(file)

    with pytest.raises(UserError, match="the lake is damaged there"):
        collect(FolderStore(lake), [made_run(tmp_path, 2)])


def test_small_runs_make_large_groups_of_rows(tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    collect(FolderStore(lake), [made_run(tmp_path, number) for number in range(6)])

    (file,) = lake.glob("futures/*/*/*/*.parquet")

    assert pq.read_metadata(file).num_row_groups == 1
    assert pq.read_schema(file).metadata[b"attribution"] == CREDIT.encode()


def with_column(run: Path, name: str, values: pa.Array) -> Path:
    file = run / "results" / "rounds.parquet"
    rows = pq.read_table(file).append_column(name, values)
    pq.write_table(rows.replace_schema_metadata(TOLD), file)
    return run


def test_a_column_that_is_new_is_null_in_the_rows_before_it(tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    collect(FolderStore(lake), [made_run(tmp_path, 1)])

    collect(FolderStore(lake), [with_column(made_run(tmp_path, 2), "new_s", pa.array([0.5]))])
    collect(FolderStore(lake), [made_run(tmp_path, 3)])

    rows = sorted(lake_table(lake, "rounds").to_pylist(), key=lambda row: row["run_id"])
    assert [row["new_s"] for row in rows] == [None, 0.5, None]
    assert manifest_of(lake)["columns"]["rounds"]["new_s"] == "double"


def test_a_column_of_another_type_is_refused_by_name(tmp_path: Path) -> None:
    run = with_column(made_run(tmp_path, 2), "new_s", pa.array(["half"]))
    tables = SourceTables(source_of(run))

    with pytest.raises(UncollectableError, match="rounds: column new_s is string, in the lake"):
        widened({"new_s": "double"}, tables, "rounds")


def test_a_type_that_no_table_has_is_refused(tmp_path: Path) -> None:
    run = with_column(made_run(tmp_path, 2), "new_s", pa.array([0.5], pa.float16()))

    with pytest.raises(UncollectableError, match="is halffloat, in the lake it is one of"):
        widened({}, SourceTables(source_of(run)), "rounds")


def test_numbers_by_name_stay_so(tmp_path: Path) -> None:
    run = made_run(tmp_path, futures=2)
    write(run / "results" / "mirrored.parquet", [], TABLES["mirrored"], TOLD)
    collect(FolderStore(tmp_path / "lake"), [run])

    values = lake_table(tmp_path / "lake", "futures")["values"].to_pylist()

    assert values == [[("gap_s", 0.0)], [("gap_s", 1.0)]]
