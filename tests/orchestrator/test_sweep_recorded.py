"""Sweeps from where a car was: a drive straight over a drawn crossing, as a run leaves it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from contracts.drive import GnssFix, VehicleInfo
from contracts.errors import UserError
from contracts.frames import GeoPoint, geo_from_local, local_from_geo
from orchestrator.sweep_plan import WorldPlaces, plan_sweep
from orchestrator.sweep_play import PlaceQuestion, PlaySetup, SweepWorker
from orchestrator.sweep_spec import Loaded, Recorded, SweepSpec, check_spec, worlds_folder
from telemetry.mcap_file import create
from tests.sim_worker.scenarios.worlds import cross
from world_gen.world_store import WorldStore

SPEED_MPS, START_X_M = 8.0, -70.0
START_NS = 1_000_000_000_000


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a drive to the east, with a round each second."""
    folder, world = tmp_path_factory.mktemp("run"), cross()
    WorldStore(folder / "worlds").save(world)
    info = VehicleInfo(
        vehicle_id="car", time_base="utc", start_stamp_ns=START_NS,
        reference_point="base_link", body_from_antenna_m=(0.0, 0.0, 0.0), sends=("gnss",),
    )  # fmt: skip
    with create(folder / "drive.mcap", info=info) as writer:
        for tenth in range(180):
            xy = np.array([START_X_M + SPEED_MPS * tenth / 10.0, -1.5])
            lat, lon = geo_from_local(world.frame, xy)
            stamp_ns = START_NS + tenth * 100_000_000
            writer.add(
                "gnss", GnssFix(stamp_ns=stamp_ns, position=GeoPoint(float(lat), float(lon)))
            )
    rounds = [
        {
            "round_id": second, "stamp_ns": START_NS + second * 1_000_000_000,
            "drive_time_s": float(second), "intersection_id": world.intersection.id,
            "world_id": world.id, "cruise_speed_mps": SPEED_MPS,
        }
        for second in range(1, 18)
    ]  # fmt: skip
    (folder / "results").mkdir()
    pq.write_table(pa.Table.from_pylist(rounds), folder / "results" / "rounds.parquet")
    return folder


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


def test_scenarios_are_timed_to_the_recorded_car(run: Path) -> None:
    loaded = _loaded(run, every_s=3.0)
    folder = worlds_folder(loaded.spec)
    assert folder == run / "worlds"
    worker = SweepWorker(PlaySetup(loaded=loaded, worlds_dir=str(folder)))
    places = worker.answer(PlaceQuestion(world_id=cross().id))
    assert isinstance(places, WorldPlaces)
    # It goes straight on: a turn across happens to nobody, and once over, nothing happens to it.
    assert {place.scenario_id for place in places.placed} == {"scp"}
    assert [place.start for place in places.placed][:3] == [0, 1, 2]
    assert len(places.placed) < len(loaded.starts)
    plan = plan_sweep(loaded, [places])
    rows = [row for job in plan.jobs for row in worker.answer(job)]  # type: ignore[union-attr]
    assert [row["cell"] for row in rows] == list(range(plan.cells))
    assert not any(row["failure"] for row in rows)
    second = [row for row in rows if row["place"].startswith("round 4:")]
    assert len(second) == 2
    for row in second:
        assert row["start_stamp_ns"] == pytest.approx(START_NS + 4_000_000_000, abs=1e6)
        assert row["left_out"] == ""
        assert row["collided"]
        # It is 38 m from the middle of the crossing, and drives 8 m/s.
        assert 3.0 < row["collision_time_s"] < 5.5


def test_a_folder_of_no_run_is_said(tmp_path: Path, run: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no results/rounds\.parquet in it"):
        _loaded(tmp_path)
    with pytest.raises(UserError, match=r"recorded\.every_s"):
        _loaded(run, every_s=0.0)
