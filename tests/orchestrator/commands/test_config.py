"""`foretwin config`: every kind of file has a sound example, a schema, and words for its keys."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.field_words import fields_of, tables_of
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.config import keys_of, text_of
from foretwin.orchestrator.commands.config_formats import HIDDEN, KINDS, RANGES, kind_of
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.sim_worker.scenarios.reading import CATALOGUE

COVERS = (
    "foretwin.orchestrator.commands.cli_config",
    "foretwin.orchestrator.commands.config_formats",
    "foretwin.orchestrator.commands.config_schema",
)
ROOT = Path(__file__).parents[3]
EVERY = sorted(KINDS)


def said(words: list[str], capsys: pytest.CaptureFixture[str], *, code: int = 0) -> str:
    assert run(["config", *words]) == code
    told = capsys.readouterr()
    return told.out if code == 0 else told.err


@pytest.mark.parametrize("kind", EVERY)
def test_an_example_can_be_used_as_it_is(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "example.toml"
    file.write_text(said(["--example", "--kind", kind], capsys), encoding="utf-8")
    assert said(["--check", str(file)], capsys).startswith(f"{file}: sound; {kind}: ")
    told = json.loads(said(["--check", str(file), "--json"], capsys))
    assert told == {"file": str(file), "kind": kind, "sound": True}


@pytest.mark.parametrize("kind", ["drive", "sweep", "overpass"])
def test_each_key_of_a_made_example_holds_where_it_is_switched_on(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example = said(["--example", "--kind", kind], capsys)
    active = "".join(f"{line}\n" for line in example.splitlines() if line and line[0] != "#")
    defaults = [
        line.removeprefix("# ")
        for line in example.split("\n# [")[0].splitlines()
        if line.startswith("# ") and " = " in line and "…" not in line and line[2:3].islower()
    ]
    assert len(defaults) >= 5
    for line in defaults:
        tomllib.loads(active + line)
        text = (
            active.replace("[overpass]", f"[overpass]\n{line}")
            if kind == "overpass"
            else (line + "\n" + active)
        )
        file = tmp_path / "example.toml"
        file.write_text(text, encoding="utf-8")
        KINDS[kind].read(file)


@pytest.mark.parametrize("kind", EVERY)
def test_every_key_is_in_the_schema_with_its_words_and_its_range(
    kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    schema = json.loads(said(["--schema", "--kind", kind], capsys))
    for struct in tables_of(KINDS[kind].type):
        properties = schema["$defs"][struct.__name__]["properties"]
        assert set(properties) == {
            field.name for field in fields_of(struct) if (struct, field.name) not in HIDDEN
        }
        for field in fields_of(struct):
            if (struct, field.name) not in HIDDEN:
                told = json.dumps(properties[field.name])
                assert not field.text or properties[field.name]["description"] == field.text
                if (struct, field.name) in RANGES:
                    assert f'inimum": {json.dumps(RANGES[struct, field.name].low)}' in told


def test_a_speed_may_be_max_and_no_file_holds_the_switch_towards_the_vehicle(
    capsys: pytest.CaptureFixture[str],
) -> None:
    properties = json.loads(said(["--schema"], capsys))["$defs"]["DriveConfig"]["properties"]
    assert {"const": "max"} in properties["speed"]["anyOf"]
    assert "towards_vehicle" not in properties
    assert "towards_vehicle" not in said(["--example"], capsys)


@pytest.mark.parametrize("kind", EVERY)
def test_every_key_has_words(kind: str) -> None:
    assert [key.place for key in keys_of(kind) if not text_of(key)] == []


def test_a_key_is_explained_wherever_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    told = said(["--explain", "horizon_s"], capsys)
    assert "drive: horizon_s (number, 1 to 60, default 8.0, --horizon)\n" in told
    assert "scenario: horizon_s" in told
    one = said(["--explain", "follow.accel_mps2", "--kind", "drive"], capsys)
    assert one.startswith("drive: follow.accel_mps2 (number, default 1.0)\n  Along and across")
    listed = json.loads(said(["--explain", "mass_kg", "--json"], capsys))
    assert listed[0]["is"] == "table Parameter, 150 to 60000, needed"


def test_ranges_are_those_that_hold() -> None:
    for (struct, name), allowed in RANGES.items():
        if struct is DriveConfig and name not in ("speed", "start_s"):
            beyond = msgspec.structs.replace(DriveConfig(), **{name: type(allowed.low)(-1)})
            with pytest.raises(ValueError, match=f": {allowed}".replace("-", "\\-")):
                beyond.validate()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "config: one of --example, --schema, --explain, --check; got none"),
        (["--example", "--schema"], "got --example and --schema"),
        (["--example", "--kind", "sweeps"], "--kind sweeps: did you mean sweep? one of drive, "),
        (["--explain", "horizn_s"], "no file has this key; did you mean horizon_s? "),
        (["--explain", "mass_kg", "--kind", "drive"], "no file of kind drive has this key; "),
        (["--check", "nowhere.toml"], "file nowhere.toml: no such file"),
        (["--check", str(MAP_FILE)], "line 1: not TOML: "),
    ],
)
def test_what_cannot_be_meant_is_told_in_one_line(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    told = said(words, capsys, code=2)
    assert line in told
    assert told.count("\n") == 1


def test_a_wrong_file_is_told_by_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "drive.toml"
    file.write_text("futures = 8\nhorizon_s = 90\n", encoding="utf-8")
    told = said(["--check", str(file)], capsys, code=2)
    assert told == f"foretwin: {file}: line 2: horizon_s 90.0: 1 to 60\n"
    file.write_text("x = 8\n", encoding="utf-8")
    assert "no kind of file has such keys; --kind" in said(["--check", str(file)], capsys, code=2)


@pytest.mark.parametrize(
    ("file", "kind"),
    [
        ("examples/tuning/first_drive.toml", "drive"),
        ("examples/tuning/other_car.toml", "standin"),
        ("examples/remote_planner.toml", "sweep"),
        ("sim_worker/vehicle/city_bus.toml", "vehicle"),
        ("tests/data/declarations/boreas.csv.toml", "declaration"),
        ("telemetry/ros2/autoware.toml", "ros2"),
    ],
)
def test_the_kind_of_a_file_is_seen(file: str, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    assert kind_of(Path(file)) == kind


def test_every_scenario_that_comes_along_is_seen_as_one() -> None:
    assert {kind_of(file) for file in CATALOGUE.glob("*.toml")} == {"scenario"}


def test_the_help_names_every_kind(capsys: pytest.CaptureFixture[str]) -> None:
    words = re.findall(r"\w+", said(["--help"], capsys))
    assert set(EVERY) - set(words) == set()
