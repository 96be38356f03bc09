"""Shards come to what one sweep comes to; what is missing, doubled or strange is said in a line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.sweep.merge import merge
from foretwin.orchestrator.sweep.shard import Shard
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.sweeps import SMALL, alone, small_sweep
from tests.sim_worker.scenarios.worlds import tee

SHORT = SMALL.replace("horizon_s = 5.0", "horizon_s = 1.0")


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A folder with a sweep in `whole`, the same in three shards `0`, `1`, `2`, and its summary."""
    folder = tmp_path_factory.mktemp("swept")
    spec = small_sweep(folder, SHORT)
    WorldStore(folder / "drawn").save(tee())
    loaded = load_spec(spec)
    whole = run_sweep(loaded, folder / "whole", alone(loaded))
    for number in range(3):
        run_sweep(loaded, folder / str(number), alone(loaded), shard=Shard(number, 3))
    return folder, whole


def shards(folder: Path) -> list[Path]:
    return [folder / str(number) for number in range(3)]


def copied(folder: Path, to: Path) -> list[Path]:
    return [Path(shutil.copytree(shard, to / shard.name)) for shard in shards(folder)]


def files(folder: Path, *tables: str) -> dict[str, bytes]:
    found = (path for table in tables for path in sorted((folder / table).iterdir()))
    return {f"{path.parent.name}/{path.name}": path.read_bytes() for path in found}


def said(summary: dict[str, Any]) -> dict[str, Any]:
    now = ("ledger", "jobs_played", "playing_s", "shards")
    return {name: value for name, value in summary.items() if name not in now}


