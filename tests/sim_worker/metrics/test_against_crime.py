"""Twenty-two scenes against commonroad-crime: following, crossing at four angles, and in bends.

What it said is kept beside the scenes (`freeze_crime.py`); `make judge` asks it again. It works in
whole steps of 20 ms and rounds to 0.01.
"""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Rollout
from tests.sim_worker.metrics.motions import VEHICLE, Mover, rollout, times
from tests.world_gen.export.judges import judges_python

KEPT = Path(__file__).parents[2] / "data/metrics/crime.json"
FROZEN = json.loads(KEPT.read_text())
SCENES: dict[str, dict[str, Any]] = FROZEN["scenes"]
STEP_S, UNTIL_S = FROZEN["step_s"], FROZEN["until_s"]
NOW_S = np.array([0.0, 1e-6])
ROUNDED = 0.0051
MAX_ACCEL_MPS2 = 8.0


def of_kind(kind: str | None) -> list[str]:
    kinds = {"crossing", "bend_pm"}
    return [
        name
        for name, scene in SCENES.items()
        if (kind in scene if kind else not kinds & scene.keys())
    ]


def theirs(name: str) -> dict[str, float]:
    """What the package found; infinite where it has no answer, or none in the scene's 8 s."""
    found = SCENES[name]["found"]
    return {key: math.inf if value is None else abs(value) for key, value in found.items()}


def value(driven: Rollout, name: str) -> float:
    return float(evaluate(driven, (name,))[name].values[0])


def driven(name: str, time_s: Array) -> Rollout:
    """A scene as a rollout at `time_s` (N,)."""
    scene = SCENES[name]
    x, y, yaw, speed, _ = scene["ego"]
    ox, oy, other_yaw, other_mps, accel, length, width = scene["other"]
    made = rollout(
        Mover(x, y, yaw, speed), Mover(ox, oy, other_yaw, other_mps, length, width), time_s=time_s
    )
    way = accel * time_s**2 / 2
    made.users[0, :, 0, 0] += way * math.cos(other_yaw)
    made.users[0, :, 0, 1] += way * math.sin(other_yaw)
    made.user_speed_mps[0, :, 0] += accel * time_s
    size = SCENES[name]["ego_size_m"]
    changed = {
        "length_m": msgspec.structs.replace(VEHICLE.length_m, value=size[0]),
        "width_m": msgspec.structs.replace(VEHICLE.width_m, value=size[1]),
    }
    back = size[0] / 2.0 - VEHICLE.rear_overhang_m.value
    middle = np.column_stack([x + speed * time_s * math.cos(yaw), y + 0 * time_s, yaw + 0 * time_s])
    rate = 0.0
    if bend_pm := scene.get("bend_pm"):
        middle = on_bend(x + speed * time_s, bend_pm)
        made.users[0, :, 0] = on_bend(ox + other_mps * time_s, bend_pm)
        rate = speed * bend_pm
    made.states[0, :, :3] = middle
    made.states[0, :, 0] -= back * np.cos(middle[:, 2])
    made.states[0, :, 1] -= back * np.sin(middle[:, 2])
    # The middle keeps to the lane: base_link behind it slides outwards.
    made.states[0, :, 3:6] = (speed, -back * rate, rate)
    return made._replace(vehicle=msgspec.structs.replace(VEHICLE, **changed))


def on_bend(along_m: Array, bend_pm: float) -> Array:
    """(N, 3) poses on a circle that begins along x."""
    angle = along_m * bend_pm
    return np.column_stack([np.sin(angle) / bend_pm, (1.0 - np.cos(angle)) / bend_pm, angle])


