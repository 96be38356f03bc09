"""Scenario files: the catalogue is sound, and every mistake is told in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.scenario import Scenario
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import (
    CATALOGUE,
    catalogue,
    find_scenario,
    numbers,
    read_scenario,
)

IDS = {
    "ccftap", "cccscp", "cpta", "cbta", "scp", "ltap_od", "ltip", "rtip", "roundabout_entry",
    "roundabout_exit", "red_light", "occluded_pedestrian", "lead_stopping", "emergency_vehicle",
    "low_friction", "steering_fault", "brake_fault", "latency", "gnss_offset", "lost_detections",
    "reversing_parking", "overtaking_motorway", "race_track_lap",
}  # fmt: skip
GOOD = """
id = "mine"
title = "Mine"
shows = "Somebody comes."
source = "me"

[ego]
speed_mps = { min = 5.0, max = 9.0 }

[[actors]]
name = "other"
relation = "oncoming"
speed_mps = { values = [8.0, 12.0] }
"""


def read(text: str, folder: Path) -> Scenario:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return read_scenario(path)


def test_the_catalogue_holds_what_the_field_tests() -> None:
    found = catalogue()
    assert set(found) == IDS
    assert all(CATALOGUE.joinpath(f"{id_}.toml").is_file() for id_ in found)
    assert len({scenario.title for scenario in found.values()}) == len(IDS)
    assert all(scenario.source and scenario.shows.endswith(".") for scenario in found.values())


def test_what_meets_at_a_crossing_meets_at_a_mini_roundabout_too_but_for_lights() -> None:
    kinds = {id_: scenario.where.kinds for id_, scenario in catalogue().items()}
    crossing = {id_ for id_, admitted in kinds.items() if "crossing" in admitted}
    assert {id_ for id_ in crossing if "mini_roundabout" not in kinds[id_]} == {"red_light"}


def test_ccftap_has_the_protocols_nine_pairs_of_speeds() -> None:
    by_name = {number.name: number.value for number in numbers(catalogue()["ccftap"])}
    for name, kmh in (("ego", (10, 15, 20)), ("oncoming_car", (30, 45, 60))):
        speeds = by_name[f"{name}.speed_mps"].values  # type: ignore[union-attr]
        assert [round(speed * 3.6) for speed in speeds] == list(kmh)


def test_a_file_is_found_by_id_or_by_path(tmp_path: Path) -> None:
    assert find_scenario("scp").id == "scp"
    read(GOOD, tmp_path)
    assert find_scenario(str(tmp_path / "mine.toml")).id == "mine"
    with pytest.raises(UserError, match=r"no scenario 'spc'; did you mean scp.*one of .*scp"):
        find_scenario("spc")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('id = "mine"', 'id = "My Own"', "id 'My Own' must be lower-case"),
        ('source = "me"', 'source = " "', "source is empty; it must say who defined it"),
        ('source = "me"', "", "the key 'source' is missing"),
        ("[ego]", "[ego]\nspeed = 3.0", "line 8: unknown key 'speed' in ego; did you mean speed"),
        ("[ego]", "[egos]", "line 7: unknown key 'egos'; did you mean ego"),
        ("[ego]", '[ego]\nturn = "left"', "ego.turn 'left': one of across, near, straight"),
        ('"oncoming"', '"in_front"', r"actors\[0\].relation 'in_front': one of ahead, behind"),
        ('"oncoming"', '"oncoming"\nkind = "boat"', r"actors\[0\].kind 'boat': one of .*car, "),
        ("min = 5.0, max = 9.0", "min = 9.0, max = 5.0", "ego.speed_mps runs from min 9 to max 5"),
        ("min = 5.0, max = 9.0", "min = 5.0", "ego.speed_mps needs both min and max"),
        ("min = 5.0, max = 9.0", "", "ego.speed_mps is empty; give values"),
        ("min = 5.0, max = 9.0", "mean = 5.0", "ego.speed_mps needs both mean and a std"),
        ("min = 5.0, max = 9.0", "mean = 5.0, std = 0.0", "needs both mean and a std above 0"),
        ("min = 5.0, max = 9.0", "min = -5.0, max = 9.0", "ego.speed_mps reaches -5"),
        ("min = 5.0, max = 9.0", "min = 5.0, max = inf", "ego.speed_mps must be finite"),
        ("values = [8.0, 12.0]", "values = [8.0], min = 1.0", "has values and a range"),
        ("values = [8.0, 12.0]", "values = []", r"line 13: actors\[0\].speed_mps is empty"),
        ("values = [8.0, 12.0]", "value = 8.0", "speed_mps; did you mean values"),
        ("[ego]", "horizon_s = 0.0\n[ego]", "horizon_s is 0; it must be from 0.5 to 60"),
        ("[ego]", "lead_time_s = 9.0\n[ego]", "lead_time_s 9 is after the end"),
        ("[ego]", "seed = -1\n[ego]", "seed is -1; it must be from 0 to 9223"),
        ("min = 5.0, max = 9.0", "mean = 1e9, std = 1.0", "must be from 0 to 100"),
        ("[ego]", "samples = 0\n[ego]", "samples is 0; it must be from 1 to 10000"),
        ('name = "other"', 'name = "ego"', r"actors\[0\].name 'ego' is taken"),
        ('name = "other"', 'name = "other"\nhidden_by = "van"', "hidden_by 'van' must name"),
        ('name = "other"', 'name = "other"\nimpact_share = 1.2', r"12: actors\[0\].impact_share"),
        ('"oncoming"', '"crosses_exit"', "kind 'car' cannot be on a crossing"),
        ('"oncoming"', '"parked"', "does not go with relation 'parked'"),
        ("[ego]", "[where]\nkinds = ['lane']\n[ego]", r"kinds\[0\] 'lane': one of .*roundabout"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_what_is_right(
    old: str, new: str, told: str, tmp_path: Path
) -> None:
    assert old in GOOD
    with pytest.raises(UserError, match=told) as error:
        read(GOOD.replace(old, new, 1), tmp_path)
    message = str(error.value)
    assert "mine.toml" in message
    assert "\n" not in message


def test_two_actors_need_two_names(tmp_path: Path) -> None:
    twice = GOOD + '\n[[actors]]\nname = "other"\nrelation = "ahead"\n'
    with pytest.raises(UserError, match=r"actors\[1\].name 'other' is there twice"):
        read(twice, tmp_path)


def test_what_is_no_scenario_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no scenario file"):
        read_scenario(tmp_path / "none.toml")
    with pytest.raises(UserError, match="is a folder, not a file"):
        read_scenario(tmp_path)
    with pytest.raises(UserError, match="line 1: not TOML"):
        read("id = ", tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="is no UTF-8 text"):
        read_scenario(tmp_path / "binary.toml")


def test_the_scenario_of_the_documentation_is_sound(tmp_path: Path) -> None:
    words = (Path(__file__).parents[3] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    file = tmp_path / "motorcycle.toml"
    file.write_text(words.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    assert len(draw_cases(read_scenario(file))) == 6


def test_the_documentation_lists_the_catalogue() -> None:
    words = (Path(__file__).parents[3] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    for id_, scenario in catalogue().items():
        row = next(line for line in words.splitlines() if line.startswith(f"| `{id_}` |"))
        assert scenario.title in row
        assert scenario.source.split(",")[0] in row
