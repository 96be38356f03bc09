from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Context, Rollout
from tests.sim_worker.metrics.motions import LENGTH_M, VEHICLE, WIDTH_M, Mover, rollout, times

HALF_M = LENGTH_M / 2
MASS_KG = VEHICLE.mass_kg.value


def values(driven: Rollout, mass_kg: float = MASS_KG) -> dict[str, float]:
    names = (
        "collided",
        "at_fault_collision",
        "collision_time",
        "impact_speed",
        "closing_speed",
        "delta_v",
        "min_clearance",
    )
    masses = np.full(driven.user_size_m.shape[:2], mass_kg)
    found = evaluate(driven, names, context=Context(user_mass_kg=masses))
    return {name: float(measure.values[0]) for name, measure in found.items()}


def test_driving_into_a_parked_car() -> None:
    found = values(rollout(Mover(0, 0, 0, 10), Mover(30, 0.5, 0, 0)))

    assert found["collided"] == found["at_fault_collision"] == 1.0
    assert found["collision_time"] == pytest.approx((30 - HALF_M - 2) / 10)
    assert found["impact_speed"] == found["closing_speed"] == pytest.approx(10.0)
    assert found["delta_v"] == pytest.approx(5.0)
    assert found["min_clearance"] == 0.0


def test_being_hit_from_behind_is_no_fault() -> None:
    found = values(rollout(Mover(0, 0, 0, 5), Mover(-30, 0, 0, 15)), mass_kg=3 * MASS_KG)

    assert found["collided"] == 1.0
    assert found["at_fault_collision"] == 0.0
    assert found["closing_speed"] == pytest.approx(10.0)
    assert found["delta_v"] == pytest.approx(7.5)


def test_being_hit_while_standing_is_no_fault() -> None:
    found = values(rollout(Mover(0, 0), Mover(0, -30, math.pi / 2, 10)))

    assert found["collided"] == 1.0
    assert found["at_fault_collision"] == 0.0
    assert found["impact_speed"] == 0.0


def test_who_backs_is_at_fault_for_whom_its_rear_hits_and_not_for_who_hits_its_front() -> None:
    """It backs at 2 m/s into somebody who walks behind it; one of 8 m/s drives into its front."""
    walks = Mover(-HALF_M - 4.25, -2.0, math.pi / 2, 1.0, 0.5, 0.5)
    into = values(rollout(Mover(0, 0, 0, -2), walks))
    caught = values(rollout(Mover(0, 0, 0, -2), Mover(20, 0, math.pi, 8)))

    assert into["collision_time"] == pytest.approx(2.0, abs=0.01)
    assert into["collided"] == into["at_fault_collision"] == 1.0
    assert caught["collided"] == 1.0
    assert caught["at_fault_collision"] == 0.0


def test_head_on_speeds_add_and_across_they_do_so_at_right_angles() -> None:
    head_on = values(rollout(Mover(0, 0, 0, 10), Mover(50, 0, math.pi, 8)))
    across = values(rollout(Mover(-20, 0, 0, 8), Mover(0, -15, math.pi / 2, 6)))

    assert head_on["closing_speed"] == pytest.approx(18.0)
    assert head_on["delta_v"] == pytest.approx(9.0)
    assert across["closing_speed"] == pytest.approx(10.0)


def test_a_touch_between_two_instants_is_found() -> None:
    time_s = times(2.0, 0.5)
    crossing = Mover(0.0, -25.0, math.pi / 2, 40.0, 2.0, 1.0)
    found = values(rollout(Mover(0, 0), crossing, time_s=time_s))

    # At 0.5 s it is 5 m before the ego's middle, at 1.0 s 15 m behind it.
    assert found["collision_time"] == pytest.approx((25 - WIDTH_M / 2 - 1.0) / 40.0)


def test_nothing_hit_leaves_the_impact_invalid() -> None:
    driven = rollout(Mover(0, 0, 0, 10), Mover(0, 10, 0, 10))
    found = values(driven)

    assert found["collided"] == 0.0
    assert found["min_clearance"] == pytest.approx(10 - (WIDTH_M + 2) / 2)
    assert all(math.isnan(found[n]) for n in ("collision_time", "impact_speed", "delta_v"))
    measure = evaluate(driven, ("impact_speed",))["impact_speed"]
    assert not measure.valid.any()


def test_without_anybody_everything_is_clear() -> None:
    found = evaluate(rollout(Mover(0, 0, 0, 10)))

    assert found["ttc"].values == found["pet"].values == found["thw"].values == math.inf
    assert found["min_clearance"].values == math.inf
    assert found["collided"].values == found["drac"].values == 0.0


