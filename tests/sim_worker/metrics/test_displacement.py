from __future__ import annotations

import json
import operator
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.sim_worker.metrics.displacement import (
    cheapest_walks,
    displacements,
    relative_pose_error,
)
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Context
from tests.sim_worker.metrics.motions import Mover, rollout, steady_poses, times

FROZEN = json.loads((Path(__file__).parents[2] / "data/metrics/evo.json").read_text())
seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("pair", FROZEN["pairs"])
def test_pose_errors_are_those_of_evo(pair: dict[str, list[float]]) -> None:
    estimate, reference = np.array(pair["estimate"]), np.array(pair["reference"])

    distance_m = displacements(estimate[None], reference).distance_m
    assert np.sqrt(np.square(distance_m).mean()) == pytest.approx(pair["ape_rmse_m"], abs=1e-9)
    assert relative_pose_error(estimate[None], reference) == pytest.approx(
        [pair["rpe_rmse_m"]], abs=1e-9
    )


def walks(seed: int, count: int, length: int) -> np.ndarray:
    steps = np.random.default_rng(seed).normal(0.0, 1.0, (count, length, 2))
    return np.cumsum(steps, axis=1)


@given(seeds, st.integers(2, 40), st.integers(2, 40))
def test_frechet_distance_of_drives_is_that_of_shapely(seed: int, length: int, other: int) -> None:
    curves = np.stack([drive(seed + k, length) for k in range(3)])
    reference = drive(seed + 9, other)

    expected = shapely.frechet_distance(shapely.linestrings(curves), shapely.linestrings(reference))

    assert cheapest_walks(curves, reference)[0] == pytest.approx(expected, abs=1e-9)


def drive(seed: int, length: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    speed = np.linspace(*random.uniform(3.0, 15.0, 2), length)
    yaw = random.uniform(-0.05, 0.05) * np.arange(length)
    step = 0.1 * speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return random.normal(0.0, 1.0, 2) + np.cumsum(step, axis=0)


@pytest.mark.parametrize(("which", "accumulate"), [(0, max), (1, operator.add)])
@settings(max_examples=40)
@given(seed=seeds, length=st.integers(1, 6), other=st.integers(1, 6))
def test_both_are_the_cheapest_of_all_monotonous_pairings(
    which: int, accumulate: Callable[[float, float], float], seed: int, length: int, other: int
) -> None:
    """GEOS 3.14 finds a longer Fréchet distance for some wild curves: hence the recursion."""
    curve, reference = walks(seed, 1, length)[0], walks(seed + 1, 1, other)[0]

    def cheapest(i: int, j: int) -> float:
        here = float(np.hypot(*(curve[i] - reference[j])))
        before = [(i - 1, j), (i, j - 1), (i - 1, j - 1)]
        ways = [cheapest(a, b) for a, b in before if a >= 0 and b >= 0]
        return accumulate(here, min(ways)) if ways else here

    expected = cheapest(length - 1, other - 1)

    assert cheapest_walks(curve[None], reference)[which] == pytest.approx([expected], abs=1e-9)


def test_a_future_that_is_ahead_and_to_the_left_is_told_so() -> None:
    time_s = times()
    driven = rollout(Mover(2.0, 0.0, np.pi / 2, 9.0), time_s=time_s, futures=2)
    reference = driven.states[0, :, :3] + (1.5, -0.5 * time_s[-1], 0.1)
    reference[:, 1] = driven.states[0, :, 1] - 0.5 * time_s

    found = evaluate(
        driven,
        ("ade", "fde", "lateral", "longitudinal", "heading"),
        context=Context(reference=reference),
    )

    shown = {name: measure.values[0] for name, measure in found.items()}
    cos, sin = np.cos(np.pi / 2 + 0.1), np.sin(np.pi / 2 + 0.1)
    away = np.array([-1.5, 4.0])
    assert shown["fde"] == pytest.approx(np.hypot(1.5, 4.0))
    assert shown["ade"] == pytest.approx(np.hypot(1.5, 0.5 * time_s[1:]).mean())
    assert shown["longitudinal"] == pytest.approx(away @ (cos, sin))
    assert shown["lateral"] == pytest.approx(away @ (-sin, cos))
    assert shown["heading"] == pytest.approx(-0.1)


def test_only_instants_at_which_the_reference_is_known_count() -> None:
    time_s = times()
    driven = rollout(Mover(0.0, 0.0, 0.0, 10.0), time_s=time_s)
    reference = driven.states[0, :, :3].copy()
    reference[:, 1] += 0.1 * time_s
    reference[41:] = np.nan
    names = ("ade", "fde", "ape", "rpe", "frechet", "dtw")

    known = evaluate(driven, names, context=Context(reference=reference))
    unknown = evaluate(driven, names, context=Context(reference=np.full_like(reference, np.nan)))

    assert known["fde"].values == pytest.approx(0.4)
    assert known["ade"].values == pytest.approx(0.1 * time_s[1:41].mean())
    assert known["rpe"].values == pytest.approx(0.01)
    assert all(measure.valid.all() for measure in known.values())
    assert not any(measure.valid.any() for measure in unknown.values())
    assert all(np.isnan(measure.values).all() for measure in unknown.values())


@given(seeds)
def test_components_add_up_to_the_distance(seed: int) -> None:
    random = np.random.default_rng(seed)
    predicted, reference = random.normal(0, 9, (4, 6, 3)), random.normal(0, 9, (6, 3))

    found = displacements(predicted, reference)

    assert np.hypot(found.lateral_m, found.longitudinal_m) == pytest.approx(found.distance_m)
    assert (np.abs(found.heading_rad) <= np.pi).all()


def test_a_reference_of_another_length_is_refused() -> None:
    driven = rollout(Mover(0.0, 0.0, 0.0, 10.0))
    with pytest.raises(ValueError, match=r"reference: \(3, 3\), expected \(81, 3\)"):
        evaluate(driven, ("ade",), context=Context(reference=np.zeros((3, 3))))


def test_steady_poses_start_where_they_are_told() -> None:
    assert steady_poses(Mover(1.0, 2.0, 0.3, 5.0), times())[0] == pytest.approx([1.0, 2.0, 0.3])
