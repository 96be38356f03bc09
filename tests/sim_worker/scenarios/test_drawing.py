"""Cases: every combination of listed values, ranges filled evenly, the same from the same seed."""

from __future__ import annotations

import collections
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from foretwin.contracts.scenario import ActorPart, Distribution, EgoPart, Scenario
from foretwin.sim_worker.scenarios.drawing import case_count, draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue


def scenario(
    ego: Distribution | float = 5.0, other: Distribution | float = 8.0, **more: int
) -> Scenario:
    actors = (ActorPart(name="other", relation="oncoming", speed_mps=other),)
    return Scenario(
        id="x", title="x", shows="x.", source="x", ego=EgoPart(speed_mps=ego), actors=actors, **more
    )  # type: ignore[arg-type]


def test_listed_values_are_combined_fully() -> None:
    cases = draw_cases(catalogue()["ccftap"])
    pairs = [(c["ego.speed_mps"], c["oncoming_car.speed_mps"]) for c in cases]
    assert len(pairs) == len(set(pairs)) == 9
    assert set(pairs) == set(itertools.product({p[0] for p in pairs}, {p[1] for p in pairs}))


def test_every_number_of_a_case_has_a_name() -> None:
    case = draw_cases(scenario())[0]
    assert case["ego.speed_mps"] == 5.0
    assert case["other.gap_m"] == 20.0
    assert case["faults.friction_factor"] == 1.0
    assert all(type(value) is float for value in case.values())


def test_samples_are_drawn_for_each_combination() -> None:
    cases = draw_cases(
        scenario(Distribution(values=(1.0, 2.0, 3.0)), Distribution(min=4.0, max=6.0), samples=5)
    )
    counted = collections.Counter(case["ego.speed_mps"] for case in cases)
    assert counted == {1.0: 5, 2.0: 5, 3.0: 5}
    assert len({case["other.speed_mps"] for case in cases}) == 15


@given(seed=st.integers(0, 2**31), other=st.integers(0, 2**31))
def test_the_seed_alone_decides(seed: int, other: int) -> None:
    drawn = draw_cases(catalogue()["scp"], seed=seed)
    assert drawn == draw_cases(catalogue()["scp"], seed=seed)
    if other != seed:
        assert drawn != draw_cases(catalogue()["scp"], seed=other)


@given(seed=st.integers(0, 2**31), low=st.floats(0.0, 10.0), width=st.floats(0.1, 10.0))
def test_ranges_are_filled_evenly(seed: int, low: float, width: float) -> None:
    """Each 16th of the range holds exactly one of 16 draws, as Sobol's sequence promises."""
    cases = draw_cases(
        scenario(other=Distribution(min=low, max=low + width), samples=16), seed=seed
    )
    shares = (np.array([case["other.speed_mps"] for case in cases]) - low) / width
    assert sorted(np.clip(shares * 16.0, 0.0, 15.999).astype(int).tolist()) == list(range(16))


def test_normal_numbers_have_their_mean_and_stay_within_bounds() -> None:
    span = Distribution(mean=10.0, std=2.0, min=7.0, max=13.0)
    drawn = np.array(
        [case["other.speed_mps"] for case in draw_cases(scenario(other=span, samples=512))]
    )
    assert drawn.min() >= 7.0
    assert drawn.max() <= 13.0
    assert drawn.mean() == pytest.approx(10.0, abs=0.05)
    # Of a normal distribution cut at 1.5 standard deviations: 2 · √(1 - 3 φ(1.5) / (2 Φ(1.5) - 1)).
    assert drawn.std() == pytest.approx(2.0 * 0.7423, abs=0.05)


@pytest.mark.parametrize(("listed", "samples"), [(1, 9000), (3, 2000), (2, 1), (1, 4096)])
def test_cases_are_drawn_in_pieces_as_the_sequence_has_them_at_once(
    listed: int, samples: int
) -> None:
    one = scenario(
        ego=Distribution(values=tuple(5.0 + n for n in range(listed))),
        other=Distribution(min=3.0, max=9.0, mean=5.0, std=1.0),
        samples=samples,
    )
    count = case_count(one)
    assert count == listed * samples
    sobol = qmc.Sobol(d=1, scramble=True, rng=np.random.default_rng(3))
    even = sobol.random_base2(max(0, (count - 1).bit_length()))[:count, 0]
    low, high = ndtr(-2.0), ndtr(4.0)
    expected = np.clip(5.0 + ndtri(np.clip(low + (high - low) * even, 1e-12, 1 - 1e-12)), 3.0, 9.0)
    drawn = [(case["ego.speed_mps"], case["other.speed_mps"]) for case in draw_cases(one, seed=3)]
    assert [speed for _, speed in drawn] == expected.tolist()
    assert [speed for speed, _ in drawn] == [5.0 + n // samples for n in range(count)]
