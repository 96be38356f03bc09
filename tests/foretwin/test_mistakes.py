"""Mistakes in what is given to the face are UserError, in one line; nothing is touched."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import foretwin
from foretwin.contracts.frames import GeoPoint

IDM = "pure_pursuit_idm"


@pytest.fixture(scope="module")
def way(world: foretwin.World) -> foretwin.Way:
    return foretwin.ways_through(world)[0]


@pytest.fixture(scope="module")
def car(world: foretwin.World, way: foretwin.Way) -> foretwin.VehicleState:
    return foretwin.state_on(world, way)


def future(**other: Any) -> list[foretwin.Future]:
    return [foretwin.Future(**{"index": 0, "name": "x"} | other)]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        *[({"count": n}, "whole number from 1 to 10000") for n in (0, -1, 1.5, 20_000, "a")],
        *[
            ({"horizon_s": t}, "0.1 to 60 seconds, in steps of 0.1")
            for t in (0, -1, 0.05, math.nan, 1000)
        ],
        ({"horizon_s": "8"}, "must be a number"),
        *[({"seed": n}, "whole number from 0 to 9223") for n in (-1, 1.5, 2**70, None)],
        ({"planner": "nosuch"}, "unknown planner 'nosuch'"),
        ({"planner": "remote"}, "remote asks a stack over the bus of a drive; there is none"),
        ({"planner": "as_planned"}, "as_planned drives the plan that the car of a drive"),
        ({"vehicle": "trabant"}, "no bundled vehicle of that name"),
        ({"vehicle": 5}, "vehicle must be a path"),
        ({"scenarios": "nosuch"}, "no scenario 'nosuch'"),
        ({"scenarios": ["scp.toml"]}, "no scenario file scp.toml"),
        ({"scenarios": [5]}, "a scenario must be a path"),
        ({"scenarios": 5}, "scenarios must be ids, files or definitions, not int"),
        ({"futures": ["a"]}, "a future must be a Future, not str"),
        ({"futures": 2 * future()}, "two of index 0"),
        ({"futures": future(planner="nosuch")}, "unknown planner 'nosuch'"),
        ({"futures": future(planner="remote")}, "there is none here"),
        ({"futures": future(scenario_id="scp")}, "names scenario 'scp'; the job defines none"),
        (
            {"futures": future(scenario_id="scp"), "scenarios": "scp"},
            "has no value 'crossing_car",
        ),
        ({"futures": future(numbers={"nosuch": 1.0})}, "a number 'nosuch'; known: target_speed"),
        ({"futures": future(numbers={"friction_factor": -1.0})}, "it must be above 0, at most 4"),
        ({"futures": future(numbers={"lateral_shift_m": math.nan})}, "must be finite"),
        ({"futures": future(numbers={"extra_steering_delay_s": 5.0})}, "from 0 to 0.4"),
    ],
)
def test_what_cannot_be_played(
    world: foretwin.World,
    way: foretwin.Way,
    car: foretwin.VehicleState,
    given: dict[str, Any],
    said: str,
) -> None:
    with pytest.raises(foretwin.UserError, match=said) as told:
        foretwin.run_futures(world, way, car, **given)
    assert "\n" not in str(told.value)


def test_values_that_are_no_case_are_refused(
    world: foretwin.World, way: foretwin.Way, car: foretwin.VehicleState
) -> None:
    played = foretwin.run_futures(world, way, car, count=2, scenarios="scp", horizon_s=0.1)
    case = played.job.futures[1]
    again = foretwin.run_futures(
        world, way, car, futures=played.job.futures, scenarios="scp", horizon_s=0.1
    )
    assert again.rows == played.rows
    for more in ({"count": 2}, {"planner": "constant_speed"}):
        with pytest.raises(foretwin.UserError, match=f"{next(iter(more))} .*not with futures"):
            foretwin.run_futures(world, way, car, futures=played.job.futures, **more)
    for values, said in (
        ({"ego.speed_mps": -1.0}, "ego.speed_mps reaches -1; it must be from 0 to 100"),
        ({"ego.mood": 1.0}, "has an unknown value 'ego.mood'"),
    ):
        wrong = msgspec.structs.replace(case, values={**case.values, **values})
        with pytest.raises(foretwin.UserError, match=said):
            foretwin.run_futures(world, way, car, futures=[wrong], scenarios="scp")
    alone = foretwin.run_futures(world, way, car, futures=case, scenarios="scp", horizon_s=0.1)
    assert [row["index"] for row in alone.rows] == [case.index]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"speed_mps": math.nan}, "is not finite"),
        ({"yaw_rad": math.inf}, "is not finite"),
        ({"position": GeoPoint(math.nan, 7.0)}, "is not finite"),
        ({"position": GeoPoint(95.0, 7.0)}, "outside latitude"),
        ({"position": GeoPoint(43.0, 7.0)}, "m away from way"),
    ],
)
def test_states_in_which_no_car_is(
    world: foretwin.World,
    way: foretwin.Way,
    car: foretwin.VehicleState,
    wrong: dict[str, Any],
    said: str,
) -> None:
    with pytest.raises(foretwin.UserError, match=said) as told:
        foretwin.run_futures(world, way, msgspec.structs.replace(car, **wrong), count=1)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"speed_mps": math.nan}, "speed_mps must be finite"),
        ({"speed_mps": -5}, "reaches -5; it must be from 0 to 100"),
        ({"speed_mps": "fast"}, "speed_mps must be a number"),
        ({"before_m": math.nan}, "nan m before"),
        ({"before_m": 1e4}, "has .* m"),
    ],
)
def test_places_and_speeds_that_no_car_has(
    world: foretwin.World, way: foretwin.Way, given: dict[str, Any], said: str
) -> None:
    with pytest.raises(foretwin.UserError, match=said):
        foretwin.state_on(world, way, **given)


def test_other_ways_to_say_the_same(
    world: foretwin.World, way: foretwin.Way, car: foretwin.VehicleState, tmp_path: Path
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('id = "mine"\ntitle = "a"\nshows = "a"\nsource = "a"\n', encoding="utf-8")
    mine = foretwin.read_scenario(str(file))
    assert foretwin.read_scenario(file) == foretwin.find_scenario(file) == mine
    for scenarios in (file, str(file), [file], mine, [mine]):
        played = foretwin.run_futures(
            world, way, car, count=np.int64(2), scenarios=scenarios, horizon_s=np.float64(0.1)
        )
        assert played.rows[1]["scenario"] == "mine"
    bus = foretwin.run_futures(world, way, car, count=1, vehicle="city_bus", horizon_s=0.1)
    assert bus.rows[0]["vehicle"] == foretwin.load_vehicle("city_bus").name


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda town: town.world("n1"), "^n1: .*drawn_town.osm holds no such intersection; "),
        (lambda town: town.world(town.intersections[0].id, radius_m=5), "between 10 and 2000 m"),
        (lambda town: town.world(town.intersections[0].id, radius_m="a"), "must be a number"),
        (
            lambda town: town.nearest(0, 0),
            "^0.0,0.0: the nearest intersection of .* m away, more than 200$",
        ),
        (lambda town: town.nearest(math.nan, 7), "is not finite"),
        (lambda town: town.nearest(95, 700), "outside latitude"),
        (lambda _: foretwin.open_map(None), "file must be a path, not NoneType"),  # type: ignore[arg-type]
        (lambda _: foretwin.ways_through(None), "world must be a World, not NoneType"),  # type: ignore[arg-type]
        (lambda _: foretwin.read_scenario("nosuch.toml"), "no scenario file nosuch.toml"),
        (lambda _: foretwin.load_vehicle("nosuch"), "no vehicle file nosuch"),
        (lambda _: foretwin.open_run("nowhere"), r"no run\.json"),
        (lambda _: foretwin.read_world("nowhere"), "^nowhere: No such file or directory$"),
    ],
)
def test_what_is_not_there(town: foretwin.Map, call: Any, said: str) -> None:
    with pytest.raises(foretwin.UserError, match=said) as told:
        call(town)
    assert "--" not in str(told.value)


def test_nothing_is_overwritten_or_written_elsewhere(world: foretwin.World, tmp_path: Path) -> None:
    kept = foretwin.save_world(world, tmp_path / "one.world")
    for write in (foretwin.save_world, foretwin.export_world):
        with pytest.raises(foretwin.UserError, match="world must be a World, not NoneType"):
            write(None, kept.with_suffix(".svg" if write is foretwin.export_world else ".world"))
        with pytest.raises(foretwin.UserError, match="No such file or directory"):
            write(world, tmp_path / "nosuch" / "one.svg")
    assert foretwin.read_world(kept).id == world.id
    assert [file.name for file in tmp_path.iterdir()] == ["one.world"]
