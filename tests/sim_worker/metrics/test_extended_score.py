"""The extended score's parts, scene by scene, by hand and by the published scorer."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foretwin.sim_worker.metrics.comfort import EgoMotion, motion
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.extended_score import extended_score
from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from foretwin.sim_worker.metrics.rollout import RolloutView
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.sim_worker.metrics.motions import VEHICLE, Mover
from tests.sim_worker.metrics.scored_scenes import (
    ALL_KEPT,
    JUNCTION,
    NORTH,
    SCENES,
    Scored,
    along,
    scored,
    world,
)
from tests.sim_worker.places import straight_path
from tests.world_gen.export.judges import judges_python

COVERS = ("foretwin.sim_worker.metrics.lane_areas",)
PARTS = {
    "nc": "epdms_no_fault",
    "dac": "on_road",
    "ddc": "epdms_direction",
    "tlc": "epdms_lights",
    "ttc": "epdms_ttc",
    "lk": "epdms_lane",
    "hc": "comfortable",
}
THEIRS = {
    "nc": "no_at_fault_collisions",
    "dac": "drivable_area_compliance",
    "ddc": "driving_direction_compliance",
    "tlc": "traffic_light_compliance",
    "ttc": "time_to_collision_within_bound",
    "lk": "lane_keeping",
    "hc": "history_comfort",
}


def parts_of(scene: Scored) -> list[dict[str, float]]:
    rollout, given = scored(scene)
    found = evaluate(rollout, (*PARTS.values(), "epdms", "progress"), context=given)
    names = {**PARTS, "score": "epdms", "way": "progress"}
    return [
        {short: float(found[name].values[row]) for short, name in names.items()} for row in (0, 1)
    ]


@pytest.mark.parametrize("name", SCENES)
def test_each_scene_breaks_what_it_says_and_nothing_else(name: str) -> None:
    scene = SCENES[name]
    mine, _ = parts_of(scene)

    assert {part: mine[part] for part in ALL_KEPT} == {**ALL_KEPT, **scene.parts}


def test_the_score_is_the_product_of_gates_times_the_mean_of_the_rest() -> None:
    mine, calm = parts_of(SCENES["a_little_on_the_wrong_side"])
    # Both go 16 m; half a gate leaves the other's way as the farthest.
    assert mine["score"] == pytest.approx(0.5 * (5 + 5 + 0 + 2) / 14)
    assert calm["score"] == pytest.approx(1.0)
    fast, calm = parts_of(SCENES["alone"])
    assert fast["score"] == pytest.approx(1.0)
    assert calm["score"] == pytest.approx((5 * 16 / 32 + 5 + 2 + 2) / 14)
    assert parts_of(SCENES["over_red"])[0]["score"] == 0.0


def test_who_overlaps_as_it_begins_is_left_out() -> None:
    scene = SCENES["into_who_stands"]
    began = scene._replace(others=tuple(o._replace(x=-48.0) for o in scene.others))

    mine, _ = parts_of(began)
    assert mine["nc"] == mine["ttc"] == 1.0


def test_an_ego_that_backs_has_its_rear_for_its_front() -> None:
    """It backs away from who stands ahead, and into who comes across behind; who drives faster
    hits it from where it came."""
    away = Scored(along(-50, -3), (Mover(-44.5, -1.5, 0, 0),))
    into = Scored(along(-50, -3), (Mover(-58.0, -5.0, NORTH, 1.5, 1.0, 0.6),))
    caught = Scored(along(-50, -3), (Mover(-40.0, -1.5, np.pi, 9.0),))

    assert [parts_of(away)[0][part] for part in ("nc", "ttc")] == [1.0, 1.0]
    assert [parts_of(into)[0][part] for part in ("nc", "ttc")] == [0.0, 0.0]
    assert parts_of(caught)[0]["nc"] == 1.0


def test_lanes_of_the_way_are_those_driven_along_it() -> None:
    lanes = LaneAreas(world())
    rollout, given = scored(SCENES["alone"])
    assert given.path is not None
    route = lanes.route(given.path)
    at = np.array([[-30.0, -1.5], [-30.0, 1.5], [0.0, -1.5], [1.5, -30.0], [60.0, -1.5]])

    assert lanes.on_route(at, route).tolist() == [True, False, True, False, True]
    assert lanes.in_junction(at).tolist() == [False, False, True, False, False]
    with pytest.raises(ValueError, match="lanes"):
        extended_score(RolloutView(rollout, given._replace(lanes=None)))


@pytest.mark.judge
def test_the_published_scorer_says_the_same_of_every_part() -> None:
    theirs = ask_navsim()
    differ = []
    for name, scene in SCENES.items():
        ours = parts_of(scene)
        for row, (mine, published) in enumerate(zip(ours, theirs[name], strict=True)):
            for part, their_name in THEIRS.items():
                expected = mine[part] if row else scene.theirs.get(part, mine[part])
                if abs(expected - published[their_name]) > 1e-6:
                    differ.append((name, row, part, mine[part], published[their_name]))
            assert max(mine["way"], 0.0) == pytest.approx(published["progress_m"], rel=1e-6)
            gates = np.prod([mine[part] for part in ("nc", "dac", "ddc", "tlc")])
            rest = 5 * published["ego_progress"] + 5 * mine["ttc"] + 2 * mine["lk"] + 2 * mine["hc"]
            assert mine["score"] == pytest.approx(gates * rest / 14, abs=1e-6)
    assert not differ


def ask_navsim() -> dict[str, list[dict[str, float]]]:
    sources = [os.environ.get(name, "") for name in ("NAVSIM_SOURCE", "NUPLAN_SOURCE")]
    if not all(source and Path(source).exists() for source in sources):
        pytest.skip("NAVSIM_SOURCE and NUPLAN_SOURCE name no checkouts of navsim, nuplan-devkit")
    run = subprocess.run(
        [judges_python(), Path(__file__).with_name("judge_navsim.py"), *sources],
        input=json.dumps(question()),
        capture_output=True,
        text=True,
        timeout=600.0,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    answer: dict[str, list[dict[str, float]]] = json.loads(run.stdout)
    return answer


def question() -> dict[str, Any]:
    here = world()
    _, given = scored(SCENES["alone"])
    assert given.ground is not None
    assert given.path is not None
    ways = [*here.lanes, *here.connections]
    strips = [_ribbon(np.asarray(way.centerline), way.width_m.value) for way in ways]
    paved = given.ground.surface
    route = LaneAreas(here).route(given.path)
    kinds = ["LANE"] * len(here.lanes) + ["LANE_CONNECTOR"] * len(here.connections)
    centre = straight_path().xy_m
    return {
        "vehicle": {
            "half_length": VEHICLE.length_m.value / 2,
            "half_width": VEHICLE.width_m.value / 2,
            "rear_axle_to_center": box_centre_from_base_m(VEHICLE),
        },
        "map": {
            "tokens": [*(way.id for way in ways), "paved", "junction"],
            "kinds": [*kinds, "ROADBLOCK", "INTERSECTION"],
            "areas": [
                *([strip] for strip in strips),
                [
                    list(paved.exterior.coords),
                    [list(hole.coords) for hole in paved.interiors],
                ],
                [JUNCTION.tolist()],
            ],
            "route": [way.id for way, on in zip(ways, route, strict=True) if on],
        },
        "path": [[x, y, 0.0] for x, y in centre.tolist()],
        "scenes": {name: _as_json(scene, strips, ways) for name, scene in SCENES.items()},
    }


def _as_json(scene: Scored, strips: list[Any], ways: list[Any]) -> dict[str, Any]:
    rollout, _ = scored(scene)
    view = RolloutView(rollout)
    found: EgoMotion = motion(view)
    states = np.zeros((2, len(rollout.time_s), 11))
    states[..., :5] = rollout.states[..., :5]
    states[..., 5], states[..., 6] = found.lon_accel_mps2, found.lat_accel_mps2
    states[..., 9], states[..., 10] = found.yaw_rate_radps, found.yaw_accel_radps2
    red = [k for k, way in enumerate(ways) if way.id in ("east", "west")]
    return {
        "states": states.tolist(),
        "users": rollout.users[0].tolist(),
        "user_speed_mps": rollout.user_speed_mps[0, 0].tolist(),
        "user_size_m": rollout.user_size_m[0].tolist(),
        "red": [strips[k] for k in red] if scene.start_s else [],
    }


def _ribbon(line: np.ndarray[Any, Any], width_m: float) -> list[list[float]]:
    way = (line[-1] - line[0]) / np.hypot(*(line[-1] - line[0]))
    left = np.array([-way[1], way[0]]) * width_m / 2.0
    return [
        (p + s * left).tolist()
        for p, s in ((line[0], 1), (line[-1], 1), (line[-1], -1), (line[0], -1))
    ]
