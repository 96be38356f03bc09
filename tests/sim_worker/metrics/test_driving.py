"""Comfort, progress, drivable ground, rules of the road, and the score."""

from __future__ import annotations

import math
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
import shapely
from scipy.signal import savgol_filter

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.world import Area
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics import comfort
from foretwin.sim_worker.metrics.evaluation import COMPUTED, computable, evaluate
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.rollout import Context, Rollout
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.sim_worker.metrics.table import METRICS
from foretwin.world_gen.extent import extent_of
from foretwin.world_gen.rules.signal_state import HeardCycle
from tests.sim_worker.metrics.junction import AMBER_S, GREEN_S, STOP_X, context, junction
from tests.sim_worker.metrics.motions import LENGTH_M, Mover, rollout, times
from tests.sim_worker.places import box, crossroads, turning_path

COVERS = (
    "foretwin.sim_worker.metrics.comfort",
    "foretwin.sim_worker.metrics.evaluation",
    "foretwin.sim_worker.metrics.ground",
    "foretwin.sim_worker.metrics.progress",
    "foretwin.sim_worker.metrics.score",
    "foretwin.sim_worker.metrics.table",
)

HALF_M = LENGTH_M / 2
GREEN_RED: tuple[SignalColour, ...] = ("green", "red")


def value(driven: Rollout, name: str, given: Context | None = None) -> float:
    return float(evaluate(driven, (name,), context=given)[name].values[0])


def braking(decel: float) -> np.ndarray:
    time_s = times()
    x = 20.0 * time_s - decel * time_s**2 / 2
    return np.column_stack([x, 0 * x, 0 * x])


@pytest.mark.parametrize("count", [3, 9, 16, 80])
@pytest.mark.parametrize(("window_s", "derivative"), [(0.8, 1), (1.4, 1), (1.4, 2)])
def test_motion_is_smoothed_as_scipy_does(count: int, window_s: float, derivative: int) -> None:
    operator = comfort._operator(count, 0.1, window_s, derivative)
    window = min(2 * round(window_s / 0.2) + 1, count - (count + 1) % 2)
    expected = savgol_filter(np.eye(count), window, 2, deriv=derivative, delta=0.1, axis=1)
    assert operator == pytest.approx(expected, abs=1e-10)


def test_braking_hard_is_uncomfortable_and_gently_is_not() -> None:
    gentle, hard = rollout(braking(2.0)), rollout(braking(4.3))

    assert value(gentle, "max_deceleration") == pytest.approx(2.0, abs=0.05)
    assert value(gentle, "comfortable") == 1.0
    assert value(hard, "max_deceleration") == pytest.approx(4.3, abs=0.1)
    assert value(hard, "comfortable") == 0.0


def test_a_bend_gives_lateral_acceleration_and_yaw_rate() -> None:
    time_s, radius, speed = times(), 20.0, 8.0
    angle = speed / radius * time_s
    driven = rollout(Mover(0, 0, 0, speed))
    driven.states[0, :, :3] = np.column_stack(
        [
            radius * np.sin(angle),
            radius * (1 - np.cos(angle)),
            (angle + np.pi) % (2 * np.pi) - np.pi,
        ]
    )
    driven.states[0, :, 3:6] = (speed, 0.0, speed / radius)

    assert value(driven, "max_lateral_acceleration") == pytest.approx(speed**2 / radius)
    assert value(driven, "max_yaw_rate") == pytest.approx(speed / radius)
    assert value(driven, "max_yaw_acceleration") == pytest.approx(0.0, abs=1e-6)
    assert value(driven, "max_jerk") == pytest.approx(0.0, abs=1e-6)


def test_jerk_is_the_rate_of_the_acceleration() -> None:
    time_s = times()
    driven = rollout(Mover(0, 0, 0, 5.0))
    driven.states[0, :, 3] = 5.0 + 0.5 * 0.8 * time_s**2

    assert value(driven, "max_longitudinal_jerk") == pytest.approx(0.8, abs=1e-6)


def test_progress_counts_along_the_path_and_backwards_is_told() -> None:
    path = FrenetPath(turning_path().xy_m)
    along = path.pose_at(np.linspace(20.0, 90.0, 81))
    poses = np.column_stack([along.xy_m, along.yaw_rad])
    driven = rollout(Mover(0, 0), futures=2)
    driven.states[0, :, :3] = poses
    driven.states[1, :, :3] = poses[::-1]

    found = evaluate(driven, ("progress", "backwards"), context=Context(path=path))

    assert found["progress"].values == pytest.approx([70.0, -70.0], abs=0.1)
    assert found["backwards"].values == pytest.approx([0.0, 70.0], abs=0.1)


