"""The public face: lazy, whole, typed, and enough for a notebook."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import foretwin
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.sweep.spec import load_spec
from tests.orchestrator.sweeps import SMALL, alone, small_sweep

COVERS = (
    "foretwin",
    "foretwin.maps",
    "foretwin.recordings",
    "foretwin.simulation",
)

LATE = {"orchestrator", "sim_worker", "world_gen", "viewer", "telemetry"}


@pytest.fixture(scope="module")
def town() -> foretwin.Map:
    return foretwin.open_map(MAP_FILE)


@pytest.fixture(scope="module")
def world(town: foretwin.Map) -> foretwin.World:
    return town.world(next(one.id for one in town.intersections if one.kind == "crossing"))


def test_every_name_of_the_face_is_there() -> None:
    assert [name for name in foretwin.__all__ if getattr(foretwin, name) is None] == []
    assert set(foretwin.__all__) == set(foretwin._MODULE_OF)


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


def test_what_a_sweep_left_is_read(tmp_path: Path) -> None:
    loaded = load_spec(small_sweep(tmp_path, SMALL.replace("cases = 2", "cases = 1")))
    summary = run_sweep(loaded, tmp_path / "out", alone(loaded))

    left = foretwin.open_sweep(tmp_path / "out")

    assert left.record["rows_sha256"] == summary["rows_sha256"]
    assert left.table("futures").num_rows == summary["rows"]
    assert left.table("jobs").num_rows == summary["jobs"]
    metrics = {row["name"]: row for row in left.table("metrics").to_pylist()}
    assert (metrics["ttc"]["unit"], metrics["ttc"]["better"]) == ("s", "higher")
    for wrong in ("comparisons", "no_such_table"):
        with pytest.raises(foretwin.UserError, match=f"no table {wrong!r}"):
            left.table(wrong)
    with pytest.raises(foretwin.UserError, match=r"no run\.json"):
        foretwin.open_run(tmp_path / "out")


def test_mistakes_are_told_in_one_line(world: foretwin.World) -> None:
    way = foretwin.ways_through(world)[0]
    car = foretwin.state_on(world, way)
    with pytest.raises(foretwin.UserError, match=r"has .* m"):
        foretwin.state_on(world, way, before_m=1e4)
    with pytest.raises(foretwin.UserError, match="no_such_planner"):
        foretwin.run_futures(world, way, car, planner="no_such_planner")
    with pytest.raises(foretwin.UserError, match=r"no run\.json"):
        foretwin.open_run("nowhere")
