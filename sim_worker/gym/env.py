"""One car at a junction as a Gymnasium environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from foretwin.contracts.world import World
from foretwin.sim_worker.gym.course import info_of
from foretwin.sim_worker.gym.episodes import CASE
from foretwin.sim_worker.gym.observation import Observation
from foretwin.sim_worker.gym.picture import Picture, draw_row
from foretwin.sim_worker.gym.spaces import action_space, course_of, observation_space

ONE = np.zeros(1, dtype=np.intp)


class JunctionEnv(gymnasium.Env[Observation, npt.NDArray[np.float32]]):
    """A car drives through one case of a scenario, or on from a recorded state.

    It ends with a collision, off the road, or at the path's end, and is cut off at the horizon.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self, world: World | str | Path, *, render_mode: str | None = None, **settings: Any
    ) -> None:
        """Compile the World; further settings are those of `Source` and of `Course`.

        Raises UserError for settings that do not fit.
        """
        self.course = course_of(world, settings, count=1, render_mode=render_mode)
        self.metadata = {**self.metadata, "render_fps": self.course.control_hz}
        self.render_mode = render_mode
        self.observation_space = observation_space(self.course)
        self.action_space = action_space(self.course)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, drawn from the cases by the seed.

        Options are `case`, the number of one, and the fields of `Source` that shall change from
        now on.
        """
        super().reset(seed=seed)
        wanted = dict(options or {})
        case = wanted.pop(CASE, None)
        self.course.alter(wanted)
        begun = self.course.draw(self.np_random, case)
        self.course.begin(ONE, [begun])
        return self.course.look()[0], {CASE: begun.case}

    def step(
        self, action: npt.NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive on for one control tick."""
        reward, facts = self.course.step(np.asarray(action, dtype=np.float64)[None])
        terminated = bool(facts.terminated[0])
        truncated = bool(self.course.over_time()[0]) and not terminated
        info = {name: values[0].item() for name, values in info_of(facts).items()}
        return self.course.look()[0], float(reward[0]), terminated, truncated, info

    def render(self) -> Picture | None:
        """Return a picture from above (H, W, 3), or None without a render mode."""
        return draw_row(self.course.rows, 0) if self.render_mode else None
