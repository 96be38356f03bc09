from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.lake.collect import collect
from foretwin.orchestrator.lake.store import FolderStore
from foretwin.orchestrator.sweep.spec import load_spec
from tests.orchestrator.lake.made_runs import lake_table, made_sweep, rows_by_run
from tests.orchestrator.sweeps import alone, small_sweep


def test_a_sweep_is_the_same_however_its_parts_are_cut(tmp_path: Path) -> None:
    lake, sweep = tmp_path / "lake", made_sweep(tmp_path / "sweep")
    collect(FolderStore(lake), [sweep])
    (sweep / "rows" / "job-000009.parquet").write_bytes(
        (sweep / "rows" / "job-000000.parquet").read_bytes()
    )

    done = collect(FolderStore(lake), [sweep])

    assert done.there == ["sweep-0cdb5ed7a3db79d9"]
    rows = lake_table(lake, "futures").to_pylist()
    assert [(row["run_vehicle"], row["run_map"]) for row in rows] == 6 * [("none", "none")]


def test_a_sweep_as_it_is_played_is_collected_with_every_row(tmp_path: Path) -> None:
    loaded, out, lake = load_spec(small_sweep(tmp_path)), tmp_path / "out", tmp_path / "lake"
    summary = run_sweep(loaded, out, alone(loaded))

    done = collect(FolderStore(lake), [out])

    (run_id,) = done.added
    assert rows_by_run(lake, "futures") == {run_id: summary["rows"]}
    assert rows_by_run(lake, "jobs") == {run_id: summary["jobs"]}
    cells = lake_table(lake, "futures")["cell"].to_pylist()
    assert sorted(cells) == list(range(summary["rows"]))
    run_sweep(loaded, out, alone(loaded))  # which plays nothing, and says so in its summary
    assert collect(FolderStore(lake), [out]).there == [run_id]
