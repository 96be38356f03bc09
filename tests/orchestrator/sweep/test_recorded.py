"""Sweeps from where a car was: a drive straight over a drawn crossing, as a run leaves it."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.orchestrator.record.table_parts import put_away_name
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.recorded import Recorded
from foretwin.orchestrator.sweep.spec import Loaded, SweepSpec, check_spec, worlds_folder
from tests.orchestrator.recorded_runs import write_run
from tests.orchestrator.sweeps import alone, places_of, rows_of
from tests.sim_worker.scenarios.worlds import cross

SPEED_MPS, START_X_M = 8.0, -70.0
START_NS = 1_000_000_000_000


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a drive to the east, with a round each second."""
    world, tenths = cross(), np.arange(180)
    xy = np.column_stack([START_X_M + SPEED_MPS * tenths / 10.0, np.full(180, -1.5)])
    return write_run(
        tmp_path_factory.mktemp("run"), world, rounds_s=range(1, 18), speed_mps=SPEED_MPS,
        stamps_ns=(START_NS + tenths * 100_000_000).tolist(),
        lat_lon_deg=geo_from_local(world.frame, xy),
    )  # fmt: skip


def _loaded(run: Path, *, every_s: float = 2.0) -> Loaded:
    return check_spec(
        SweepSpec(
            recorded=Recorded(run=str(run), every_s=every_s), scenarios=("scp", "ccftap"), cases=2,
            planners=("constant_speed",), metrics=("ttc",), horizon_s=6.0,
        )
    )  # fmt: skip


def test_starts_are_where_the_car_was_and_lead_where_it_went(run: Path) -> None:
    starts = _loaded(run).starts
    assert [start.round_id for start in starts] == [1, 3, 5, 7, 9, 11, 13, 15]
    frame = cross().frame
    for start in starts:
        here = local_from_geo(frame, start.state.position.lat_deg, start.state.position.lon_deg)
        assert here == pytest.approx([START_X_M + SPEED_MPS * start.round_id, -1.5], abs=0.05)
        assert start.state.speed_mps == pytest.approx(SPEED_MPS, abs=0.2)
        line = start.path(frame).xy_m
        assert line[:, 1] == pytest.approx(np.full(len(line), -1.5), abs=0.05)
        assert line[-1, 0] == pytest.approx(START_X_M + SPEED_MPS * 17.9, abs=1.0)


def test_rounds_that_were_put_away_are_started_from_too(run: Path, tmp_path: Path) -> None:
    parted = Path(shutil.copytree(run, tmp_path / "run"))
    whole = parted / "results" / "rounds.parquet"
    rounds = pq.read_table(whole)
    pq.write_table(rounds.slice(0, 10), put_away_name(whole, 1))
    pq.write_table(rounds.slice(10), whole)
    assert _loaded(parted).starts == _loaded(run).starts
    whole.unlink()  # as a recorder that had just begun a part leaves it
    assert [start.round_id for start in _loaded(parted).starts] == [1, 3, 5, 7, 9]


def test_scenarios_are_timed_to_the_recorded_car(run: Path) -> None:
    loaded = _loaded(run, every_s=3.0)
    folder = worlds_folder(loaded.spec)
    assert folder == run / "worlds"
    runner = alone(loaded)
    places = places_of(runner, loaded, cross().id)
    # It goes straight on: a turn across happens to nobody, and once over, nothing happens to it.
    assert {place.scenario_id for place in places.placed} == {"scp"}
    assert [place.start for place in places.placed][:3] == [0, 1, 2]
    assert len(places.placed) < len(loaded.starts)
    plan = SweepPlan(loaded, [places])
    rows = rows_of(runner, plan, loaded)
    assert [row["cell"] for row in rows] == list(range(plan.cells))
    assert not any(row["failure"] for row in rows)
    second = [row for row in rows if row["place"].startswith("round 4:")]
    assert len(second) == 2
    for row in second:
        assert row["stamp_ns"] == pytest.approx(START_NS + 4_000_000_000, abs=1e6)
        assert row["left_out"] == ""
        assert row["collided"]
        # It is 38 m from the middle of the crossing, and drives 8 m/s.
        assert 3.0 < row["collision_time_s"] < 5.5


def test_a_folder_of_no_run_is_said(tmp_path: Path, run: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no results/rounds\.parquet in it"):
        _loaded(tmp_path)
    with pytest.raises(UserError, match=r"recorded\.every_s"):
        _loaded(run, every_s=0.0)
