"""Those who watch see whom the worst futures meet, and where."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import RoadUserTracks
from foretwin.contracts.simulation import FutureHit
from foretwin.orchestrator.record.result_rows import round_futures
from foretwin.orchestrator.rounds.views import VIEW_POINTS, place_of, round_view
from foretwin.orchestrator.runner.open_rounds import RoundDone
from foretwin.sim_worker.futures.likelihood import NEAR_MISS, NEAR_MISS_M
from foretwin.sim_worker.scenarios.exposure import EXPOSURES
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.futures_rounds import TIME_S, round_done, straight
from tests.orchestrator.trip import town_world

WORLD, CAR = town_world("n4"), load_vehicle()


def meeting(*users_xy: tuple[float, float]) -> RoundDone:
    """Three futures that drive east along y = 0, 1, 2; road users stand at the same places in
    each, and the last future touches the first of them after 4 s."""
    states = np.concatenate([straight((0.0, float(y))) for y in range(3)])
    done = round_done(
        states,
        scenario_id="scp",
        outcome={
            "collided": np.array([False, False, True]),
            "collision_with": np.array([0, 0, 1]),
            "collision_time_s": np.array([np.nan, np.nan, 4.0]),
            "min_clearance_m": np.array([20.0, 0.5, 0.0]),
        },
    )
    poses = np.zeros((3, len(TIME_S), len(users_xy), 3), dtype=np.float32)
    poses[..., :2] = np.asarray(users_xy).reshape(-1, 2)
    tracks = RoadUserTracks(
        poses=poses,
        speed_mps=poses[..., 0],
        size_m=np.ones((3, len(users_xy), 2), dtype=np.float32),
        kinds=np.zeros((3, len(users_xy))),
        kind_names=("car",),
    )
    result = msgspec.structs.replace(done.results[0], road_users=tracks)
    return RoundDone(order=done.order, results=(result,), latency_ms=100.0, seconds=0.1)


def test_the_nearest_road_user_of_critical_futures_is_shown_and_where_it_is_touched() -> None:
    done = meeting((40.0, 2.0), (30.0, 60.0))
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    # The first future keeps 20 m from everybody: nobody is shown for it.
    assert view.user_xy_m.shape == (2, 25, 2)
    assert view.user_xy_m[:, 0] == pytest.approx(np.array([[40.0, 2.0]] * 2), abs=1e-3)
    assert view.touch_xy_m == pytest.approx(np.array([[40.0, 2.0]]), abs=1e-3)
    assert view.touch_names == ("scp",)


@pytest.mark.parametrize(("time_s", "at_m"), [(4.0, 20.0), (0.0, 0.0), (9.0, 40.0)])
def test_who_moves_is_touched_where_it_is_then(time_s: float, at_m: float) -> None:
    """Both drive on: at 5 m/s to the north where the cars go east. After its end nobody moves."""
    done = meeting((40.0, 2.0), (30.0, 60.0))
    result = done.results[0]
    result.road_users.poses[..., 1] = 5.0 * TIME_S[:, None]
    result.outcome.collision_time_s[2] = time_s
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.touch_xy_m[0, 1] == pytest.approx(at_m, abs=1e-3)
    assert view.user_xy_m[0, -1, 1] == pytest.approx(40.0, abs=1e-3)


def test_the_nearest_is_so_in_both_directions_and_tracks_have_both_their_ends() -> None:
    done = meeting((40.0, 300.0), (400.0, 2.0), (40.0, 12.0), (2.0, 300.0))
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.touch_xy_m == pytest.approx(np.array([[40.0, 12.0]]), abs=1e-3)
    ends = [[[0.0, float(y)], [10.0 * TIME_S[-1], float(y)]] for y in range(3)]
    assert view.xy_m[:, [0, -1]] == pytest.approx(np.array(ends), abs=1e-3)


@pytest.mark.parametrize(("clearance_m", "shown"), [(1.9, 1), (2.1, 0)])
def test_whom_a_future_passes_far_away_is_not_shown(clearance_m: float, shown: int) -> None:
    done = meeting((40.0, 2.0))
    done.results[0].outcome.min_clearance_m[1] = clearance_m
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert len(view.user_xy_m) == 1 + shown


def test_without_road_users_there_is_nobody_to_show() -> None:
    done = meeting()
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.user_xy_m.shape == (0, 25, 2)
    assert view.touch_xy_m.shape == (0, 2)


def test_criticality_grows_as_the_clearance_shrinks_and_is_unknown_without_an_accident() -> None:
    done = meeting((40.0, 2.0))
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    safe, near, touching = view.criticality.tolist()
    assert safe == 0.0
    # Somebody who drives heedlessly across comes a few times a year (E2).
    assert view.likelihood == pytest.approx([EXPOSURES["E2"]] * 3)
    assert near == pytest.approx(EXPOSURES["E2"] * NEAR_MISS * (1.0 - 0.5 / NEAR_MISS_M))
    assert np.isnan(touching), "its accident was not computed"
    assert (view.collided, view.min_clearance_m, view.nominal_index) == (1, 0.0, 0)
    assert view.xy_m.shape == (3, VIEW_POINTS, 2)


def test_who_meets_nobody_has_no_clearance() -> None:
    states = straight((0.0, 0.0))
    done = round_done(states, outcome={"min_clearance_m": np.array([np.inf])})
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.min_clearance_m is None
    assert view.criticality.tolist() == [0.0]


def test_a_round_is_at_the_streets_that_meet_there() -> None:
    done = meeting((40.0, 2.0))
    assert done.order.junction_id == "n4"
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.place == WORLD.junctions[0].summary.name != ""
    assert place_of(done, msgspec.structs.replace(WORLD, junctions=())) == ""


def test_of_many_futures_the_sixteen_worst_show_whom_they_meet() -> None:
    count = 20
    states = np.concatenate([straight((0.0, float(y))) for y in range(count)])
    near_m = np.linspace(0.1, 1.5, count)[::-1]
    done = round_done(states, scenario_id="scp", outcome={"min_clearance_m": near_m})
    poses = np.zeros((count, len(TIME_S), 1, 3), dtype=np.float32)
    tracks = RoadUserTracks(
        poses=poses,
        speed_mps=poses[..., 0],
        size_m=np.ones((count, 1, 2), dtype=np.float32),
        kinds=np.zeros((count, 1)),
        kind_names=("bicycle",),
    )
    result = msgspec.structs.replace(done.results[0], road_users=tracks)
    done = RoundDone(order=done.order, results=(result,), latency_ms=100.0, seconds=0.1)
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert [one.future for one in view.met] == list(range(4, 20)), "the nearest are last"


def test_it_tells_who_is_met_when_and_what_is_hit() -> None:
    done = meeting((40.0, 2.0), (30.0, 60.0))
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.horizon_s == TIME_S[-1]
    assert view.hits == (FutureHit(future=2, time_s=4.0, what="car"),)
    assert [(one.future, one.kind, one.scenario_id) for one in view.met] == [
        (1, "car", "scp"),
        (2, "car", "scp"),
    ]
    near, hit = view.met
    assert near.time_s == pytest.approx(4.0, abs=0.11), "40 m at 10 m/s"
    assert hit.time_s == 4.0


def beside_a_lorry(lorry_xy: tuple[float, float]) -> RoundDone:
    """Somebody small stands where the cars pass, and a lorry 12 m long elsewhere."""
    done = meeting((20.0, 4.6), lorry_xy)
    users = done.results[0].road_users
    users.size_m[:, 1] = 12.0, 2.5
    users.kinds[:, 1] = 1
    result = msgspec.structs.replace(
        done.results[0],
        road_users=msgspec.structs.replace(users, kind_names=("pedestrian", "truck")),
    )
    return RoundDone(order=done.order, results=(result,), latency_ms=100.0, seconds=0.1)


def test_hit_is_who_is_run_into_not_whose_middle_came_nearest() -> None:
    done = beside_a_lorry((49.5, 2.0))
    done.results[0].trajectory.states[2, 40:, 0] = 40.0
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.hits == (FutureHit(future=2, time_s=4.0, what="truck"),)
    assert view.touch_xy_m == pytest.approx(np.array([[49.5, 2.0]]), abs=1e-3)
    assert view.met[-1].kind == "truck"


def test_met_is_whose_outline_comes_nearest() -> None:
    # Beside the second car: 1.2 m to who stands there, 0.7 m to the lorry's side.
    view_of = beside_a_lorry((50.0, 4.0))
    view = round_view(view_of, round_futures(view_of).futures, WORLD, CAR, WORLD.frame)
    assert (view.met[0].future, view.met[0].kind) == (1, "truck")


def test_whom_the_car_leaves_behind_is_met_at_the_first_instant() -> None:
    done = meeting((-5.0, 1.0))
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert [(one.future, one.time_s) for one in view.met] == [(1, 0.0), (2, 4.0)]


def test_who_is_near_as_a_wall_is_hit_is_met_and_not_touched() -> None:
    done = meeting((40.0, 2.0), (30.0, 60.0))
    done.results[0].outcome.collision_with[2] = 2
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.hits == (FutureHit(future=2, time_s=4.0, what="static"),)
    assert (view.touch_xy_m.shape, view.touch_names) == ((0, 2), ())
    assert [one.future for one in view.met] == [1, 2]


def test_a_wall_that_is_hit_is_told_where_nobody_is_about() -> None:
    done = meeting()
    done.results[0].outcome.collision_with[2] = 2
    view = round_view(done, round_futures(done).futures, WORLD, CAR, WORLD.frame)
    assert view.hits == (FutureHit(future=2, time_s=4.0, what="static"),)
    assert view.met == ()
