"""S cars at a junction as a Gymnasium vector environment: one stage, stepped together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from foretwin.contracts.arrays import Flags, Indices
from foretwin.contracts.errors import UserError
from foretwin.contracts.world import World
from foretwin.sim_worker.gym.course import info_of
from foretwin.sim_worker.gym.episodes import CASE
from foretwin.sim_worker.gym.observation import Observation
from foretwin.sim_worker.gym.picture import Picture, draw_row
from foretwin.sim_worker.gym.spaces import action_space, course_of, observation_space

MASK = "reset_mask"


class JunctionVectorEnv(VectorEnv[Observation, npt.NDArray[np.float32], npt.NDArray[Any]]):
    """What S `JunctionEnv` do, to the bit, at a fraction of the time.

    An episode that is over begins anew in the next step (whose action does not count), in the same
    step (`final_obs` and `final_info` tell the end), or when `reset` is told so.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        world: World | str | Path,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        """Compile the World; further settings are those of `Source` and of `Course`.

        Raises UserError for settings that do not fit.
        """
        self.course = course_of(world, settings, count=num_envs, render_mode=render_mode)
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "render_fps": self.course.control_hz,
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode = render_mode
        self.single_observation_space = observation_space(self.course)
        self.single_action_space = action_space(self.course)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs: list[np.random.Generator] = []
        self._over: Flags = np.zeros(num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin episodes: of all rows, or with the option `reset_mask` (S,) of some.

        Row i is seeded with `seed` + i. Other options are those of `JunctionEnv.reset`, for all.
        """
        wanted = dict(options or {})
        mask = wanted.pop(MASK, None)
        case = wanted.pop(CASE, None)
        if mask is not None and wanted:
            raise UserError(f"{MASK} leaves rows as they are; {next(iter(wanted))} changes all")
        self._seed(seed)
        self.course.alter(wanted)
        rows = np.arange(self.num_envs) if mask is None else np.flatnonzero(self._mask(mask))
        infos = self._begin(rows, case, looked=mask is not None)
        return self.course.look(), infos

    def _mask(self, mask: Any) -> Flags:
        found = np.asarray(mask)
        if found.shape != (self.num_envs,) or found.dtype != np.bool_ or not found.any():
            raise UserError(
                f"{MASK} must be ({self.num_envs},) booleans, at least one of them true, "
                f"not {found.dtype} {found.shape}"
            )
        return found

    def _seed(self, seed: int | Sequence[int | None] | None) -> None:
        if isinstance(seed, int | np.integer):
            seed = [int(seed) + row for row in range(self.num_envs)]
        if seed is None:
            if self._rngs:
                return
            seed = [None] * self.num_envs
        if len(seed) != self.num_envs:
            raise UserError(f"{len(seed)} seeds for {self.num_envs} rows")
        known: list[np.random.Generator | None] = [*self._rngs] or [None] * self.num_envs
        self._rngs = [
            rng if rng is not None and one is None else seeding.np_random(one)[0]
            for one, rng in zip(seed, known, strict=True)
        ]
        self._np_random = self._rngs[0]

    def _begin(self, rows: Indices, case: int | None = None, *, looked: bool) -> dict[str, Any]:
        begun = [self.course.draw(self._rngs[row], case) for row in rows]
        self.course.begin(rows, begun, looked=looked)
        self._over[rows] = False
        cases, which = np.zeros(self.num_envs, dtype=np.int64), np.zeros(self.num_envs, dtype=bool)
        cases[rows], which[rows] = [one.case for one in begun], True
        return {CASE: cases, f"_{CASE}": which}

    def step(
        self, actions: npt.NDArray[np.float32]
    ) -> tuple[Observation, npt.NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Drive on for one control tick in every row."""
        mode, before = self.autoreset_mode, self._over
        if mode is AutoresetMode.DISABLED and before.any():
            raise gymnasium.error.ResetNeeded(
                f"rows {np.flatnonzero(before).tolist()} are over: reset them with {MASK}"
            )
        rewards, facts = self.course.step(np.asarray(actions, dtype=np.float64))
        terminated = facts.terminated & ~before
        truncated = self.course.over_time() & ~facts.terminated & ~before
        self._over = terminated | truncated
        info = info_of(facts)
        infos = _of_rows(info, ~before)
        if before.any():
            rewards = np.where(before, 0.0, rewards)
            infos.update(self._begin(np.flatnonzero(before), looked=False))
        observations = self.course.look()
        if mode is AutoresetMode.SAME_STEP and self._over.any():
            observations, infos = self._begin_at_once(observations, info)
        return observations, rewards, terminated, truncated, infos

    def _begin_at_once(
        self, observations: Observation, info: Mapping[str, Any]
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin the rows that are over, and keep what they ended with, as Gymnasium does."""
        over = self._over.copy()
        rows = np.flatnonzero(over)
        ended = np.full(self.num_envs, None, dtype=object)
        for row in rows:
            ended[row] = observations[row].copy()
        kept: dict[str, Any] = {
            "final_obs": ended,
            "_final_obs": over,
            "final_info": _of_rows(info, over),
            "_final_info": over.copy(),
        }
        infos = {**kept, **_of_rows(info, ~over), **self._begin(rows, looked=True)}
        return self.course.look(), infos

    def render(self) -> tuple[Picture, ...] | None:
        """Return a picture of each row from above (H, W, 3), or None without a render mode."""
        if not self.render_mode:
            return None
        return tuple(draw_row(self.course.rows, row) for row in range(self.num_envs))


def _of_rows(info: Mapping[str, Any], rows: Flags) -> dict[str, Any]:
    """Return what `info` says of some rows (S,), and beside each name which rows these are."""
    found = {}
    for name, values in info.items():
        found[name] = np.where(rows, values, np.zeros_like(values))
        found[f"_{name}"] = rows.copy()
    return found
