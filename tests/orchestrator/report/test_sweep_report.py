"""A sweep's report: outcomes, worst cases with commands that play them again, what was left out."""

from __future__ import annotations

import json
import shutil
from operator import itemgetter
from pathlib import Path

import pyarrow as pa
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.repeat import repeat
from foretwin.orchestrator.report.blocks import Facts
from foretwin.orchestrator.report.material import most_critical
from foretwin.orchestrator.report.page import html_of
from foretwin.orchestrator.report.sweep_material import SweepMaterial
from foretwin.orchestrator.report.write_report import report_of_folders
from tests.orchestrator.report.read_page import MOST_BYTES, ReadPage
from tests.orchestrator.sweeps import small_sweep
from tests.sim_worker.scenarios.worlds import cross

COVERS = (
    "foretwin.orchestrator.report.sweep_details",
    "foretwin.orchestrator.report.sweep_material",
)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    out = folder / "out"
    assert run(["sweep", str(small_sweep(folder)), "--out", str(out), "--workers", "1"]) == 0
    return out


@pytest.fixture(scope="module")
def page(swept: Path) -> str:
    return html_of(report_of_folders([swept]))


def test_a_sweep_that_placed_nothing_has_no_rows(tmp_path: Path) -> None:
    (tmp_path / "sweep.json").write_text(json.dumps({"scenarios": []}))
    (tmp_path / "rows").mkdir()
    assert SweepMaterial(tmp_path).futures.num_rows == 0


@pytest.mark.judge
def test_it_tells_outcomes_and_stands_alone(swept: Path, page: str) -> None:
    read, record = ReadPage(page), json.loads((swept / "sweep.json").read_text())
    assert read.nameless == 0

    assert f"Of {record['played']} cases that were played {record['collided']}" in page
    assert "Outcome by junction, scenario and planner" in page
    assert "constant_speed" in page
    assert read.loaded == []
    assert {link.removeprefix("#") for link in read.links} - read.anchors == set()
    assert len(page.encode()) < MOST_BYTES


@pytest.mark.judge
def test_worst_cases_play_again_to_the_same_hash(swept: Path, page: str) -> None:
    commands = [code.split() for code in ReadPage(page).codes if code.startswith("foretwin repeat")]

    assert commands
    for command in commands[::3]:
        assert repeat(swept, command[3], view=False).code == 0


def test_it_says_of_which_map_it_is_as_its_worlds_know(swept: Path, tmp_path: Path) -> None:
    assert SweepMaterial(swept).map == {}  # given Worlds may be of several maps
    of_map = shutil.copytree(swept, tmp_path / "of_map")
    record = json.loads((of_map / "sweep.json").read_text())
    record["spec"] |= {"map": "maps/town.osm", "worlds": None}
    (of_map / "sweep.json").write_text(json.dumps(record))

    provenance = report_of_folders([of_map]).parts[-1]

    told = next(dict(block.pairs) for block in provenance.blocks if isinstance(block, Facts))
    assert told["map"] == "town.osm"
    assert told["map, sha256"] == cross().map_sha256


def test_a_sweep_that_played_nothing_says_so(tmp_path: Path) -> None:
    (tmp_path / "sweep.json").write_text(json.dumps({"complete": False, "spec": {}}))

    page = html_of(report_of_folders([tmp_path]))

    assert "The sweep holds no rows: nothing was played." in page
    assert "not complete" in page


def test_of_a_sweep_that_was_stopped_it_tells_what_is_there(swept: Path, tmp_path: Path) -> None:
    out = tmp_path / "stopped"
    shutil.copytree(swept, out)
    record = json.loads((out / "sweep.json").read_text())
    lines = (out / "manifest.jsonl").read_text().splitlines()
    dropped = json.loads(lines[-1])
    (out / "manifest.jsonl").write_text("\n".join([*lines[:-1], ""]))
    (out / "rows" / f"job-{dropped['job']:06d}.parquet").unlink()
    (out / "sweep.json").write_text(json.dumps({"complete": False, "spec": record["spec"]}))
    gone = {name: sum(one[name] for one in dropped["counts"]) for name in ("played", "collided")}

    page = html_of(report_of_folders([out]))

    played, collided = (record[name] - gone[name] for name in gone)
    assert f"Of {played} cases that were played {collided} end in a collision" in page
    assert "jobs are missing" in page


