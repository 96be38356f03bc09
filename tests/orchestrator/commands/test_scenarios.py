"""The commands on scenarios: what they list, refuse, and say of a map's junctions."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.output import print_json
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.worlds.opening import open_map
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import CATALOGUE, catalogue

COVERS = (
    "foretwin.orchestrator.commands.cli_options",
    "foretwin.orchestrator.commands.cli_scenarios",
    "foretwin.orchestrator.commands.output",
    "foretwin.orchestrator.commands.scenario_catalogue",
    "foretwin.orchestrator.commands.scenario_export",
)

MAP = str(MAP_FILE)


def test_the_catalogue_is_listed_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["scenarios", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [item["id"] for item in listed] == list(catalogue())
    ccftap = next(item for item in listed if item["id"] == "ccftap")
    assert ccftap["cases"] == 9
    assert ccftap["source"].startswith("Euro NCAP")
    assert ccftap["actors"][0] == {
        "name": "oncoming_car", "kind": "car", "relation": "oncoming", "conduct": "heedless",
    }  # fmt: skip


def test_what_is_not_finite_is_null_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"ttc_s": float("inf"), "gap_m": [float("nan"), 1.5], "street": "Königstraße"})
    said = capsys.readouterr().out
    assert json.loads(said) == {"ttc_s": None, "gap_m": [None, 1.5], "street": "Königstraße"}
    assert "Königstraße" in said


def test_the_catalogue_is_listed_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["scenarios"]) == 0
    said = capsys.readouterr().out
    assert all(id_ in said for id_ in catalogue())


def test_a_sound_file_is_said_to_be_so(capsys: pytest.CaptureFixture[str]) -> None:
    file = CATALOGUE / "cccscp.toml"
    assert run(["scenarios", "check", str(file)]) == 0
    said = capsys.readouterr().out
    kinds = "crossing, staggered, mini_roundabout, other"
    assert said == f"{file}: cccscp, Car-to-car straight crossing path: 9 cases, {kinds}\n"


def test_a_bad_file_ends_with_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text((CATALOGUE / "scp.toml").read_text().replace("min = 6.0", "min = 60.0", 1))
    assert run(["scenarios", "check", str(bad)]) == 2
    said = capsys.readouterr()
    assert said.err == (
        f"foretwin: scenario file {bad}: line 12: ego.speed_mps runs from min 60 to max 14; "
        "min must be less than max\n"
    )
    assert run(["scenarios", "check", str(tmp_path / "none.toml")]) == 2
    assert "no scenario file" in capsys.readouterr().err


def test_scenarios_are_placed_on_every_junction_of_a_map(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert (
        run(["scenarios", "place", MAP, "--json", "--scenario", "scp", "--scenario", "cpta"]) == 0
    )
    scp, cpta = json.loads(capsys.readouterr().out)
    junctions = {junction.summary.id for junction in open_map(MAP_FILE).junctions}
    for row in (scp, cpta):
        assert row["title"] == catalogue()[row["id"]].title
        assert row["looked_at"] == len(junctions)
        assert row["placed"] == len(row["places"]) >= 1
        assert set(row["places"]) <= junctions
        assert row["placed"] == row["applies"]
        assert row["placed"] + sum(row["does_not_apply"].values()) == len(junctions)
    assert any(reason.startswith("its kind is") for reason in scp["does_not_apply"])


def test_one_junction_is_named_by_id_or_place(capsys: pytest.CaptureFixture[str]) -> None:
    summary = next(j.summary for j in open_map(MAP_FILE).junctions if j.summary.kind == "crossing")
    for option in (["--id", summary.id], ["--at", f"{summary.lat},{summary.lon}"]):
        assert run(["scenarios", "place", MAP, "--scenario", "scp", "--json", *option]) == 0
        (row,) = json.loads(capsys.readouterr().out)
        assert list(row["places"]) == [summary.id]
        ego, _, other = row["places"][summary.id].partition("/")
        assert ego != other
        assert ">" in ego
        assert ">" in other
    assert run(["scenarios", "place", MAP, "--id", "n1", "--at", "0,0"]) == 2
    assert "not by both" in capsys.readouterr().err


def test_junctions_without_a_place_are_told_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far = tmp_path / "far.toml"
    text = (CATALOGUE / "occluded_pedestrian.toml").read_text()
    far.write_text(text.replace("gap_m = 1.0", "gap_m = 1.0\nlateral_m = -30.0"))
    junction = open_map(MAP_FILE).junctions[0].summary.id
    place = ["scenarios", "place", MAP, "--scenario", str(far), "--id", junction]
    assert run([*place, "--json"]) == 3
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["placed"], row["applies"]) == (0, 1)
    assert "parked_van would be 30.0 m beside the ego's path" in row["unplaced"][junction]
    assert run(place) == 3
    said = capsys.readouterr().out
    assert "1 unplaced" in said
    assert said.endswith("placed nowhere: occluded_pedestrian\n")


@pytest.mark.parametrize(
    ("named", "code"),
    [(["race_track_lap"], 3), (["lead_stopping"], 0), (["lead_stopping", "race_track_lap"], 3)],
)
def test_a_scenario_that_was_named_and_takes_place_nowhere_is_a_part_that_is_missing(
    named: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [word for name in named for word in ("--scenario", name)]
    assert run(["scenarios", "place", MAP, *asked, "--json"]) == code
    rows = json.loads(capsys.readouterr().out)
    assert rows[0]["id"] != "lead_stopping" or rows[0]["unplaced"]


def test_of_the_whole_catalogue_what_a_place_is_not_for_is_not_missing() -> None:
    assert run(["scenarios", "place", MAP, "--id", "n57"]) == 0


def test_unknown_scenarios_are_refused_before_the_map_is_read(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["scenarios", "place", "no.osm", "--scenario", "ccftab"]) == 2
    said = capsys.readouterr().err
    assert "no scenario 'ccftab'; did you mean ccftap? one of brake_fault" in said


def test_a_case_is_exported_with_its_roads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = next(j.summary for j in open_map(MAP_FILE).junctions if j.summary.kind == "crossing")
    out = tmp_path / "new" / "scp.xosc"
    asked = ["scenarios", "export", "scp", "--map", MAP, "--id", where.id, "--case", "2"]
    assert run([*asked, "--out", str(out)]) == 0
    assert capsys.readouterr().out == (
        f"{out}: scp, case 2, at {where.id}\n{out.with_suffix('.xodr')}: its roads\n"
    )
    drawn = draw_cases(catalogue()["scp"])[1]
    assert f'name="ego_speed_mps" parameterType="double" value="{drawn["ego.speed_mps"]:.12g}"' in (
        out.read_text()
    )
    assert "<OpenDRIVE>" in out.with_suffix(".xodr").read_text()
    assert run([*asked[:-1], "9", "--out", str(out)]) == 2
    assert capsys.readouterr().err == "foretwin: scp has cases 1 to 4; there is no 9\n"
    assert run([*asked, "--out", str(tmp_path / "scp.xml")]) == 2
    assert "an OpenSCENARIO file is written as .xosc" in capsys.readouterr().err
    assert run(["scenarios", "export", "overtaking_motorway", *asked[3:], "--out", str(out)]) == 2
    assert "has no place at" in capsys.readouterr().err
    assert run(["scenarios", "export", "scp", "--map", MAP, "--out", str(out)]) == 2
    assert "name the junction" in capsys.readouterr().err


def test_an_export_replaces_its_own_roads_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = next(j.summary for j in open_map(MAP_FILE).junctions if j.summary.kind == "crossing")
    out, roads = tmp_path / "scp.xosc", tmp_path / "scp.xodr"
    asked = ["scenarios", "export", "scp", "--map", MAP, "--id", where.id, "--out", str(out)]
    roads.write_text("mine")
    assert run(asked) == 2
    assert "scp.xodr: would be replaced by the roads of scp.xosc" in capsys.readouterr().err
    assert (roads.read_text(), out.exists()) == ("mine", False)
    roads.unlink()
    assert run(asked) == 0
    assert run(asked) == 0


def test_a_case_without_a_place_leaves_no_folder(tmp_path: Path) -> None:
    out = tmp_path / "new" / "o.xosc"
    asked = ["scenarios", "export", "scp", "--map", MAP, "--id", "n0", "--out", str(out)]
    assert run(asked) == 2
    assert not out.parent.exists()


def test_a_case_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = next(j.summary for j in open_map(MAP_FILE).junctions if j.summary.kind == "crossing")
    out = tmp_path / "scp.png"
    asked = ["scenarios", "draw", "scp", "--map", MAP, "--id", where.id, "--out", str(out)]
    assert run(asked) == 0
    assert capsys.readouterr().out == f"{out}: scp, case 1, at {where.id}\n"
    assert out.read_bytes().startswith(b"\x89PNG")
    assert run([*asked, "--planner", "nobody"]) == 2
    assert "unknown planner 'nobody'" in capsys.readouterr().err
    assert run([*asked[:-1], str(tmp_path / "scp.svg")]) == 2
    assert "a picture of a case is written as .png" in capsys.readouterr().err