def test_who_is_absent_is_not_hit() -> None:
    driven = rollout(Mover(0, 0, 0, 10), Mover(30, 0, 0, 0))
    driven.users[0, 15:, 0] = np.nan
    driven.user_speed_mps[0, 15:, 0] = np.nan

    assert values(driven)["collided"] == 0.0


def test_an_invalid_future_has_no_values_and_spoils_no_other() -> None:
    driven = rollout(Mover(0, 0, 0, 10), Mover(30, 0.5, 0, 0), futures=3)
    alone = evaluate(driven)
    driven.states[1, 20:] = np.nan
    driven.valid[2] = False

    found = evaluate(driven)

    for name, measure in found.items():
        assert not measure.valid[1:].any()
        assert np.isnan(measure.values[1:]).all()
        np.testing.assert_array_equal(measure.values[0], alone[name].values[0], err_msg=name)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_least_clearance_is_that_of_all_pairs_at_all_times(seed: int) -> None:
    random = np.random.default_rng(seed)
    movers = [
        Mover(*random.uniform(-40, 40, 2), random.uniform(-3, 3), random.uniform(0, 20))
        for _ in range(4)
    ]
    found = values(rollout(Mover(0, 0, 0.4, 3), *movers, time_s=times(3.0)))
    fine = rollout(Mover(0, 0, 0.4, 3), *movers, time_s=times(3.0, 0.002))
    ahead = LENGTH_M / 2 - VEHICLE.rear_overhang_m.value
    state = fine.states[0]
    centre = state[:, :2] + ahead * np.column_stack([np.cos(state[:, 2]), np.sin(state[:, 2])])
    apart = clearance(
        Rectangles(centre[:, None], state[:, None, 2], LENGTH_M, WIDTH_M),
        Rectangles(fine.users[0, ..., :2], fine.users[0, ..., 2], 4.0, 2.0),
    ).min()

    if found["collided"]:
        assert found["min_clearance"] == 0.0
    else:
        assert found["min_clearance"] == pytest.approx(apart, abs=0.025)
        assert 0.0 < found["min_clearance"] <= apart + 1e-9


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
@pytest.mark.parametrize(("speed", "length", "width"), [(14.0, 4.5, 1.8), (1.4, 0.5, 0.5)])
def test_who_passes_between_two_instants_is_as_near_as_it_comes(
    phase: float, speed: float, length: float, width: float
) -> None:
    """A car of 14 m/s whose corner passes that of somebody who crosses, 0.4 m behind it."""
    ego = Mover(-20 - phase * 1.4, 0, 0, 14)
    ready_s = (20 + phase * 1.4 + LENGTH_M / 2 + width / 2) / 14
    # Its front reaches the side of the car's strip 0.4 m after the rear has left its own.
    late_m = 0.4 * math.hypot(14, speed) / 14
    other = Mover(
        0, -WIDTH_M / 2 - length / 2 - late_m - speed * ready_s, math.pi / 2, speed, length, width
    )

    assert values(rollout(ego, other))["min_clearance"] == pytest.approx(0.4, abs=1e-6)


def test_who_turns_while_it_passes_is_measured_as_it_is_turned_then() -> None:
    """A car comes nearer as it straightens: turned as before, its corner comes 0.2 m nearer."""
    driven = rollout(Mover(0, 0), Mover(0.0, 5.0, 0.3), time_s=times(0.1))
    driven.users[0, 1, 0, 1:] = 4.8, 0.0

    corner_m = 5.0 - 2.0 * math.sin(0.3) - math.cos(0.3)
    assert values(driven)["min_clearance"] == pytest.approx(corner_m - WIDTH_M / 2)


def test_shapes_that_do_not_fit_are_named() -> None:
    driven = rollout(Mover(0, 0), Mover(9, 0))
    with pytest.raises(ValueError, match=r"user_speed_mps has shape \(1, 3, 1\), expected"):
        evaluate(driven._replace(user_speed_mps=np.zeros((1, 3, 1))))


def test_unknown_names_and_missing_needs_are_named() -> None:
    driven = rollout(Mover(0, 0))
    with pytest.raises(ValueError, match="unknown metric speediness; known: ade, fde"):
        evaluate(driven, ("ttc", "speediness"))
    with pytest.raises(ValueError, match="metric driving_score needs path, ground"):
        evaluate(driven, ("driving_score",))
