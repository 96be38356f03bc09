"""What a sweep's file may say, and what is said of one that is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.sweep.spec import DEFAULT_METRICS, load_spec
from foretwin.sim_worker.metrics.table import METRICS
from foretwin.sim_worker.scenarios.reading import catalogue


def _written(folder: Path, text: str) -> Path:
    spec = folder / "sweep.toml"
    spec.write_text(text)
    return spec


def test_little_need_be_said(tmp_path: Path) -> None:
    loaded = load_spec(_written(tmp_path, 'map = "town.osm"\n'))
    assert [scenario.id for scenario in loaded.scenarios] == list(catalogue())
    assert list(loaded.vehicles) == ["bmw_320i"]
    assert loaded.spec.metrics == DEFAULT_METRICS
    assert all(name in METRICS for name in DEFAULT_METRICS)


def test_samples_draw_more_cases(tmp_path: Path) -> None:
    loaded = load_spec(_written(tmp_path, 'map = "a.osm"\nscenarios = ["scp"]\nsamples = 9\n'))
    assert loaded.scenarios[0].samples == 9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('maps = "a.osm"', "line 1: unknown key 'maps'; did you mean map? one of map"),
        ("", "exactly one of map, worlds and recorded; got none"),
        ('map = "a"\nworlds = "b"', "got map and worlds"),
        ('worlds = "b"\nradius_m = 150.0', "radius_m 150.0: goes with a map alone"),
        ('worlds = "b"\nservice_roads = true', "service_roads True: goes with a map alone"),
        (
            'recorded = { run = "r", road_users = "none", leave_out = ["7"] }',
            "recorded.leave_out: ",
        ),
        (
            'recorded = { run = "r", road_users = "none", road_user_log = "log" }',
            'recorded.road_user_log: nobody is there by road_users = "none"',
        ),
        ('map = "a"\nsample = 0', "sample 0: at least 1"),
        ('map = "a"\nbbox = "1,2,3"', "four numbers"),
        ('map = "a"\njunctions = ["x1"]', "named n and a number"),
        ('map = "a"\njunctions = []', "at least one id"),
        ('map = "a"\nscenarios = ["nobody"]', "no scenario 'nobody'"),
        ('map = "a"\nscenarios = ["scp", "scp"]', "scp is named twice"),
        ('map = "a"\nscenarios = []', "at least one id or file"),
        ('map = "a"\ncases = "some"', "cases"),
        ('map = "a"\ncases = 0', "cases 0: at least 1"),
        ('map = "a"\nplanners = ["nobody"]', "unknown planner 'nobody'"),
        (
            'map = "a"\nplanners = ["constant_speed", "remote"]',
            "planners: remote asks a stack that somebody has started beside a drive; a sweep",
        ),
        (
            'map = "a"\nplanners = ["as_planned"]',
            "planner as_planned drives the plan that the car of",
        ),
        ('map = "a"\nphysics = "carla"', "physics: engine 'carla' needs CARLA's Python package"),
        ('map = "a"\nvehicles = ["tank"]', "no vehicle file tank"),
        ('map = "a"\nmetrics = ["ade"]', "compares with a reference"),
        ('map = "a"\nmetrics = ["ttc_series"]', "is a series"),
        ('map = "a"\nmetrics = ["beauty"]', "unknown 'beauty'; one of ttc"),
        ('map = "a"\nhorizon_s = 0.35', "1 to 60 seconds"),
        ('map = "a"\nhorizon_s = nan', "1 to 60 seconds"),
        ('map = "a"\ncontrol_hz = 3.0', "control_hz 3"),
        ('map = "a"\ncontrol_hz = 0.0', "control_hz 0"),
        ('map = "a"\n[parameters]\nmood = [1.0]', "unknown 'mood'; one of target_speed_factor"),
        ('map = "a"\n[parameters]\nfriction_factor = []', "at least one value"),
        ('map = "a"\n[parameters]\nfriction_factor = [0.0]', "must be above 0"),
        (
            'map = "a"\n[parameters]\nextra_steering_delay_s = [0.9]',
            "reaches 0.9; it must be from 0 to 0.4",
        ),
        ('map = "a"\n[parameters]\nlateral_shift_m = [inf]', "must be finite"),
        ('map = "a"\n[parameters]\nperception_delay_s = [1e300]', "it must be from 0 to 10"),
        ('map = "a"\n[parameters]\nsteering_gain = [1e308]', "it must be from -10 to 10"),
        ('map = "a"\n[parameters]\nlateral_shift_m = [1e5]', "it must be from -50 to 50"),
        ('map = "a"\nseed = 99999999999999999999', "seed 99999999999999999999: 0 to 9223"),
        ('map = "a"\nseed = -1', "seed -1: 0 to 9223"),
        ("map = ", "not TOML"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    tmp_path: Path, text: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = _written(tmp_path, text)
    assert run(["sweep", str(spec), "--out", str(tmp_path / "out")]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert said in line
    assert str(spec) in line
    assert not (tmp_path / "out").exists()


def test_a_map_that_is_not_there_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = _written(tmp_path, f'map = "{tmp_path / "no.osm"}"')
    assert run(["sweep", str(spec), "--out", str(tmp_path / "out")]) == 2
    assert "no such file" in capsys.readouterr().err
    with pytest.raises(FileNotFoundError, match="no such file"):
        load_spec(tmp_path / "none.toml")


def test_a_folder_of_something_else_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "town.osm").write_text("")
    spec = _written(tmp_path, f'map = "{tmp_path / "town.osm"}"')
    assert run(["sweep", str(spec), "--out", str(tmp_path), "--fresh"]) == 2
    assert "holds other files and no sweep" in capsys.readouterr().err
    assert (tmp_path / "town.osm").exists()


def test_no_workers_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = _written(tmp_path, 'map = "a.osm"')
    assert run(["sweep", str(spec), "--workers", "0"]) == 2
    assert "--workers 0: 1 to " in capsys.readouterr().err


def test_an_error_of_a_scenario_file_names_it(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("id = 3\n")
    with pytest.raises(UserError, match=r"bad\.toml"):
        load_spec(_written(tmp_path, f'map = "a.osm"\nscenarios = ["{bad}"]\n'))