def test_ground_beyond_the_tolerance_and_islands_are_not_driven_on() -> None:
    island = Area(id="refuge", outline=box(40.0, 0.0, 3.0, 1.0).outline)
    ground = DrivableGround(msgspec.structs.replace(crossroads(), islands=(island,)))
    x = np.array([0.0, 60.0, 60.0, 60.0, 30.0, 40.0, 40.0, 1e6])
    y = np.array([0.0, 3.9, 4.29, 4.31, 30.0, 0.0, 0.8, 0.0])

    expected = [True, True, True, False, False, False, True, False]

    assert ground.contains(x, y).tolist() == expected
    assert ground.contains(x, y).tolist() == expected
    assert ground.contains(x[::-1], y[::-1]).tolist() == expected[::-1]


def test_beyond_the_worlds_edge_nobody_is_off_the_road() -> None:
    """Streets and World end 150 m out; at 10 m/s the car is beyond after 1, 4 or 0 s of 8 s."""
    given = context()
    leaves, astray, beyond = (
        rollout(Mover(*at, 0, 10.0)) for at in ((140, 0), (110, 9), (200, -3))
    )

    assert value(leaves, "off_road_share", given) == 0.0
    assert value(leaves, "on_road", given) == 1.0
    assert value(astray, "off_road_share", given) == 1.0
    assert value(astray, "on_road", given) == 0.0
    assert math.isnan(value(beyond, "off_road_share", given))
    assert math.isnan(value(beyond, "on_road", given))
    for name in ("driving_score", "epdms"):
        assert value(astray, name, given) == 0.0
        assert value(beyond, name, given) > 0.5


def test_a_world_in_a_rectangle_is_known_within_it() -> None:
    world = msgspec.structs.replace(crossroads(), bounds_m=(-20.0, -9.0, 30.0, 9.0))
    xy = np.array([[-21.0, 0.0], [29.0, 0.0], [31.0, 0.0], [0.0, -9.5], [0.0, 9.5]])

    assert extent_of(world).holds(xy).tolist() == [False, True, False, False, False]


def test_look_up_says_what_the_polygon_says() -> None:
    ground = DrivableGround(crossroads())
    random = np.random.default_rng(0)
    x, y = random.uniform(-160, 160, (2, 4000))
    exact = shapely.intersects_xy(ground.surface, x, y).tolist()

    assert ground.contains(x, y).tolist() == exact


def test_leaving_the_road_is_told_by_its_share() -> None:
    given = context()
    stays = rollout(Mover(-50, -1.5, 0, 8))
    leaves = rollout(Mover(-50, -1.5, -0.1, 8))

    assert value(stays, "off_road_share", given) == 0.0
    assert value(stays, "on_road", given) == 1.0
    assert 0.3 < value(leaves, "off_road_share", given) < 1.0
    assert value(leaves, "on_road", given) == 0.0


def crossing_at(time_s: float) -> Mover:
    """An ego whose front is at the stop line at `time_s`."""
    return Mover(STOP_X - HALF_M - 10.0 * time_s, -1.5, 0.0, 10.0)


@pytest.mark.parametrize(
    ("start_s", "violations"),
    [(0.0, 0), (GREEN_S - 2.1, 0), (GREEN_S + AMBER_S - 2.1, 0), (GREEN_S + AMBER_S - 1.9, 1)],
)
def test_crossing_the_line_at_red_is_a_violation(start_s: float, violations: int) -> None:
    given = context(lights=True, start_s=start_s)

    assert value(rollout(crossing_at(2.0)), "red_light_violations", given) == violations


def test_red_lets_go_who_has_stopped_before_a_turn_that_may() -> None:
    red_s = GREEN_S + AMBER_S
    plain = context(lights=True, start_s=red_s)
    allowed = junction(lights=True, red_after_stop=True)
    assert plain.path is not None
    given = plain._replace(rules=RouteRules(allowed, plain.path))
    time_s = times()
    rolls_m = np.maximum(0.0, 4.0 * (time_s - 3.0))

    def driven(short_of_line_m: float) -> Rollout:
        """An ego that stands for 3 s and then drives over the line."""
        poses = np.zeros((len(time_s), 3))
        poses[:, 0] = STOP_X - HALF_M - short_of_line_m + rolls_m
        poses[:, 1] = -1.5
        return rollout(poses)

    assert value(driven(1.0), "red_light_violations", given) == 0
    assert value(driven(1.0), "red_light_violations", plain) == 1
    assert value(driven(9.0), "red_light_violations", given) == 1  # it stood behind another car
    assert value(rollout(crossing_at(0.5)), "red_light_violations", given) == 1
    assert value(rollout(crossing_at(60.0)), "red_light_violations", given) == 0


