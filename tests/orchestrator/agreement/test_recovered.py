"""Windows of a run that was killed are judged as its end would have judged them."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.codec import write_message
from foretwin.orchestrator.agreement.known_windows import into_table
from foretwin.orchestrator.agreement.recovered import recovered_agreement
from foretwin.orchestrator.record import recovery
from foretwin.orchestrator.record.recovery import recover
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_folder import keep_vehicles
from foretwin.orchestrator.record.run_streams import RunStreams
from tests.orchestrator.agreement.test_windows import VEHICLE, WORLD, driven
from tests.orchestrator.record.ended_badly import killed_run, round_row
from tests.orchestrator.trip import START_NS

HANDLER = driven()


def killed(folder: Path) -> Path:
    run = killed_run(folder)
    streams = RunStreams(run / "results", TABLES)
    keep = into_table(lambda table, rows: streams.take(table, rows), VEHICLE)
    for one in HANDLER.judged:
        keep(one.window)
    streams.write(sync=True)
    streams.close()
    (run / "results" / "rounds.arrows").unlink()
    streams = RunStreams(run / "results", TABLES)
    streams.take("rounds", [round_row(1) | {"stamp_ns": START_NS + 500_000_000}])
    streams.write(sync=True)
    streams.close()
    keep_vehicles(run, [VEHICLE])
    write_message(WORLD, run / "worlds" / f"{WORLD.id}.world")
    return run


def test_the_record_and_the_table_are_those_of_a_drive_that_ended(tmp_path: Path) -> None:
    run = killed(tmp_path / "run")
    done = recover(run, judge=recovered_agreement)
    assert done.record["agreement"] == HANDLER.record(START_NS)
    assert done.record["agreement"]["windows"] == len(HANDLER.judged) == 14
    rows = pq.read_table(run / "results" / "agreement.parquet").to_pylist()
    assert [row["round_id"] for row in rows] == [one.window.round_id for one in HANDLER.judged]
    assert pq.read_metadata(run / "results" / "windows.parquet").num_rows == 14
    assert "agreement" not in done.record["recovered"]["unknown"]


def test_an_interrupted_recovery_keeps_each_verdict_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(*_: object) -> None:
        raise KeyboardInterrupt

    run = killed(tmp_path / "run")
    with monkeypatch.context() as patched:
        patched.setattr(recovery, "write_record", dies)
        with pytest.raises(KeyboardInterrupt):
            recover(run, judge=recovered_agreement)
    recover(run, judge=recovered_agreement)
    kept = pq.read_table(run / "results" / "agreement.parquet")
    assert kept.num_rows == len(HANDLER.judged)


def test_recovering_from_the_beginning_again_comes_to_the_same(tmp_path: Path) -> None:
    run = killed(tmp_path / "run")
    begun = (run / "run.json").read_bytes()
    streams = {path: path.read_bytes() for path in (run / "results").iterdir()}
    recover(run, judge=recovered_agreement)
    kept = pq.read_table(run / "results" / "agreement.parquet")
    # As if it had been killed after the tables were written and before the streams went.
    (run / "run.json").write_bytes(begun)
    for path, data in streams.items():
        path.write_bytes(data)
    recover(run, judge=recovered_agreement)
    assert pq.read_table(run / "results" / "agreement.parquet").equals(kept)


def test_without_its_world_or_vehicle_nothing_is_judged_and_that_is_said(tmp_path: Path) -> None:
    run = killed(tmp_path / "run")
    (world,) = (run / "worlds").iterdir()
    world.rename(tmp_path / "world")
    assert recovered_agreement(run) is None
    (tmp_path / "world").rename(world)
    for file in (run / "vehicles").iterdir():
        file.write_bytes(b"damaged")
    assert recovered_agreement(run) is None
    done = recover(run, judge=recovered_agreement)
    assert done.record["agreement"] is None
    assert "agreement" in done.record["recovered"]["unknown"]
