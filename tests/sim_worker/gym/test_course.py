"""Settings and actions of the environments that do not fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.gym import JunctionEnv, JunctionVectorEnv
from tests.sim_worker.scenarios.worlds import ring


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"nearest": -1}, "nearest -1: a whole number from 0"),
        ({"threads": 0}, "threads 0: a whole number from 1"),
        ({"horizon_s": 0.0}, "horizon_s 0: above 0"),
        ({"horizon_s": float("nan")}, "horizon_s nan: above 0"),
        ({"control_hz": 0.0}, "control_hz 0: above 0"),
        ({"reward": 3}, "reward 3: a function of StepFacts"),
        ({"vehicle": "tank"}, "tank"),
        ({"horizon": 20.0}, "unknown setting 'horizon'; known: .*horizon_s"),
        ({"control": "steer"}, "control 'steer' is none of free, along_path"),
    ],
)
def test_settings_that_do_not_fit_say_so(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(UserError, match=says):
        JunctionEnv(ring(), cases=4, **settings)


def test_a_vector_of_no_cars_is_refused() -> None:
    for count in (0, 2.5):
        with pytest.raises(UserError, match=f"num_envs {count}: a whole number from 1"):
            JunctionVectorEnv(count, world=ring())


def test_an_action_that_is_no_number_is_told_and_no_accident() -> None:
    env = JunctionEnv(ring(), cases=4)
    env.reset(seed=1)
    with pytest.raises(UserError, match="of row 0: not finite"):
        env.step(np.array([0.0, np.nan], dtype=np.float32))


def test_actions_and_rewards_of_another_shape_are_told() -> None:
    envs = JunctionVectorEnv(3, world=ring(), cases=4, reward=lambda facts: 1.0)
    with pytest.raises(UserError, match="no episode has begun: reset comes before step"):
        envs.step(np.zeros((3, 2)))
    envs.reset(seed=1)
    # As many numbers in another order are other cars' actions.
    for shape in ((2, 3), (3,), (3, 3)):
        with pytest.raises(UserError, match=r"actions of shape .*: 3 of 2 numbers are wanted"):
            envs.step(np.zeros(shape))
    with pytest.raises(UserError, match=r"reward of shape \(\): one number for each row"):
        envs.step(np.zeros((3, 2)))


def test_a_reward_that_is_no_number_is_told_with_its_row() -> None:
    worth = np.array([1.0, 2.0, np.nan])
    envs = JunctionVectorEnv(3, world=ring(), cases=4, reward=lambda facts: worth)
    envs.reset(seed=1)
    with pytest.raises(UserError, match="reward nan of row 2: not finite"):
        envs.step(np.zeros((3, 2)))


@pytest.mark.parametrize("field", ["world", "job"])
def test_a_file_of_another_kind_is_told_by_its_name(tmp_path: Path, field: str) -> None:
    other = tmp_path / "town.osm"
    other.write_text("<osm/>")
    given = {"world": ring()} | {field: other}
    with pytest.raises(UserError, match=r"town\.osm"):
        JunctionEnv(**given)
    with pytest.raises(UserError, match=r"none\.osm"):
        JunctionEnv(**(given | {field: tmp_path / "none.osm"}))


def test_one_number_for_each_car_is_an_action_along_the_path() -> None:
    envs = JunctionVectorEnv(2, world=ring(), cases=4, control="along_path")
    envs.reset(seed=1)
    assert envs.step(np.zeros(2))[1].shape == (2,)
