"""A drive that finds its vehicle's parameters, uses them, and has a smaller gap from then on."""

from __future__ import annotations

import json
import math
from typing import Any

import msgspec
import pytest

from foretwin.contracts.vehicle import Parameter
from foretwin.sim_worker.analysis.identify.acceptance import vehicle_toml
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.system.foretwin_command import Finished, foretwin, log_lines

HIDDEN_RATIO = 15.3
"""The stand-in car's, which the twin does not know."""


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Finished]:
    """The same drive with a wrong vehicle file: what is found is used, and only told."""
    folder = tmp_path_factory.mktemp("tuning")
    wrong = Parameter(18.0, 1.0, "wrong on purpose")
    car = folder / "car.toml"
    vehicle = msgspec.structs.replace(load_vehicle(), steering_ratio=wrong)
    car.write_text(vehicle_toml(vehicle), encoding="utf-8")
    found = {}
    for mode in ("apply", "report"):
        found[mode] = foretwin(
            folder / mode, "--speed", "max", "--futures", "8", "--rate", "0.25", "--workers", "1",
            "--end", "68", "--vehicle", str(car), "--tuning", mode, timeout_s=900.0,
        )  # fmt: skip
        assert found[mode].code == 0, found[mode].screen
    return found


def across_rms_m(run: Finished, *, from_ns: int) -> float:
    """What the model loses across in 2 s of its own, in runs that begin after a stamp."""
    gaps = [
        row["across_m"]
        for row in run.rows("gaps")
        if row["horizon_s"] == 2.0 and row["stamp_ns"] - 2_000_000_000 > from_ns
    ]
    assert len(gaps) >= 15
    return math.sqrt(sum(gap * gap for gap in gaps) / len(gaps))


@pytest.mark.judge
def test_a_wrong_steering_ratio_is_found_and_used_and_the_gap_falls(
    drives: dict[str, Finished],
) -> None:
    applied, told = drives["apply"], drives["report"]
    changes = [row for row in applied.rows("parameters") if row["name"] == "steering_ratio"]
    assert changes[0]["before"] == 18.0
    assert changes[-1]["value"] == pytest.approx(HIDDEN_RATIO, rel=0.02)
    at_ns = changes[0]["stamp_ns"]
    with_it, without = (across_rms_m(run, from_ns=at_ns) for run in (applied, told))
    print(
        f"across after 2 s: {without:.3f} m with the file's ratio, {with_it:.3f} m with the found"
    )
    assert with_it < 0.3 * without


@pytest.mark.judge
def test_rounds_name_the_parameters_that_simulated_them(drives: dict[str, Finished]) -> None:
    rows = drives["apply"].rows("parameters")
    since = {row["version"]: row["stamp_ns"] for row in reversed(rows)}
    for row in drives["apply"].rows("rounds"):
        valid = [version for version, stamp_ns in since.items() if stamp_ns <= row["stamp_ns"] + 1]
        assert row["vehicle_version"] == max(valid, default=0)
    assert {row["vehicle_version"] for row in drives["report"].rows("rounds")} == {0}


@pytest.mark.judge
def test_the_run_tells_what_was_found_and_what_counts(drives: dict[str, Finished]) -> None:
    for mode, run in drives.items():
        tuning: dict[str, Any] = run.record()["tuning"]
        assert tuning["mode"] == mode
        ratio = next(one for one in tuning["parameters"] if one["name"] == "steering_ratio")
        assert ratio["identified"] == pytest.approx(HIDDEN_RATIO, rel=0.02)
        assert (ratio["in_use"] == 18.0) == (mode == "report")
        assert run.run is not None
        words = json.dumps([line["text"] for line in log_lines(run.run)], ensure_ascii=False)
        assert "steering_ratio" in words
        assert "steering_ratio" in run.screen
    assert drives["report"].rows("parameters") == []
