"""What the single and the vector environment have in common: from actions to what they led to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.errors import UserError
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.gym.actions import Control, action_size, commands
from foretwin.sim_worker.gym.episodes import Source
from foretwin.sim_worker.gym.observation import Observation, feature_names, observe
from foretwin.sim_worker.gym.reward import Reward, default_reward
from foretwin.sim_worker.gym.rows import EpisodeRows, Sighting, StepFacts
from foretwin.sim_worker.vehicle.parameters import load_vehicle


class Begun(NamedTuple):
    """How an episode begins: which of the playable cases, how much later by the lights' plans."""

    case: int
    lights_s: float


class Course:
    """S cars that learners drive: numbers in, numbers out, without Gymnasium's conventions."""

    def __init__(
        self,
        source: Source,
        *,
        count: int,
        control: Control = "free",
        nearest: int = 6,
        horizon_s: float = 20.0,
        control_hz: float = 10.0,
        reward: Reward = default_reward,
        vehicle: VehicleParameters | Path | str | None = None,
        threads: int = 1,
    ) -> None:
        """Compile the World; raises UserError for settings and episodes that cannot be played.

        `vehicle` is a bundled one's name, a file or parameters.
        """
        whole = {"num_envs": (count, 1), "nearest": (nearest, 0), "threads": (threads, 1)}
        for name, (number, least) in whole.items():
            if not isinstance(number, int | np.integer) or number < least:
                raise UserError(f"{name} {number!r}: a whole number from {least}")
        for name, seconds in (("horizon_s", horizon_s), ("control_hz", control_hz)):
            if not 0.0 < seconds < np.inf:
                raise UserError(f"{name} {seconds:g}: above 0")
        if not callable(reward):
            raise UserError(f"reward {reward!r}: a function of StepFacts")
        self.control: Control = control
        self.action_size = action_size(control)
        self.features = feature_names(nearest)
        self.count, self.control_hz = count, control_hz
        self._nearest, self._reward, self._threads = nearest, reward, threads
        self._most_ticks = max(round(horizon_s * control_hz), 1)
        if not isinstance(vehicle, VehicleParameters):
            vehicle = load_vehicle(vehicle)
        self._vehicle = vehicle
        self._load(source)

    def _load(self, source: Source) -> None:
        # What cannot be played leaves the source as it was, for the next options to change.
        self.rows = EpisodeRows(
            source.episodes(self._vehicle),
            self._vehicle,
            count=self.count,
            control_hz=self.control_hz,
            threads=self._threads,
        )
        self.source = source
        self._seen: Sighting | None = None
        """None until episodes begin."""

    def alter(self, options: Mapping[str, Any]) -> None:
        """Take episodes from elsewhere, if options say so; raises UserError where they cannot."""
        if options:
            self._load(self.source.altered(options))

    def draw(self, rng: np.random.Generator, case: int | None = None) -> Begun:
        """Draw how an episode begins; `case` chooses among the playable ones."""
        count = len(self.rows.playable)
        drawn = int(rng.integers(count))
        lights_s = float(rng.uniform(0.0, self.rows.light_cycle_s))
        if case is not None:
            if not isinstance(case, int | np.integer) or not 0 <= case < count:
                raise UserError(f"there are {count} cases; there is no number {case!r}")
            drawn = case
        return Begun(drawn, lights_s)

    def begin(self, rows: Indices, begun: Sequence[Begun], *, looked: bool = False) -> None:
        """Let some rows begin; see `EpisodeRows.begin`."""
        cases, lights_s = zip(*begun, strict=True)
        futures = self.rows.playable[np.array(cases)]
        self.rows.begin(rows, futures, np.array(lights_s), looked=looked)

    def look(self) -> Observation:
        """Return what all see now (S, D)."""
        seen = self._seen = self.rows.look()
        return observe(seen, nearest=self._nearest)

    def step(self, actions: Array) -> tuple[Array, StepFacts]:
        """Carry out actions (S, A) and return what they were worth (S,), and what happened."""
        if self._seen is None:
            raise UserError("no episode has begun: reset comes before step")
        wanted = np.asarray(actions, dtype=np.float64)
        if wanted.shape == (self.count,) and self.action_size == 1:
            wanted = wanted[:, None]
        if wanted.shape != (self.count, self.action_size):
            wants = f"{self.count} of {self.action_size} numbers"
            raise UserError(f"actions of shape {wanted.shape}: {wants} are wanted")
        if len(wrong := np.flatnonzero(~np.isfinite(wanted).all(axis=1))):
            raise UserError(f"action {wanted[wrong[0]].tolist()} of row {wrong[0]}: not finite")
        facts = self.rows.step(commands(wanted, self._seen.view, control=self.control))
        worth = np.asarray(self._reward(facts), dtype=np.float64)
        if worth.shape != (self.count,):
            raise UserError(f"reward of shape {worth.shape}: one number for each row of StepFacts")
        if len(wrong := np.flatnonzero(~np.isfinite(worth))):
            raise UserError(f"reward {worth[wrong[0]]:g} of row {wrong[0]}: not finite")
        return worth, facts

    def over_time(self) -> Flags:
        """(S,) bool: whether an episode has lasted as long as it may."""
        return np.asarray(self.rows.ticks >= self._most_ticks)


def info_of(facts: StepFacts) -> dict[str, Array | Flags]:
    """Return what `info` says of a step: the fields of `StepFacts` that are no motion."""
    names = ("collided", "off_road", "arrived", "ran_red", "did_not_wait", "failed")
    return {"progress_m": facts.progress_m, **{name: getattr(facts, name) for name in names}}
