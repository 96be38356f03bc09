"""A lake in an object store, as moto's server plays one; moto and duckdb are in JUDGES_VENV."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pyarrow.dataset as ds
import pyarrow.fs as pafs
import pytest

from foretwin.orchestrator.commands.cli import run as command
from foretwin.orchestrator.lake.collect import collect, damaged
from foretwin.orchestrator.lake.store import CLAIMS, ObjectStore, store_at
from tests.orchestrator.lake.made_runs import made_run
from tests.orchestrator.lake.test_collect import Killed
from tests.system.foretwin_command import wait_for

pytestmark = pytest.mark.judge


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """The address of a bucket, less what comes after its name."""
    venv = os.environ.get("JUDGES_VENV")
    server = Path(venv or "nowhere") / "bin" / "moto_server"
    if not server.is_file():
        pytest.skip("JUDGES_VENV names no environment with moto[server]")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    os.environ |= {"AWS_ACCESS_KEY_ID": "any", "AWS_SECRET_ACCESS_KEY": "any"}
    process = subprocess.Popen(
        [server, "-H", "127.0.0.1", "-p", str(port)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        wait_for(lambda: answers(port), "moto's server")
        there = f"endpoint_override=127.0.0.1:{port}&scheme=http&region=us-east-1"
        system = pafs.S3FileSystem(
            endpoint_override=f"127.0.0.1:{port}", scheme="http", region="us-east-1",
            allow_bucket_creation=True,
        )  # fmt: skip
        system.create_dir("bucket")
        yield f"s3://bucket/NAME?{there}"
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(30.0)


def answers(port: int) -> bool:
    with socket.socket() as asking:
        return asking.connect_ex(("127.0.0.1", port)) == 0


def runs_there(where: str, table: str) -> list[str]:
    system, path = pafs.FileSystem.from_uri(where)
    found = ds.dataset(f"{path}/{table}", filesystem=system, partitioning="hive")
    runs: list[str] = found.to_table()["run_id"].to_pylist()
    return sorted(runs)


def test_a_bucket_is_a_lake_like_a_folder(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = bucket.replace("NAME", "whole/lake")
    runs = [made_run(tmp_path, number) for number in range(3)]

    assert command(["collect", str(runs[0]), "--into", where]) == 0
    assert command(["collect", str(tmp_path), "--into", where]) == 0
    assert "2 collected, 1 were there" in capsys.readouterr().out
    assert command(["collect", str(tmp_path), "--into", where, "--verify"]) == 0
    assert "3 were there; 0 rows" in capsys.readouterr().out
    assert runs_there(where, "runs") == [run.name for run in runs]
    assert runs_there(where, "futures") == [run.name for run in runs for _ in range(5)]


class MortalObjects(ObjectStore):
    """Dies before one of its publications, and leaves its claim."""

    def publish(self, name: str) -> None:
        if name.startswith("rounds"):
            raise Killed
        super().publish(name)

    def forget_claim(self) -> None:
        pass


def test_what_a_killed_collect_left_in_a_bucket_is_finished(bucket: str, tmp_path: Path) -> None:
    where = bucket.replace("NAME", "killed/lake")
    store = store_at(where)
    assert isinstance(store, ObjectStore)
    runs = [made_run(tmp_path, number) for number in range(2)]
    collect(store, runs[:1])
    with pytest.raises(Killed):
        collect(MortalObjects(where, store.system), runs)

    assert runs_there(where, "rounds") == [runs[0].name]
    assert command(["collect", str(tmp_path), "--into", where]) == 2  # the claim is young
    (left,) = store.system.get_file_info(pafs.FileSelector(CLAIMS))
    store.system.delete_file(left.path)
    assert collect(store, runs).there == [run.name for run in runs]
    assert runs_there(where, "rounds") == [run.name for run in runs]
    assert (damaged(store), store.staged()) == ([], [])


def test_a_store_that_cannot_be_reached_is_one_line(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = str(made_run(tmp_path))
    away = "s3://bucket/lake?endpoint_override=127.0.0.1:1&scheme=http&region=us-east-1"

    for where in (away, bucket.replace("bucket/NAME", "no-such-bucket/lake")):
        assert command(["collect", run, "--into", where]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert f"--into {where}: " in said


def test_duckdb_reads_a_lake_as_it_lies(tmp_path: Path) -> None:
    python = Path(os.environ.get("JUDGES_VENV", "nowhere")) / "bin" / "python"
    if not python.is_file():
        pytest.skip("JUDGES_VENV names no environment with duckdb")
    collect(store_at(str(tmp_path / "lake")), [made_run(tmp_path, n, futures=n) for n in (2, 3)])
    query = (
        "SELECT run_day::VARCHAR, run_vehicle, run_id, count(*) FROM read_parquet("
        f"'{tmp_path}/lake/futures/**/*.parquet', hive_partitioning = true, union_by_name = true) "
        "JOIN (SELECT run_id AS other FROM read_parquet("
        f"'{tmp_path}/lake/runs/**/*.parquet')) ON other = run_id GROUP BY ALL ORDER BY ALL"
    )

    told = subprocess.run(
        [python, "-c", "import sys, duckdb; print(duckdb.sql(sys.argv[1]).fetchall())", query],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip

    rows = [("2026-11-23", "ego", f"20261123-00000{n}-abcd", n) for n in (2, 3)]
    assert told.strip() == str(rows)