def test_futures_that_failed_are_neither_played_nor_left_out(swept: Path, tmp_path: Path) -> None:
    """Of two that meet the same cases, who fails in most of them is not the one that hits least."""
    out = tmp_path / "failing"
    shutil.copytree(swept, out)
    record = json.loads((out / "sweep.json").read_text())
    names = "cases", "placed", "played", "collided", "failed", "not_placed_rows", "scored"
    of = {"careful": (110, 100, 100, 20, 0, 10, 100), "failing": (110, 80, 40, 9, 60, 10, 40)}
    entry = record["scenarios"][0] | {"not_placed": {"too short": 10}, "reasons": {}}
    groups = [
        entry | dict(zip(names, of[planner], strict=True)) | {"planner": planner} for planner in of
    ]
    told = {"scenarios": groups, "rows": 220, "placed": 180, "collided": 29, "failed": 60}
    (out / "sweep.json").write_text(json.dumps(record | told))

    report = report_of_folders([out])

    assert report.verdict == (
        "Of 140 cases that were played 29 end in a collision: fewest with careful (20 of 100), "
        "most with failing (9 of 40); 60 futures failed."
    )
    figures = {one.name: (one.value, one.note) for one in report.figures}
    del figures["gravest"]
    assert figures == {
        "cases": ("220", "140 played to their end"),
        "collide": ("21%", "29 of 140 played"),
        "left out": ("20", "the scenario has no place there"),
        "failed": ("60", "not played to their end"),
    }
    for group in groups:
        del group["played"], group["scored"]
    (out / "sweep.json").write_text(json.dumps(record | told | {"scenarios": groups}))
    assert report_of_folders([out]).verdict == report.verdict


@pytest.mark.parametrize(
    ("collided", "said"),
    [
        ({"a": 5, "b": 5}, ", the same share with each planner."),
        (
            {"a": 5, "b": 5, "c": 7},
            ": fewest with a (5 of 10) and b (5 of 10), most with c (7 of 10).",
        ),
    ],
)
def test_planners_that_collide_as_often_are_told_alike(
    swept: Path, tmp_path: Path, collided: dict[str, int], said: str
) -> None:
    out = tmp_path / "alike"
    shutil.copytree(swept, out)
    record = json.loads((out / "sweep.json").read_text())
    entry = record["scenarios"][0] | {"played": 10, "scored": 10}
    groups = [entry | {"planner": who, "collided": hit} for who, hit in collided.items()]
    (out / "sweep.json").write_text(json.dumps(record | {"scenarios": groups}))

    assert report_of_folders([out]).verdict.endswith(f"end in a collision{said}")


def test_a_sweep_whose_rows_are_damaged_is_refused(swept: Path, tmp_path: Path) -> None:
    (tmp_path / "sweep.json").write_bytes((swept / "sweep.json").read_bytes())
    (tmp_path / "rows").mkdir()
    (tmp_path / "rows" / "job-0.parquet").write_bytes(b"PAR1")

    with pytest.raises(UserError, match=r"rows: cannot be read"):
        report_of_folders([tmp_path])


def test_collisions_that_nobody_knows_the_gravity_of_come_first_of_the_worst() -> None:
    rows = [
        {"future_id": "near", "collided": False, "criticality": 1e-5, "likelihood": 0.1},
        {"future_id": "hit", "collided": True, "criticality": None, "likelihood": 0.1},
        {"future_id": "nothing", "collided": False, "criticality": 0.0, "likelihood": 1.0},
    ]
    worst = most_critical(pa.Table.from_pylist(rows), 3, of=itemgetter("future_id"))
    assert [row["future_id"] for row in worst] == ["hit", "near"]