def test_shards_together_are_the_sweep_to_the_byte(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, whole = swept
    out = tmp_path / "out"
    merged = merge(shards(folder)[::-1], out)
    assert merged["rows_sha256"] == whole["rows_sha256"]
    assert said(json.loads((out / "sweep.json").read_text())) == said(
        json.loads((folder / "whole" / "sweep.json").read_text())
    )
    tables = ("rows", "jobs", "road_users", "worlds", "places", "vehicles")
    assert files(out, *tables) == files(folder / "whole", *tables)
    loaded = load_spec(folder / "small.toml")
    again = run_sweep(loaded, out, alone(loaded))
    assert (again["jobs_played"], again["rows_sha256"]) == (0, whole["rows_sha256"])


def test_merging_again_changes_nothing_and_ends_what_a_kill_cut_short(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, whole = swept
    out = tmp_path / "out"
    merge(shards(folder), out)
    before = files(out, "rows", "jobs", "road_users")
    listed = (out / "manifest.jsonl").read_bytes()
    assert merge(shards(folder), out)["rows_sha256"] == whole["rows_sha256"]
    assert (out / "manifest.jsonl").read_bytes() == listed
    (out / "rows" / "job-000001.parquet").unlink()
    (out / "manifest.jsonl").write_bytes(listed[: len(listed) // 2])
    assert merge(shards(folder), out)["rows_sha256"] == whole["rows_sha256"]
    assert files(out, "rows", "jobs", "road_users") == before
    assert pq.read_table(out / "rows").num_rows == whole["rows"]


def test_a_shard_that_was_run_twice_counts_once_and_is_told(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, whole = swept
    loaded = load_spec(folder / "small.toml")
    again = tmp_path / "again"
    run_sweep(loaded, again, alone(loaded), shard=Shard(1, 3))
    capsys.readouterr()
    merged = merge([*shards(folder), again], tmp_path / "out")
    assert merged["rows_sha256"] == whole["rows_sha256"]
    told = capsys.readouterr().err
    assert told == f"shard 1/3 is in {folder / '1'} and in {again}: the same rows\n"
    # In its own folder nothing is played again.
    assert run_sweep(loaded, again, alone(loaded), shard=Shard(1, 3))["jobs_played"] == 0


def resaid(folder: Path, **changed: Any) -> None:
    """Change what a shard's summary says."""
    file = folder / "sweep.json"
    summary = json.loads(file.read_text())
    for name, value in changed.items():
        if isinstance(value, dict):
            value = summary[name] | value
        summary[name] = value
    file.write_text(json.dumps(summary))


@pytest.mark.parametrize(
    ("harm", "told"),
    [
        (lambda f: resaid(f[1], complete=False), "1: shard 1/3 is not done; the same command goes"),
        (lambda f: resaid(f[1], spec={"seed": 7}), "spec than .*/0: seed is 7, there 0"),
        (
            lambda f: resaid(f[1], versions={"numpy": "9"}),
            "another version than .*: numpy is 9,",
        ),
        (lambda f: resaid(f[1], fingerprint="0"), "1: of another map, scenario, vehicle or planne"),
        (lambda f: resaid(f[1], places_sha256="0"), "1: has other places than .*/0$"),
        (
            lambda f: resaid(f[1], places_sha256="0", failures={"n4": "no room"}),
            r"/1: has other places than .*/0 \(n4 failed: try that shard again\)$",
        ),
        (lambda f: resaid(f[1], shard="1/4"), "1: shard 1/4, but .*/0 is 0/3"),
        (lambda f: resaid(f[1], shard="2/3"), "2: shard 2/3 is in .*/1 too, with other rows"),
        (lambda f: resaid(f[1], shard="x"), "sweep.json is damaged: --shard x"),
        (lambda f: (f[1] / "sweep.json").write_text("{"), "1: sweep.json is damaged: "),
        (lambda f: (f[1] / "sweep.json").unlink(), "1: holds no sweep"),
        (lambda f: (f[1] / "manifest.jsonl").unlink(), "1: job 2 is missing; the same command"),
        (
            lambda f: next((f[1] / "rows").iterdir()).write_bytes(b"x"),
            r"1/rows/job-00000\d.parquet: is not what was written; the command of shard 1/3 plays",
        ),
    ],
)
def test_what_does_not_fit_is_told_in_one_line(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, harm: Callable[[list[Path]], object],
    told: str,
) -> None:  # fmt: skip
    found = copied(swept[0], tmp_path)
    harm(found)
    with pytest.raises(UserError, match=told) as error:
        merge(found, tmp_path / "out")
    assert "\n" not in str(error.value)
    # What was missing is played again by the shard's own command, and then they come together.
    loaded = load_spec(swept[0] / "small.toml")
    run_sweep(loaded, tmp_path / "1", alone(loaded), fresh=True, shard=Shard(1, 3))
    assert merge(found, tmp_path / "whole")["rows_sha256"] == swept[1]["rows_sha256"]


def test_other_arithmetic_is_told(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = copied(swept[0], tmp_path)
    resaid(found[1], processor="abacus")  # of the same arithmetic, so that nothing is to be told
    merge(found, tmp_path / "same")
    assert "abacus" not in capsys.readouterr().err
    resaid(found[1], arithmetic="other")
    merge(found, tmp_path / "out")
    assert "numpy comes to other bits: one machine would come to other rows (abacus; " in (
        capsys.readouterr().err
    )


def test_what_was_begun_with_another_arithmetic_is_not_gone_on_with(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    one = copied(swept[0], tmp_path)[1]
    resaid(one, arithmetic="other")
    loaded = load_spec(swept[0] / "small.toml")
    with pytest.raises(UserError, match="where numpy comes to other bits than here"):
        run_sweep(loaded, one, alone(loaded), shard=Shard(1, 3))


def test_missing_shards_are_named_and_nothing_is_written(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, out = str(shards(swept[0])[1]), tmp_path / "out"
    assert run(["sweep", "--merge", one, "--out", str(out)]) == 2
    assert capsys.readouterr().err.endswith("--merge: missing shards 0/3, 2/3\n")
    assert not out.exists()
    assert run(["sweep", "--merge", one]) == 2
    assert "--out FOLDER for the whole" in capsys.readouterr().err
    assert run(["sweep", "--merge", str(swept[0] / "whole"), "--out", str(out)]) == 2
    assert "holds a whole sweep, no shard of one" in capsys.readouterr().err


def test_a_folder_is_of_one_shard(
    swept: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = swept
    spec = str(folder / "small.toml")
    wrong = [("1/3", "0", "shard 0/3"), ("0/2", "0", "shard 0/3"), ("0/3", "whole", "the whole")]
    for shard, out, holds in wrong:
        assert run(["sweep", spec, "--out", str(folder / out), "--shard", shard]) == 2
        assert f"holds {holds} of this sweep; each shard" in capsys.readouterr().err
    with pytest.raises(UserError, match="holds shard 0/3 of this sweep"):
        merge(shards(folder), folder / "0")


@pytest.mark.judge
def test_shards_by_the_command_come_to_the_same(
    swept: tuple[Path, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder, whole = swept
    monkeypatch.chdir(tmp_path)
    spec = str(folder / "small.toml")
    for number in range(2):
        assert run(["sweep", spec, "--workers", "1", "--shard", f"{number}/2"]) == 0
    assert f"sweeps/small-1-of-2, shard 1/2: {whole['rows'] // 2} rows" in capsys.readouterr().out
    found = [f"sweeps/small-{number}-of-2" for number in range(2)]
    assert run(["sweep", "--merge", *found, "--out", "sweeps/small", "--json"]) == 0
    merged = json.loads(capsys.readouterr().out)
    assert (merged["rows_sha256"], merged["jobs"]) == (whole["rows_sha256"], whole["jobs"])
    assert run(["sweep", spec, "--workers", "1", "--shard", "8/9"]) in (0, 3)  # few jobs
    assert run(["sweep", spec, spec]) == 2
    capsys.readouterr()
    for words in ("--shard 0/2", "--workers 3", "--engine ray", "--address auto", "--fresh"):
        assert run(["sweep", "--merge", *found, *words.split()]) == 2
        assert f"{words}: goes with a SPEC, not with --merge" in capsys.readouterr().err