@pytest.mark.parametrize("name", of_kind(None))
def test_behind_a_leader(name: str) -> None:
    expected, now = theirs(name), driven(name, NOW_S)
    # Theirs follows the leader's rear of now with the ego's later states, in whole steps.
    assert value(now, "thw") == pytest.approx(expected["THW"], abs=STEP_S + 0.005)
    assert value(now, "wttc") == pytest.approx(expected["WTTC"], abs=ROUNDED)
    if name == "faster_leader":
        # Theirs squares the speed at which the gap grows.
        assert value(now, "required_acceleration") == value(now, "btn") == 0.0
        return
    assert value(now, "required_deceleration") == pytest.approx(expected["ALongReq"], abs=ROUNDED)
    assert value(now, "btn") == pytest.approx(expected["BTN"], abs=ROUNDED / MAX_ACCEL_MPS2)
    if name == "accelerating_leader":
        # There theirs is the time with constant accelerations. Below it enters rounded.
        return
    assert value(now, "ttc") == pytest.approx(expected["TTC"], abs=ROUNDED)
    # Theirs is the last whole step from which full brakes, in whole steps, suffice.
    assert value(now, "ttb") == pytest.approx(expected["TTB"], abs=2 * STEP_S)
    if math.isfinite(expected["TTCStar"]):
        assert value(now, "ttc") == pytest.approx(expected["TTCStar"], abs=STEP_S)
    for ours, their_name, scale in (
        ("required_lateral_acceleration", "ALatReq", 1.0),
        ("required_acceleration", "AReq", 1.0),
        ("stn", "STN", MAX_ACCEL_MPS2),
    ):
        assert value(now, ours) == pytest.approx(expected[their_name], abs=0.0071 / scale)


@pytest.mark.parametrize("name", of_kind("crossing"))
def test_where_ways_cross(name: str) -> None:
    expected = theirs(name)
    now, whole = driven(name, NOW_S), driven(name, times(UNTIL_S, STEP_S))
    hits = math.isinf(expected["PET"])
    assert value(whole, "et") == pytest.approx(expected["ET"], abs=2 * STEP_S)
    # It counts the way from the step before the outlines come to overlap.
    step_m = SCENES[name]["ego"][3] * STEP_S
    stop_m = SCENES[name]["ego"][3] ** 2 / (2 * 3.4)
    assert value(whole, "psd") == pytest.approx(expected["PSD"], abs=2 * step_m / stop_m + ROUNDED)
    assert value(now, "wttc") == pytest.approx(expected["WTTC"], abs=ROUNDED)
    if hits:
        # Where both meet it has no such time, or a negative one.
        assert value(whole, "pet") == 0.0
        assert value(now, "ttc") == pytest.approx(expected["TTCStar"], abs=STEP_S)
    else:
        assert value(whole, "pet") == pytest.approx(expected["PET"], abs=2 * STEP_S)
        assert value(now, "ttc") == expected["TTCStar"] == math.inf


@pytest.mark.parametrize("name", of_kind("bend_pm"))
def test_in_a_bend(name: str) -> None:
    expected, now = theirs(name), driven(name, NOW_S)

    assert math.isfinite(expected["TTCStar"])
    assert value(now, "ttc") == pytest.approx(expected["TTCStar"], abs=STEP_S)
    assert value(now, "wttc") == pytest.approx(expected["WTTC"], abs=ROUNDED)


def test_there_are_twenty_scenes_with_bends_and_crossings_at_every_angle() -> None:
    assert len(SCENES) >= 20
    assert len(of_kind("bend_pm")) == 4
    angles = {round(math.degrees(SCENES[name]["other"][2])) for name in of_kind("crossing")}
    assert angles >= {45, 60, 90, 135}


@pytest.mark.judge
@pytest.mark.timeout(1200)
def test_the_package_still_says_what_is_kept(tmp_path: Path) -> None:
    python = judges_python()
    asked = [python, "-c", "import commonroad_crime"]
    if subprocess.run(asked, capture_output=True, check=False).returncode != 0:
        pytest.skip("the judges' environment has no commonroad-crime")
    script, said = Path(__file__).with_name("freeze_crime.py"), tmp_path / "crime.json"
    run = subprocess.run(
        [python, script, said], capture_output=True, text=True, timeout=1100, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    found = json.loads(said.read_text())
    assert found["scenes"] == FROZEN["scenes"]
