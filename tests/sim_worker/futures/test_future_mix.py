from __future__ import annotations

import pytest

from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.scenarios.reading import catalogue


def test_the_first_variant_is_neutral() -> None:
    nominal = plan_futures(count=64, seed=3, planners=["pure_pursuit_idm"])[0]
    assert (nominal.index, nominal.name, nominal.scenario_id) == (0, "nominal", "")
    assert nominal.numbers == {}


def test_variants_depend_on_count_seed_and_planners_alone() -> None:
    first = plan_futures(count=64, seed=3, planners=["a", "b"])
    assert first == plan_futures(count=64, seed=3, planners=["a", "b"])
    assert first != plan_futures(count=64, seed=4, planners=["a", "b"])
    assert first[0].planner == "a"
    assert {future.planner for future in first} == {"a", "b"}


@pytest.mark.parametrize("seed", range(5))
def test_variants_cover_their_ranges_with_a_target_speed_each(seed: int) -> None:
    futures = plan_futures(count=64, seed=seed, planners=["a"])[1:]
    assert len({v.numbers["target_speed_factor"] for v in futures}) == 63
    assert len({v.name for v in futures}) == 63
    friction, delay, shift = (
        [v.numbers[name] for v in futures if name in v.numbers]
        for name in ("friction_factor", "extra_steering_delay_s", "lateral_shift_m")
    )
    assert 0.3 <= min(friction) < 0.45
    assert 0.85 < max(friction) <= 1.0
    assert min(delay) >= 0.0
    assert 0.3 < max(delay) <= 0.4
    assert min(shift) < -0.4
    assert max(shift) > 0.4


def test_one_thing_is_wrong_with_a_car_or_everything() -> None:
    faults = ("friction_factor", "extra_steering_delay_s", "lateral_shift_m")
    futures = plan_futures(count=6, seed=0, planners=["a"])
    found = {tuple(name for name in faults if name in v.numbers) for v in futures[1:]}
    assert found == {(), faults, *((name,) for name in faults)}


def test_small_counts_and_wrong_ones() -> None:
    assert len(plan_futures(count=1, seed=0, planners=["a"])) == 1
    assert len(plan_futures(count=2, seed=0, planners=["a"])) == 2
    with pytest.raises(ValueError, match="at least 1"):
        plan_futures(count=0, seed=0, planners=["a"])
    with pytest.raises(ValueError, match="no planner"):
        plan_futures(count=4, seed=0, planners=[])


def test_scenarios_happen_in_every_second_future_in_turn() -> None:
    scenarios = [catalogue()[name] for name in ("scp", "cpta", "lead_stopping")]
    futures = plan_futures(count=64, seed=1, planners=["a"], scenarios=scenarios)
    happens = [v.scenario_id for v in futures]
    assert not any(happens[::2])
    assert all(happens[1::2])
    assert {happens.count(s.id) for s in scenarios} <= {10, 11}
    late = [v.values["crossing_car.arrives_after_s"] for v in futures if v.scenario_id == "scp"]
    assert min(late) < -0.5
    assert max(late) > 0.5
    assert len({v.name for v in futures}) == 64


def test_no_name_has_a_nought_with_a_sign_of_its_own() -> None:
    names = (v.name for seed in range(40) for v in plan_futures(count=64, seed=seed, planners="a"))
    assert not any("-0.00" in name for name in names)
