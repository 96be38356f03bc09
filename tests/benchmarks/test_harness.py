"""The harness of the benchmarks, without measuring anything for long."""

from __future__ import annotations

import importlib
import json
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.logs.opening import open_log
from foretwin.telemetry.logs.write_mcap import create
from tests.benchmarks import __main__ as harness
from tests.benchmarks import live_limits, scenes
from tests.benchmarks.live_drive import CpuLook, LiveDrive, read_live_drive, shares_between
from tests.benchmarks.live_limits import Limit, add_crowd, quiet_limits
from tests.benchmarks.measuring import Measurement, UnavailableError


@pytest.mark.parametrize("name", harness.BENCHMARKS)
def test_every_benchmark_is_a_module_whose_imports_are_there(name: str) -> None:
    module = importlib.import_module(f"tests.benchmarks.{name}")

    assert callable(module.measure)


def test_rows_hold_value_unit_baseline_and_ratio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def unavailable() -> Measurement:
        raise UnavailableError("no C compiler")

    monkeypatch.setattr(harness, "OUT", tmp_path / "build" / "bench.json")
    monkeypatch.setattr("tests.benchmarks.help_startup.measure", lambda: Measurement(0.3, "s", 0.1))
    monkeypatch.setattr("tests.benchmarks.world_from_open_map.measure", unavailable)

    code = harness.main(["help_startup", "world_from_open_map"])

    assert code == 1
    assert "not measured: no C compiler" in capsys.readouterr().out
    assert json.loads(harness.OUT.read_text()) == {
        "help_startup": {
            "value": 0.3, "unit": "s", "baseline": 0.1, "ratio": pytest.approx(3.0),
        }
    }  # fmt: skip


def test_rows_of_benchmarks_that_were_not_named_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unavailable() -> Measurement:
        raise UnavailableError("no MetaDrive")

    row = Measurement(5.0, "ms", 1.0).as_row()
    monkeypatch.setattr(harness, "OUT", tmp_path / "bench.json")
    monkeypatch.setattr("tests.benchmarks.help_startup.measure", lambda: Measurement(0.3, "s", 0.1))
    monkeypatch.setattr("tests.benchmarks.metadrive.measure", unavailable)
    earlier = {"help_startup": row, "metadrive": row, "boxes_200": row, "of_old": row}
    harness.OUT.write_text(json.dumps(earlier))

    harness.main(["help_startup", "metadrive"])

    written = json.loads(harness.OUT.read_text())
    assert list(written) == ["boxes_200", "help_startup"]
    assert written["boxes_200"] == row
    assert written["help_startup"]["value"] == 0.3

    harness.OUT.write_text("{half a file")
    harness.main(["help_startup"])
    assert list(json.loads(harness.OUT.read_text())) == ["help_startup"]


def test_an_unknown_name_lists_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert harness.main(["speed"]) == 2
    assert "unknown benchmark speed; known: open_loop_16" in capsys.readouterr().out


def test_the_street_that_futures_are_measured_on_can_be_drawn() -> None:
    world = scenes.street(buildings=4)

    assert len(world.buildings) == 4
    assert scenes.job(world, ()).world_id == world.id


def test_a_live_drive_is_read_from_its_trace_and_its_record(tmp_path: Path) -> None:
    names = {1: "orchestrator", 2: "w0", 3: "w1"}
    events: list[dict[str, object]] = [
        {"ph": "M", "name": "process_name", "pid": pid, "args": {"name": name}}
        for pid, name in names.items()
    ]
    spans = {"start a round": 1, "take a round apart": 1, "job": 1}
    for number in range(4):
        at = {"pid": 1, "name": "round", "id2": {"local": str(number)}}
        began_us = 1e6 * number
        events += [
            {"ph": "b", **at, "ts": began_us, "args": {"id": number}},
            {"ph": "e", **at, "ts": began_us + 2e5},
            *({"ph": "X", "name": n, "pid": p, "ts": began_us, "tdur": 5e3}
              for n, p in spans.items()),
            {"ph": "X", "name": "job", "pid": 2, "ts": began_us + 1e4, "tdur": 9e4},
            {"ph": "X", "name": "job", "pid": 3, "ts": began_us + 1e4, "tdur": 1e5 + number},
        ]  # fmt: skip
    (tmp_path / "trace.json").write_text(json.dumps({"traceEvents": events}))
    (tmp_path / "run.json").write_text(json.dumps({"ledger": {"rounds": {"missed": 2}}}))
    rows = [
        {"round_id": n, "drive_time_s": 9.0 + n, "late": n == 2, "latency_ms": 100.0 + n,
         "futures": 64 - n, "cpu_seconds": 0.19}
        for n in range(4)
    ]  # fmt: skip
    (tmp_path / "results").mkdir()
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "results" / "rounds.parquet")
    looks = [
        look(age_s, machine_s=10.0 + age_s, orchestrator=3.0 + 0.1 * age_s, w0=age_s)
        for age_s in (9.0, 11.0, 13.0)
    ]
    found = read_live_drive(tmp_path, looks)

    assert (found.rounds, found.late, found.missed, found.least_futures) == (3, 1, 2, 61)
    assert found.wall_ms == 102.0
    assert (found.jobs_cpu_ms, found.slowest_job_cpu_ms) == pytest.approx((190.0, 100.0), abs=0.01)
    assert found.orchestrator_cpu_ms == 10.0
    assert found.shares == pytest.approx({"orchestrator": 0.1, "w0": 1.0})

    (tmp_path / "trace.json").unlink()
    untraced = read_live_drive(tmp_path, looks)
    assert (untraced.p95_ms, untraced.jobs_cpu_ms) == (found.p95_ms, found.jobs_cpu_ms)
    assert math.isnan(untraced.slowest_job_cpu_ms)
    assert math.isnan(untraced.orchestrator_cpu_ms)


