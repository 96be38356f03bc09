"""The public face: lazy, whole, typed, and enough for a notebook."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import foretwin
import foretwin.bus
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.sweep.spec import load_spec
from tests.orchestrator.sweeps import SMALL, alone, small_sweep
from tests.test_layout import ROOMS

COVERS = (
    "foretwin",
    "foretwin.bus",
    "foretwin.checks",
    "foretwin.maps",
    "foretwin.simulation",
)

USERS_READ = {".md", ".py", ".toml", ".ipynb"}
LATE = {"orchestrator", "sim_worker", "world_gen", "viewer", "telemetry"}


WITH_AN_EXTRA = {"JunctionEnv", "JunctionVectorEnv"}
ROOT = Path(__file__).parents[2]


def test_every_name_of_the_face_is_there() -> None:
    assert [name for name in foretwin._MODULE_OF if getattr(foretwin, name) is None] == []
    assert set(foretwin.__all__) | WITH_AN_EXTRA == set(foretwin._MODULE_OF)
    assert dir(foretwin) == sorted(foretwin._MODULE_OF)


def test_types_are_told_of_the_modules_that_names_are_loaded_from() -> None:
    tree = ast.parse(Path(foretwin.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    told = [node for node in block.body if isinstance(node, ast.ImportFrom)]

    assert {name.name: node.module for node in told for name in node.names} == foretwin._MODULE_OF


def test_what_a_program_on_the_bus_needs_is_there() -> None:
    tree = ast.parse(Path(foretwin.bus.__file__).read_text(encoding="utf-8"))
    told = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.level == 0]
    imported = {name.name for node in told for name in node.names} - {"annotations"}

    assert imported == set(foretwin.bus.__all__)


def test_every_module_of_the_face_is_packed() -> None:
    hatch = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    here = {f"foretwin/{path.name}" for path in (ROOT / "foretwin").glob("*.py")}

    for target in ("wheel", "sdist"):
        assert here - set(hatch["targets"][target]["only-include"]) == set()


def test_nothing_for_users_imports_a_room() -> None:
    rooms = re.compile(rf"foretwin\.(?:{'|'.join(sorted(ROOMS))})\b")
    files = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.*")]
    texts = {file: file.read_text(encoding="utf-8") for file in files if file.suffix in USERS_READ}

    assert len(texts) > 20
    assert {file: found for file, text in texts.items() if (found := rooms.findall(text))} == {}


def test_the_drawn_town_comes_along() -> None:
    assert "roundabout" in {one.kind for one in foretwin.drawn_town().intersections}


def test_a_name_that_is_not_there_is_told() -> None:
    with pytest.raises(AttributeError, match="no attribute 'no_such_thing'"):
        foretwin.no_such_thing  # noqa: B018


def test_one_room_is_imported_without_the_others() -> None:
    code = "import sys, foretwin.contracts.codec; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()

    assert "foretwin.contracts.codec" in loaded
    assert {name for name in loaded if name.startswith("foretwin.")} & {
        f"foretwin.{room}" for room in LATE
    } == set()


def test_the_nearest_intersection_is_found(town: foretwin.Map) -> None:
    one = town.intersections[0]

    assert town.nearest(one.lat + 1e-5, one.lon).id == one.id
    with pytest.raises(foretwin.UserError, match="away"):
        town.nearest(one.lat + 1.0, one.lon)


def test_a_world_is_kept_and_read_again(world: foretwin.World, tmp_path: Path) -> None:
    file = foretwin.save_world(world, tmp_path / "one.world")

    assert foretwin.read_world(file).id == world.id
    with pytest.raises(foretwin.UserError, match=r"nowhere\.world"):
        foretwin.read_world(tmp_path / "nowhere.world")


def test_a_world_is_written_as_its_suffix_says(world: foretwin.World, tmp_path: Path) -> None:
    assert b"OpenDRIVE" in foretwin.export_world(world, tmp_path / "one.xodr").read_bytes()
    with pytest.raises(foretwin.UserError, match="mjcf, commonroad"):
        foretwin.export_world(world, tmp_path / "one.xml")
    named = foretwin.export_world(world, tmp_path / "one.xml", format_name="mjcf")
    assert b"<mujoco" in named.read_bytes()


def test_futures_begin_where_the_car_is_and_differ(world: foretwin.World) -> None:
    way = foretwin.ways_through(world)[0]
    car = foretwin.state_on(world, way, before_m=30.0, speed_mps=8.0)

    futures = foretwin.run_futures(world, way, car, count=6, horizon_s=3.0)

    here = way.path.point_at(np.array([way.entry_m - 30.0]))[0]
    assert futures.states.shape == (6, 31, 8)
    assert futures.states[:, 0, :2] == pytest.approx(np.tile(here, (6, 1)), abs=1e-3)
    assert len({round(float(x), 3) for x in futures.states[:, -1, 0]}) == 6
    assert futures.rows[0]["name"] == "nominal"
    assert {(row["round_id"], row["job_index"]) for row in futures.rows} == {(0, 0)}
    assert futures.table.num_rows == 6


def test_a_fault_as_wished_has_its_effect(world: foretwin.World) -> None:
    way = foretwin.ways_through(world)[0]
    car = foretwin.state_on(world, way, before_m=60.0, speed_mps=8.0)
    wished = [
        foretwin.Future(index=0, name="as it is"),
        foretwin.Future(index=1, name="aside", numbers={"lateral_shift_m": 0.5}),
    ]

    futures = foretwin.run_futures(world, way, car, futures=wished, horizon_s=4.0)

    aside = way.path.locate(futures.states[:, -1, :2].astype(float)).offset_m
    assert aside[1] - aside[0] == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("scenarios", [(), ("scp",)])
def test_futures_have_the_table_of_runs_and_sweeps(
    world: foretwin.World, scenarios: tuple[str, ...]
) -> None:
    way = foretwin.ways_through(world)[0]
    car = foretwin.state_on(world, way)

    table = foretwin.run_futures(world, way, car, count=4, scenarios=scenarios, horizon_s=3.0).table

    assert table.schema.equals(TABLES["futures"])
    rows = table.to_pylist()
    assert [row["scenario"] for row in rows] == [
        "",
        *(scenarios or ("",)),
        "",
        *(scenarios or ("",)),
    ]
    assert {(row["junction_id"], row["vehicle"]) for row in rows} == {
        (world.intersection.id, foretwin.load_vehicle().name)
    }


def test_what_a_sweep_left_is_read(tmp_path: Path) -> None:
    loaded = load_spec(small_sweep(tmp_path, SMALL.replace("cases = 2", "cases = 1")))
    summary = run_sweep(loaded, tmp_path / "out", alone(loaded))

    left = foretwin.open_sweep(tmp_path / "out")

    assert left.table("futures").schema.equals(TABLES["futures"])
    assert left.record["rows_sha256"] == summary["rows_sha256"]
    assert left.table("futures").num_rows == summary["rows"]
    assert left.table("jobs").num_rows == summary["jobs"]
    metrics = {row["name"]: row for row in left.table("metrics").to_pylist()}
    assert (metrics["ttc"]["unit"], metrics["ttc"]["better"]) == ("s", "higher")
    for wrong in ("comparisons", "no_such_table"):
        with pytest.raises(
            foretwin.UserError, match=f"no table of {wrong}: .*futures, jobs, metrics, road_users"
        ):
            left.table(wrong)
    with pytest.raises(foretwin.UserError, match=r"no run\.json"):
        foretwin.open_run(tmp_path / "out")
