"""What a run or sweep left, in a notebook: tables, Worlds, and motion as arrays."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt

import foretwin
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.lake.made_runs import made_run
from tests.orchestrator.recorded_runs import write_run
from tests.orchestrator.sweeps import alone, small_sweep
from tests.sim_worker.scenarios.worlds import cross

COVERS = ("foretwin.plots",)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> foretwin.Recording:
    folder = tmp_path_factory.mktemp("swept")
    loaded = load_spec(small_sweep(folder))
    run_sweep(loaded, folder / "out", alone(loaded))
    return foretwin.open_sweep(folder / "out")


@pytest.fixture(autouse=True)
def no_display() -> Iterator[None]:
    with mpl.rc_context({"backend": "agg"}):
        yield
    plt.close("all")


def played(sweep: foretwin.Recording) -> dict[str, object]:
    rows = sweep.table("futures").to_pylist()
    return next(row for row in rows if row["valid"] and row["trajectory_sha256"])


def test_tables_and_worlds_are_named(sweep: foretwin.Recording) -> None:
    assert set(sweep.tables) >= {"futures", "jobs", "metrics"}
    with pytest.raises(foretwin.UserError) as said:
        sweep.table("futurs")
    told = str(said.value)
    assert f"no table of futurs: did you mean futures? one of {sweep.tables[0]}, " in told
    assert told.count(str(sweep.folder)) == 1
    assert sweep.world(sweep.world_ids[0]).id == sweep.world_ids[0]
    with pytest.raises(foretwin.UserError, match=f"no World 'x' to be read: {sweep.world_ids[0]}"):
        sweep.world("x")


def test_a_future_is_played_again_as_arrays(sweep: foretwin.Recording) -> None:
    row = played(sweep)

    futures = sweep.futures_of(str(row["future_id"]))

    again = next(one for one in futures.rows if one["index"] == row["index"])
    assert again["trajectory_sha256"] == row["trajectory_sha256"]
    place = futures.result.future_indices.index(row["index"])
    assert futures.states[place].shape == (len(futures.time_s), 8)
    with pytest.raises(foretwin.UserError, match="future_id must be a str, not int"):
        sweep.futures_of(5)  # type: ignore[arg-type]
    with pytest.raises(foretwin.UserError, match="no future_id 'nobody'"):
        sweep.futures_of("nobody")


def test_each_row_is_of_the_motion_at_its_place(tmp_path: Path) -> None:
    # One of the cases there is that the car is not met by the point of its front that is meant.
    text = 'worlds = "{worlds}"\njunctions = ["n44"]\nscenarios = ["scp"]\n'
    spec = small_sweep(tmp_path, text)
    WorldStore(tmp_path / "drawn").save(foretwin.drawn_town().world("n44"))
    loaded = load_spec(spec)
    run_sweep(loaded, tmp_path / "out", alone(loaded))
    sweep = foretwin.open_sweep(tmp_path / "out")
    rows = sweep.table("futures").to_pylist()
    without_place = {row["job_sha256"] for row in rows if row["left_out"]}
    row = next(row for row in rows if row["valid"] and row["job_sha256"] in without_place)

    futures = sweep.futures_of(row["future_id"])

    for states, one in zip(futures.states, futures.rows, strict=True):
        assert states[-1, 0] == pytest.approx(one["end_x_m"])


def test_libraries_that_are_not_there_are_named(
    sweep: foretwin.Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in ("pandas", "polars"):
        monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(foretwin.UserError, match="pip install polars"):
        sweep.polars("futures")
    with pytest.raises(foretwin.UserError, match="pip install pandas"):
        sweep.pandas("futures")


def test_where_the_car_drove_is_arrays(tmp_path: Path) -> None:
    lat_lon = np.array([[52.5, 13.4 + 1e-5 * step] for step in range(40)])
    stamps = [10**18 + step * 100_000_000 for step in range(40)]
    folder = write_run(
        tmp_path / "run", cross(), stamps_ns=stamps, lat_lon_deg=lat_lon, rounds_s=(), speed_mps=6.8
    )
    (folder / "run.json").write_text('{"exit": "completed"}')

    way = foretwin.open_run(folder).driven()

    assert way.time_s[0] == 0.0
    assert len(way.lat_deg) == len(way.yaw_rad) == len(way.stamp_ns)
    assert np.median(way.speed_mps[10:]) == pytest.approx(6.8, abs=0.3)
    assert way.lon_deg[-1] == pytest.approx(lat_lon[-1, 1], abs=2e-6)


def test_a_sweep_has_no_car(sweep: foretwin.Recording) -> None:
    with pytest.raises(foretwin.UserError, match=r"holds no drive.mcap"):
        sweep.driven()


def test_futures_are_drawn_over_their_world_by_their_clearance(sweep: foretwin.Recording) -> None:
    row = played(sweep)
    world = sweep.world(str(row["world_id"]))
    futures = sweep.futures_of(str(row["future_id"]))

    axes = foretwin.plot_futures(futures, world)

    (lines,) = [one for one in axes.collections if one.get_zorder() == 60]
    clearance = {one["index"]: one["min_clearance_m"] for one in futures.rows}
    drawn = [clearance.get(index) for index in futures.result.future_indices]
    assert lines.get_array().tolist() == [5.0 if one is None else one for one in drawn]
    assert world.attribution in {text.get_text() for text in axes.texts}
    assert foretwin.plot_futures(futures).get_aspect() == 1.0


def test_outcomes_are_bars_of_shares(sweep: foretwin.Recording) -> None:
    axes = foretwin.plot_outcomes(sweep)

    rows = [row for row in sweep.table("futures").to_pylist() if row["valid"]]
    bars = {
        (label.get_text(), container.get_label()): bar.get_width()
        for container in axes.containers
        for label, bar in zip(axes.get_yticklabels(), container, strict=True)
    }
    for (scenario, planner), share in bars.items():
        of = [r["collided"] for r in rows if (r["scenario"], r["planner"]) == (scenario, planner)]
        assert share == pytest.approx(np.mean(of) if of else 0.0)


def test_a_gap_is_drawn_by_horizon_and_its_lack_is_told(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    run = made_run(tmp_path)
    with pytest.raises(foretwin.UserError, match="no gap was measured"):
        foretwin.plot_gap(foretwin.open_run(run))
    gaps = {
        "horizon_s": [1.0, 1.0, 2.0, 1.0],
        "along_m": [3.0, 4.0, -2.0, 90.0],
        "across_m": [0.0, 0.0, 1.0, 90.0],
        "independent": [True, True, True, False],
    }
    pq.write_table(pa.table(gaps), run / "results" / "gaps.parquet")

    along, across = foretwin.plot_gap(foretwin.open_run(run)).lines

    assert along.get_ydata() == pytest.approx([12.5**0.5, 2.0]), "by estimates alone: left out"
    assert across.get_ydata() == pytest.approx([0.0, 1.0])

    gaps["independent"] = [False] * 4
    pq.write_table(pa.table(gaps), run / "results" / "gaps.parquet")
    of_all, _ = foretwin.plot_gap(foretwin.open_run(run)).lines
    assert of_all.get_ydata()[0] == pytest.approx(np.sqrt(np.mean([9.0, 16.0, 8100.0])))
