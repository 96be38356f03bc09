"""The environments keep Gymnasium's rules, and a row of many is one alone, to the bit."""

from __future__ import annotations

import functools
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.gym import ID, JunctionEnv, JunctionVectorEnv
from foretwin.sim_worker.gym.rows import StepFacts
from tests.sim_worker.scenarios.worlds import cross, ring

COVERS = (
    "foretwin.sim_worker.gym",
    "foretwin.sim_worker.gym.env",
    "foretwin.sim_worker.gym.picture",
    "foretwin.sim_worker.gym.rows",
    "foretwin.sim_worker.gym.spaces",
    "foretwin.sim_worker.gym.vector_env",
)

ROWS = 5


@functools.cache
def roundabout(**settings: Any) -> JunctionEnv:
    return JunctionEnv(ring(), cases=8, horizon_s=9.0, **settings)


@functools.cache
def to_refuse() -> JunctionEnv:
    return JunctionEnv(ring(), cases=4)


def vector(**settings: Any) -> JunctionVectorEnv:
    return JunctionVectorEnv(ROWS, ring(), cases=8, horizon_s=9.0, **settings)


def actions(steps: int, size: int = 2) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Unsteady driving, the same each time."""
    wild = np.random.default_rng(5).uniform(-0.3, 0.4, (steps, ROWS, size))
    wild[..., 1:] *= 0.3
    return wild.astype(np.float32)


def digest(env: JunctionEnv, seed: int) -> bytes:
    seen, _ = env.reset(seed=seed)
    parts = [seen.tobytes()]
    for action in actions(60)[:, 0]:
        seen, reward, terminated, truncated, _ = env.step(action)
        parts.append(seen.tobytes() + np.array(reward).tobytes())
        if terminated or truncated:
            seen, _ = env.reset()
            parts.append(seen.tobytes())
    return b"".join(parts)


@pytest.mark.parametrize("control", ["free", "along_path"])
def test_gymnasiums_own_checker_passes(control: str) -> None:
    env = gymnasium.make(ID, world=ring(), cases=8, control=control, render_mode="rgb_array")

    # Its warnings are errors here.
    check_env(env.unwrapped)


def test_the_same_seed_and_actions_give_the_same_bits() -> None:
    env = roundabout()

    assert (
        digest(env, 3) == digest(env, 3) == digest(JunctionEnv(ring(), cases=8, horizon_s=9.0), 3)
    )
    assert digest(env, 3) != digest(env, 4)


@pytest.mark.parametrize(
    ("mode", "scenario"),
    [
        (AutoresetMode.NEXT_STEP, "roundabout_entry"),
        (AutoresetMode.SAME_STEP, "roundabout_entry"),
        (AutoresetMode.DISABLED, "red_light"),
        (AutoresetMode.SAME_STEP, "latency"),
    ],
)
def test_a_row_of_the_vector_is_an_environment_alone(mode: AutoresetMode, scenario: str) -> None:
    world = ring() if scenario == "roundabout_entry" else cross(signals=scenario == "red_light")
    settings: dict[str, Any] = {"scenario": scenario, "cases": 8, "horizon_s": 9.0}
    envs = JunctionVectorEnv(ROWS, world, autoreset_mode=mode, **settings)
    alone = JunctionEnv(world, **settings)
    seen, _ = envs.reset(seed=20)
    record = [(seen, np.zeros(ROWS), np.zeros(ROWS, bool))]
    given = actions(110)
    for action in given:
        seen, reward, terminated, truncated, _ = envs.step(action)
        over = terminated | truncated
        if mode is AutoresetMode.DISABLED and over.any():
            seen, _ = envs.reset(options={"reset_mask": over})
        record.append((seen, reward, over))
    assert sum(over.sum() for _, _, over in record) >= ROWS

    row = ROWS - 1
    mine, _ = alone.reset(seed=20 + row)
    ended = False
    for action, (seen, reward, over) in zip(given, record[1:], strict=True):
        if ended and mode is AutoresetMode.NEXT_STEP:
            (mine, _), worth, ended = alone.reset(), 0.0, False
        else:
            mine, worth, terminated_, truncated_, _ = alone.step(action[row])
            ended = terminated_ or truncated_
        assert (worth, ended) == (reward[row], over[row])
        if ended and mode is not AutoresetMode.NEXT_STEP:
            mine, _ = alone.reset()
        assert mine.tobytes() == seen[row].tobytes()


def test_the_same_step_mode_tells_how_it_ended() -> None:
    envs = vector(autoreset_mode="SameStep", control="along_path")
    envs.reset(seed=0)
    for _ in range(100):
        seen, _, terminated, truncated, infos = envs.step(np.zeros((ROWS, 1), np.float32))
        if (over := terminated | truncated).any():
            break

    row = int(np.flatnonzero(over)[0])
    names = envs.course.features
    assert infos["_final_obs"].tolist() == over.tolist()
    assert infos["final_info"]["collided"][row] or infos["final_info"]["off_road"][row]
    assert infos["final_obs"][row][names.index("to_end")] <= 1.0
    assert not np.array_equal(infos["final_obs"][row], seen[row])


def test_without_autoreset_rows_that_are_over_have_to_be_reset() -> None:
    envs = vector(autoreset_mode="Disabled", control="along_path")
    envs.reset(seed=0)

    for _ in range(100):
        _, _, terminated, *_ = envs.step(np.zeros((ROWS, 1), np.float32))
        if terminated.any():
            break

    with pytest.raises(gymnasium.error.ResetNeeded, match="reset them with reset_mask"):
        envs.step(np.zeros((ROWS, 1), np.float32))


def test_who_keeps_going_into_the_circulating_car_collides_and_who_stands_is_cut_off() -> None:
    env = roundabout(control="along_path", early_or_late_s=0.0)
    ends = {}
    for name, action in (("goes on", 0.0), ("brakes", -1.0)):
        env.reset(seed=2)
        for _ in range(200):
            _, _, terminated, truncated, info = env.step(np.array([action], np.float32))
            if terminated or truncated:
                break
        ends[name] = (terminated, truncated, info["collided"])

    assert ends == {"goes on": (True, False, True), "brakes": (False, True, False)}


def test_leaving_the_road_ends_an_episode_at_a_cost() -> None:
    env = roundabout()
    env.reset(seed=2)
    for _ in range(90):
        _, reward, terminated, _, info = env.step(np.array([0.3, 0.6], np.float32))
        if terminated:
            break

    assert terminated
    assert info["off_road"]
    assert reward < -0.5


def test_a_reward_can_be_given() -> None:
    def speed(step: StepFacts) -> Any:
        return step.speed_mps

    env = JunctionEnv(ring(), cases=4, reward=speed, control="along_path")
    env.reset(seed=1)
    _, reward, *_ = env.step(np.zeros(1, np.float32))

    assert reward == env.course.rows.stage.states[0, 3]


def test_facts_tell_what_bends_allow_and_how_close_the_one_ahead_is() -> None:
    told: list[StepFacts] = []

    def keep(step: StepFacts) -> Any:
        told.append(step)
        return step.speed_mps

    ahead = {"circulating_car.arrives_after_s": -1.5}
    env = JunctionEnv(
        ring(), cases=4, reward=keep, control="along_path", early_or_late_s=0.0, values=ahead
    )
    seen, _ = env.reset(seed=1)
    names = env.course.features
    over = late = False
    while not over and not late:
        gap_m, lead_mps = (
            float(seen[names.index(name)]) * worth
            for name, worth in (("lead_gap", 60.0), ("lead_speed", 20.0))
        )
        seen, _, over, late, _ = env.step(np.array([0.05], np.float32))
        step = told[-1]
        speed = float((step.speed_mps - step.speed_gain_mps)[0])
        wanted_m = 2.0 + max(speed * 1.2 + speed * (speed - lead_mps) / (2.0 * 3.0**0.5), 0.0)
        share = 1.0 if gap_m >= 60.0 else min(gap_m / wanted_m, 1.0)
        assert step.distance_share[0] == pytest.approx(share, abs=1e-4)

    assert min(step.distance_share[0] for step in told) < 0.5
    aimed = np.array([step.aimed_speed_mps[0] for step in told])
    assert (aimed <= np.array([step.target_speed_mps[0] for step in told])).all()
    assert aimed.min() < 0.9 * aimed.max()
    gains = np.array([step.aimed_gain_mps[0] for step in told])
    assert gains[1:] == pytest.approx(np.diff(aimed), abs=1e-9)


def test_options_choose_the_scenario_its_values_and_the_case() -> None:
    env = JunctionEnv(ring(), cases=4)
    world = cross()
    options = {"world": world, "scenario": "scp", "values": {"ego.speed_mps": 7.0}, "place": 1}

    seen, info = env.reset(seed=1, options={**options, "case": 2})

    job = env.course.rows.episodes.job
    assert info["case"] == 2
    assert job.world_id == world.id
    assert {future.scenario_id for future in job.futures} == {"scp"}
    assert seen[env.course.features.index("speed")] == pytest.approx(7.0 / 20.0)
    again, _ = env.reset(seed=1, options={"case": 2})
    assert again.tobytes() == seen.tobytes()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"senario": "scp"}, "reset knows no option 'senario'"),
        ({"scenario": "nothing"}, "nothing"),
        ({"scenario": "scp"}, "takes place nowhere in World"),
        ({"values": {"ego.speed": 3.0}}, "has no value 'ego.speed'; known: ego.speed_mps"),
        ({"place": 99}, "there is no number 99"),
        ({"place": "here"}, "has no place 'here'; known: "),
        ({"case": 1000}, "there is no number 1000"),
        ({"case": "2"}, "there is no number '2'"),
        ({"case": 1.5}, "there is no number 1.5"),
        ({"cases": 0}, "cases 0: a whole number from 1"),
        ({"cases": 2.5}, "cases 2.5: a whole number from 1"),
        ({"early_or_late_s": -1.0}, "early_or_late_s -1: from 0"),
    ],
)
def test_options_that_do_not_fit_say_so(options: dict[str, Any], says: str) -> None:
    with pytest.raises(UserError, match=says):
        to_refuse().reset(options=options)


def test_options_that_did_not_fit_are_forgotten() -> None:
    env = JunctionEnv(ring(), cases=4)
    for options in ({"scenario": "nothing"}, {"cases": 5, "case": 5}):
        with pytest.raises(UserError):
            env.reset(options=options)

    with pytest.raises(UserError, match="reset comes before step"):
        env.step(np.zeros(2, np.float32))
    env.reset(options={"early_or_late_s": 1.0})
    assert len(env.course.rows.playable) == 5


def test_make_vec_makes_one_stage() -> None:
    envs = gymnasium.make_vec(ID, num_envs=3, world=ring(), cases=4)

    assert isinstance(envs.unwrapped, JunctionVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, infos = envs.reset(seed=1)
    assert seen in envs.observation_space
    assert infos["_case"].all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen, rewards, *_ = envs.step(envs.action_space.sample())
    assert rewards.shape == (3,)


def test_a_picture_shows_the_car_in_its_middle() -> None:
    env = roundabout(render_mode="rgb_array")
    env.reset(seed=1)
    picture = env.render()

    assert picture is not None
    assert picture.shape == (320, 320, 3)
    red = (picture[..., 0] > 150) & (picture[..., 1] < 100)
    rows, columns = np.nonzero(red)
    assert np.hypot(rows.mean() - 160, columns.mean() - 160) < 8