def test_a_learnt_cycle_goes_before_the_plan() -> None:
    given = context(lights=True)
    red_at_two = HeardCycle(begins_s=-50.0, cycle_s=100.0, from_s=(0.0, 51.0), colours=GREEN_RED)

    assert value(rollout(crossing_at(2.0)), "red_light_violations", given) == 0
    given = given._replace(learnt={"ew": red_at_two})
    assert value(rollout(crossing_at(2.0)), "red_light_violations", given) == 1
    assert value(rollout(crossing_at(0.8)), "red_light_violations", given) == 0


def test_stopping_before_the_line_or_turning_off_elsewhere_is_none() -> None:
    given = context(lights=True, start_s=GREEN_S + AMBER_S)
    stops = rollout(Mover(STOP_X - HALF_M - 0.2, -1.5))
    other_way = rollout(Mover(40.0, 1.5, math.pi, 10.0))

    assert value(stops, "red_light_violations", given) == 0.0
    assert value(other_way, "red_light_violations", given) == 0.0


def test_a_path_takes_the_connection_it_runs_along() -> None:
    rules = context().rules
    assert rules is not None
    assert rules.connections == ("east",)
    assert [line.line_id for line in rules.lines] == ["stop"]
    assert [c.other_id for c in rules.conflicts] == ["north", "south"]


def test_nothing_after_the_end_of_a_future_counts() -> None:
    """At 4 s the ego is at 8 m/s on its lane; half a second later it leaves the road and brakes."""
    time_s = times()
    late = time_s > 4.5
    driven = rollout(Mover(-50, -1.5, 0, 8), Mover(-10.0, -6.0), futures=2)
    driven.states[:, late, 1] -= 2.0 * (time_s[late] - 4.5)
    driven.states[:, late, 3] -= np.minimum(6.0 * (time_s[late] - 4.5), 8.0)
    ended = driven._replace(last=np.array([40, len(time_s) - 1]))
    names = ("progress", "off_road_share", "max_deceleration", "comfortable", "min_clearance")

    found = {
        name: measure.values for name, measure in evaluate(ended, names, context=context()).items()
    }

    assert found["progress"] == pytest.approx([32.0, 64.0], abs=0.1)
    assert found["off_road_share"][0] == 0.0 < found["off_road_share"][1]
    assert found["max_deceleration"] == pytest.approx([0.0, 6.0], abs=0.9)
    assert found["comfortable"].tolist() == [1.0, 0.0]
    assert found["min_clearance"][0] > found["min_clearance"][1] + 3.0


def test_the_score_weighs_progress_and_is_closed_by_a_collision() -> None:
    given = context()
    fast, slow = rollout(Mover(-50, -1.5, 0, 10)), rollout(Mover(-50, -1.5, 0, 5))
    crashes = rollout(Mover(-50, -1.5, 0, 10), Mover(0, -1.5))
    together = fast._replace(
        states=np.concatenate([fast.states, slow.states]),
        users=np.zeros((2, 81, 0, 3)),
        user_speed_mps=np.zeros((2, 81, 0)),
        user_size_m=np.zeros((2, 0, 2)),
        valid=np.ones(2, dtype=bool),
    )

    score = evaluate(together, ("driving_score",), context=given)["driving_score"].values

    assert score == pytest.approx([1.0, (5 + 2.5 + 2) / 12], abs=1e-3)
    assert value(crashes, "driving_score", given) == 0.0


def test_the_table_says_what_is_computable() -> None:
    assert {"ttc", "ade"} & set(computable(Context())) == {"ttc"}
    given = context()._replace(reference=np.zeros((81, 3)), user_mass_kg=np.zeros((1, 0)))
    assert computable(given) == tuple(COMPUTED) == tuple(METRICS)
    driven = rollout(Mover(-50, -1.5, 0, 8), futures=1)
    for name, measure in evaluate(driven, context=given).items():
        shape = (1, 81) if METRICS[name].series else (1,)
        assert measure.values.shape == measure.valid.shape == shape, name


def test_the_documentation_names_every_metric_in_its_order_with_its_unit() -> None:
    text = (Path(__file__).parents[3] / "docs" / "metrics.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| `")]
    told = [(name, unit) for names, unit in rows[1:] for name in re.findall(r"`(\w+)`", names)]
    assert sorted(name for name, _ in told) == sorted(METRICS)
    for name, unit in told:
        assert METRICS[name].unit in unit.strip().split(", "), name
