"""The harness of the benchmarks, without measuring anything for long."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from tests.benchmarks import __main__ as harness
from tests.benchmarks import scenes
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
