from __future__ import annotations

import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across import table_heads
from foretwin.orchestrator.across.table_heads import TableHeads, footer_of, not_whole
from foretwin.orchestrator.record.result_files import opened
from tests.orchestrator.lake.made_runs import flip_a_byte, made_run

COVERS = ("foretwin.orchestrator.record.result_files",)
TOLD = {"result_schema": "1"}


def written(file: Path, columns: dict[str, list[object]], told: dict[str, str] = TOLD) -> Path:
    table = pa.table(columns)
    pq.write_table(table.replace_schema_metadata(told), file)
    return file


def test_of_files_with_the_same_columns_one_is_parsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [
        written(tmp_path / f"{number}", {"a": [number], "text": ["x" * number]}, TOLD | {"n": "y"})
        for number in range(5)
    ]
    parsed, opened = [], table_heads.opened
    monkeypatch.setattr(table_heads, "opened", lambda file: parsed.append(file) or opened(file))
    heads = TableHeads()

    assert [heads.trouble(file) for file in files] == [""] * 5
    assert parsed == files[:1]
    assert heads.fields == {"a": pa.int64(), "text": pa.string()}


def test_columns_of_all_files_are_known_and_the_first_type_counts(tmp_path: Path) -> None:
    heads = TableHeads()
    heads.trouble(written(tmp_path / "new", {"a": [1.0], "new": [True]}))
    heads.trouble(written(tmp_path / "old", {"old": ["x"], "a": [1]}))

    assert heads.fields == {"a": pa.float64(), "new": pa.bool_(), "old": pa.string()}


@pytest.mark.parametrize("told", [{"result_schema": "0"}, {"result_schema": "11"}, {}])
def test_a_file_of_another_schema_is_told_even_after_one_with_the_same_columns(
    tmp_path: Path, told: dict[str, str]
) -> None:
    heads = TableHeads()
    assert not heads.trouble(written(tmp_path / "good", {"a": [1]}))

    assert "written by another foretwin" in heads.trouble(written(tmp_path / "b", {"a": [1]}, told))


def test_the_metadata_is_found_however_long_it_is(tmp_path: Path) -> None:
    file = written(tmp_path / "long", {"a": [1]}, TOLD | {"long": "z" * 200_000})

    assert b"z" * 200_000 in footer_of(file)
    assert footer_of(file)[-4:] != b"PAR1"


def test_a_file_that_is_cut_short_is_told(tmp_path: Path) -> None:
    good = written(tmp_path / "good", {"a": [1]})
    for length in (0, 3, 11, good.stat().st_size - 1):
        bad = tmp_path / f"cut at {length}"
        bad.write_bytes(good.read_bytes()[:length])

        assert not_whole([good, bad]) == f"{bad}: is cut short or damaged: no whole Parquet"
        assert TableHeads().trouble(bad)
    assert not_whole([good]) == ""
    assert "No such file" in not_whole([tmp_path / "nowhere"])


def test_a_byte_that_flipped_is_damage_that_names_its_file(tmp_path: Path) -> None:
    file = made_run(tmp_path) / "results" / "futures.parquet"
    flip_a_byte(file)

    with pytest.raises(UserError, match=re.escape(f"{file}: cannot be read: ")), opened(file) as it:
        it.read(["future_id"])
