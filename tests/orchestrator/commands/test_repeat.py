"""A recorded future is played again to the same bits, or it is said why it cannot be."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.codec import write_message
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_folder import REPEATED
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.sim_worker.futures.job_tables import JOB_TABLES
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.sweeps import SMALL, alone, small_sweep
from tests.sim_worker.scenarios.worlds import cross

COVERS = (
    "foretwin.orchestrator.record.played_again",
    "foretwin.orchestrator.record.run_folder",
    "foretwin.sim_worker.futures.job_tables",
    "foretwin.orchestrator.record.recorded_jobs",
)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    spec = small_sweep(folder, SMALL.replace("horizon_s = 5.0", "horizon_s = 2.0"))
    loaded = load_spec(spec)
    run_sweep(loaded, folder / "out", alone(loaded))
    return folder / "out"


@pytest.fixture
def copied(swept: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(swept, tmp_path / "copied"))


def _rows(folder: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = pq.read_table(folder / "rows").to_pylist()
    return rows


def _said(capsys: pytest.CaptureFixture[str]) -> str:
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line


def test_every_future_of_a_sweep_comes_to_the_same(
    swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = _rows(swept)
    assert len({row["future_id"] for row in rows}) == len(rows)
    for row in rows[:: len(rows) // 4]:
        assert run(["repeat", str(swept), row["future_id"], "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == {
            "future": row["future_id"], "recorded_sha256": row["trajectory_sha256"],
            "sha256": row["trajectory_sha256"], "equal": True,
        }  # fmt: skip


def test_it_can_be_looked_at(swept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    future = _rows(swept)[0]["future_id"]
    assert run(["repeat", str(swept), future, "--view"]) == 0
    picture = swept / "repeated" / f"{future}.png"
    assert str(picture) in capsys.readouterr().out
    assert picture.read_bytes()[:4] == b"\x89PNG"


def _rewritten(folder: Path, table: str, metadata: dict[str, str], **columns: Any) -> None:
    """Write all parts of a table of a sweep again, with other values and other metadata."""
    for part in (folder / table).glob("*.parquet"):
        old = pq.read_table(part)
        rows = [row | columns for row in old.to_pylist()]
        said = {k.decode(): v.decode() for k, v in old.schema.metadata.items()} | metadata
        name = "futures" if table == "rows" else table
        schema = JOB_TABLES[name].with_metadata(said)
        pq.write_table(type(old).from_pylist(rows, schema=schema), part)


def test_a_file_where_pictures_belong_is_told_before_it_is_played(
    copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(copied / REPEATED, ignore_errors=True)
    (copied / REPEATED).touch()
    future = _rows(copied)[0]["future_id"]
    assert run(["repeat", str(copied), future, "--view"]) == 2
    said = capsys.readouterr()
    assert said.err == f"foretwin: --view {copied / REPEATED}: is no folder\n"
    assert said.out == ""


def test_what_comes_to_something_else_is_3(copied: Path) -> None:
    future = _rows(copied)[0]["future_id"]
    _rewritten(copied, "rows", {}, trajectory_sha256="0" * 64)
    assert run(["repeat", str(copied), future]) == 3


@pytest.mark.parametrize(
    ("table", "metadata", "columns", "said"),
    [
        ("rows", {"result_schema": "0"}, {}, "another foretwin (schema of results 0"),
        ("jobs", {"versions": '{"python": "2.7"}'}, {}, "recorded with python 2.7, here is"),
        ("rows", {"processor": "abacus", "arithmetic": ""}, {}, "recorded on abacus, this is"),
        ("rows", {"processor": "abacus", "arithmetic": "x"}, {}, "recorded on abacus, this is"),
        ("rows", {}, {"planner": "remote"}, "driven by 'remote' in another process"),
        ("rows", {}, {"trajectory_sha256": None, "left_out": "no room"}, "not played: no room"),
        ("jobs", {}, {"job": b"other"}, "is damaged"),
        ("rows", {"versions": "xx"}, {}, "cannot be read: JSON is malformed"),
        ("rows", {"versions": "[1]"}, {}, "Expected `object`, got `array`"),
        ("rows", {}, {"index": None}, "cannot be read: Expected `int`, got `null` - at `$.index`"),
        ("rows", {}, {"index": 99}, "index 99 is not that of"),
        ("rows", {}, {"index": -1}, "index -1 is not that of"),
        ("rows", {}, {"job_sha256": "zz"}, "no job_sha256 'zz'"),
        ("rows", {}, {"trajectory_sha256": None}, "was not played: its row does not say why"),
        ("jobs", {}, {"job": None}, "cannot be read: Expected `bytes`, got `null` - at `$.job`"),
    ],
)
def test_what_cannot_be_repeated_is_told_in_one_line(
    copied: Path, table: str, metadata: dict[str, str], columns: dict[str, Any], said: str,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    future = _rows(copied)[0]["future_id"]
    _rewritten(copied, table, metadata, **columns)
    assert run(["repeat", str(copied), future]) == 2
    assert said in _said(capsys)


@pytest.mark.parametrize(
    ("table", "column"),
    [("rows", name) for name in ("future_id", "job_sha256", "index", "planner")]
    + [("rows", "trajectory_sha256"), ("jobs", "job_sha256"), ("jobs", "job")],
)
def test_a_column_that_is_gone_is_named(
    copied: Path, table: str, column: str, capsys: pytest.CaptureFixture[str]
) -> None:
    future = _rows(copied)[0]["future_id"]
    for part in (copied / table).glob("*.parquet"):
        pq.write_table(pq.read_table(part).drop_columns([column]), part)
    assert run(["repeat", str(copied), future]) == 2
    said = _said(capsys)
    assert f"{table}/job-0" in said
    assert column in said


def test_another_processor_of_the_same_arithmetic_repeats(copied: Path) -> None:
    future = _rows(copied)[0]["future_id"]
    for table in ("rows", "jobs"):
        _rewritten(copied, table, {"processor": "abacus"})
    assert run(["repeat", str(copied), future]) == 0


@pytest.mark.parametrize("key", ["result_schema", "versions", "processor"])
def test_a_table_that_does_not_say_what_it_was_played_with_is_refused(
    copied: Path, key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    future = _rows(copied)[0]["future_id"]
    for part in (copied / "rows").glob("*.parquet"):
        table = pq.read_table(part)
        del (metadata := dict(table.schema.metadata))[key.encode()]
        pq.write_table(table.replace_schema_metadata(metadata), part)
    assert run(["repeat", str(copied), future]) == 2
    assert f"{copied}/rows/job-0" in _said(capsys)


def test_a_future_is_found_in_any_group_of_rows(copied: Path) -> None:
    future = _rows(copied)[-1]["future_id"]
    part = sorted((copied / "rows").glob("*.parquet"))[-1]
    pq.write_table(pq.read_table(part), part, row_group_size=1)
    assert pq.ParquetFile(part).num_row_groups > 1
    assert run(["repeat", str(copied), future]) == 0


def test_parts_of_other_jobs_stop_no_repeat(
    copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    future = _rows(copied)[-1]["future_id"]
    parts = sorted((copied / "rows").glob("*.parquet"))
    parts[0].write_bytes(b"no table")
    parts[1].unlink()
    assert run(["repeat", str(copied), future]) == 0
    capsys.readouterr()
    assert run(["repeat", str(copied), "nobody-1"]) == 2
    assert f"{parts[0]}: cannot be read" in _said(capsys)


def test_worlds_and_vehicles_are_those_of_their_names(
    copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    future = _rows(copied)[0]["future_id"]
    (world,) = (copied / "worlds").glob("*.world")
    whole = world.read_bytes()
    write_message(cross(signals=True), world)
    assert run(["repeat", str(copied), future]) == 2
    assert f"{world}: was changed: holds World {cross(signals=True).id}" in _said(capsys)
    world.write_bytes(whole)
    (vehicle,) = (copied / "vehicles").glob("*.vehicle")
    write_message(load_vehicle("vw_vanagon"), vehicle)
    assert run(["repeat", str(copied), future]) == 2
    assert f"{vehicle}: was changed: holds vehicle" in _said(capsys)


def test_what_is_not_there_is_told(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for unknown in ("nobody-1", os.fsdecode(b"\xff-1")):
        assert run(["repeat", str(swept), unknown]) == 2
        assert f"no future_id {unknown!r}" in _said(capsys)
    assert run(["repeat", str(tmp_path), "nobody-1"]) == 2
    assert "neither of a run nor a sweep" in _said(capsys)
    (tmp_path / "rows").mkdir()
    assert run(["repeat", str(tmp_path), "nobody-1"]) == 2
    assert f"{tmp_path}/rows: holds no rows" in _said(capsys)


def test_on_another_engine_it_says_how_far_apart_they_are(
    swept: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    future_id = _rows(swept)[0]["future_id"]
    assert run(["repeat", str(swept), future_id, "--physics", "multibody", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["engines"] == ["mujoco", "multibody"]
    assert 0.0 < said["apart"]["end_m"] <= said["apart"]["most_m"] < 1.0
    assert run(["repeat", str(swept), future_id, "--physics", "multibody"]) == 0
    assert "mujoco and multibody end 0." in capsys.readouterr().out
    assert run(["repeat", str(swept), future_id, "--physics", "mojuco"]) == 2
    assert _said(capsys).endswith("--physics mojuco: mujoco, multibody, gazebo, carla\n")
    assert run(["repeat", str(swept), future_id, "--physics", "multibody", "--view"]) == 2
    assert "--view: draws what was recorded" in _said(capsys)
    assert run(["repeat", str(swept), future_id, "--physics", "carla"]) == 2
    assert "needs CARLA's Python package" in _said(capsys)


def test_what_it_came_to_as_a_sibling_in_the_drive_is_compared(
    copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    future_id = _rows(copied)[0]["future_id"]
    asked = ["repeat", str(copied), future_id, "--physics", "multibody"]
    assert run([*asked, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["sibling_sha256"] is None
    (copied / "results").mkdir()
    sibling = {"future_id": future_id, "engine": "multibody", "motion_sha256": said["sha256"]}
    for row, code, words in (
        (sibling, 0, "its sibling of the drive: the same again"),
        (sibling | {"motion_sha256": "0" * 64}, 3, "its sibling of the drive: differs: 000"),
        (sibling | {"engine": "gazebo"}, 0, "does not collide"),
    ):
        rows = pa.Table.from_pylist([row], schema=TABLES["siblings"])
        pq.write_table(rows, copied / "results" / "siblings.parquet")
        assert run(asked) == code
        assert words in capsys.readouterr().out