def look(age_s: float, *, machine_s: float, **cpu_s: float) -> CpuLook:
    lives = {name: (age_s, taken_s) for name, taken_s in cpu_s.items()}
    return CpuLook(100.0 + age_s, lives, machine_s)


def test_shares_count_between_the_beginning_and_the_last_word() -> None:
    looks = [
        CpuLook(100.0, {}, 0.0),
        look(4.0, machine_s=20.0, orchestrator=9.0, w0=1.0),
        look(10.0, machine_s=30.0, orchestrator=10.0, w0=2.0),
        look(20.0, machine_s=38.0, orchestrator=11.0, w0=6.0, late=1.0),
        look(21.0, machine_s=99.0, orchestrator=99.0, w0=99.0),  # what was compared at the end
    ]
    shares, others_cores = shares_between(looks, 10.0, 20.0)
    assert shares == pytest.approx({"orchestrator": 0.1, "w0": 0.4})
    assert others_cores == pytest.approx(0.8 - 0.5)
    with pytest.raises(UnavailableError, match="from 30 s"):
        shares_between(looks, 30.0, 40.0)


def test_each_limit_says_whether_it_holds() -> None:
    assert Limit("p95, ms", 251.0, most=250.0).line() == "BROKEN p95, ms: 251 <= 250"
    assert Limit("futures", 64.0, least=32.0).line() == "holds  futures: 64 >= 32"
    assert Limit("jobs", 1.5).line().strip() == "jobs: 1.5"


def test_a_drive_that_falls_or_is_disturbed_breaks_its_limits() -> None:
    kept = LiveDrive(
        rounds=100, wall_ms=150.0, jobs_cpu_ms=200.0, slowest_job_cpu_ms=110.0,
        orchestrator_cpu_ms=9.0, p95_ms=200.0, late=0, missed=1, least_futures=64,
        shares={"orchestrator": 0.07, "w0": 0.4}, others_cores=0.05,
    )  # fmt: skip
    assert all(limit.holds for limit in quiet_limits(kept))
    for name, value in {
        "missed": 2, "least_futures": 48, "p95_ms": 251.0, "others_cores": 0.2,
        "shares": {"orchestrator": 0.081}, "rounds": 10,
    }.items():  # fmt: skip
        broken = [one for one in quiet_limits(kept._replace(**{name: value})) if not one.holds]
        assert len(broken) == 1, name


def test_a_crowd_is_added_around_the_car(tmp_path: Path) -> None:
    log, crowded = tmp_path / "log.mcap", tmp_path / "crowded.mcap"
    with create(log) as written:
        written.set_info(VehicleInfo(vehicle_id="ego", time_base="utc", start_stamp_ns=10**18))
        written.add("gnss", GnssFix(stamp_ns=10**18, position=GeoPoint(52.5, 13.4)))
    add_crowd(log, crowded, 500)
    (said,) = [one for channel, one in open_log(crowded).samples() if channel == "objects"]
    here = LocalFrame(GeoPoint(52.5, 13.4))
    places = [local_from_geo(here, u.position.lat_deg, u.position.lon_deg) for u in said.users]
    away_m = np.hypot(*np.array(places).T)
    assert len(away_m) == 500
    assert 95.0 < away_m.max() < 105.0


def test_a_drive_that_is_not_known_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert live_limits.main(["autobahn"]) == 2
    assert "known: town, berlin, loaded, crowd" in capsys.readouterr().out
