"""The harness of the benchmarks, without measuring anything for long."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.benchmarks import __main__ as harness
from tests.benchmarks import scenes
from tests.benchmarks.live_drive import read_live_drive
from tests.benchmarks.measuring import Measurement, UnavailableError


def test_every_benchmark_is_a_module() -> None:
    specs = [importlib.util.find_spec(f"tests.benchmarks.{name}") for name in harness.BENCHMARKS]

    assert None not in specs


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
    processor = {"w0": {"share_of_core": 0.2}, "builder": {"share_of_core": None}}
    ledger = {"rounds": {"missed": 2}}
    (tmp_path / "run.json").write_text(json.dumps({"processor": processor, "ledger": ledger}))
    rows = [
        {"round_id": n, "drive_time_s": 9.0 + n, "late": n == 2, "latency_ms": 100.0 + n,
         "futures": 64 - n}
        for n in range(4)
    ]  # fmt: skip
    (tmp_path / "results").mkdir()
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "results" / "rounds.parquet")
    found = read_live_drive(tmp_path)

    assert (found.rounds, found.late, found.missed, found.least_futures) == (3, 1, 2, 61)
    assert found.wall_ms == 102.0
    assert (found.jobs_cpu_ms, found.slowest_job_cpu_ms) == pytest.approx((190.0, 100.0), abs=0.01)
    assert found.orchestrator_cpu_ms == 10.0
    assert found.shares == {"w0": 0.2, "builder": 0.0}
