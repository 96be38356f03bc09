"""The round that is shown: what its dangers are, how old it is, and when it is too old to show."""

from __future__ import annotations

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.simulation import RoundView
from foretwin.viewer.danger import ROUND_FOR_S, Danger, Level, SteadyLevel, dangers_of

OLD_ROUND_S = 1.5
"""From so much on a round is said to be old: two of the usual pace are missing then."""


class RoundNow:
    """Takes rounds and states; times are of one rising clock, in seconds."""

    def __init__(self) -> None:
        self.view: RoundView | None = None
        self.dangers: tuple[Danger, ...] = ()
        """Of the round, the worst first."""
        self._level = SteadyLevel()
        self._came_s = 0.0
        self._state: tuple[int, float] | None = None
        """Stamp of the newest state, and when it came."""

    @property
    def level(self) -> Level:
        """How critical it is, as it is shown."""
        return self._level.shown

    @property
    def danger(self) -> Danger | None:
        """The danger that ranks first."""
        return self.dangers[0] if self.dangers else None

    def take(self, view: RoundView, now_s: float) -> None:
        """Take a round that came in time."""
        self.view, self._came_s, self.dangers = view, now_s, dangers_of(view)
        self._level.take(self.dangers[0].level if self.dangers else "calm")

    def state(self, state: VehicleState, now_s: float) -> None:
        """Take a state of the car."""
        self._state = state.stamp_ns, now_s

    def forget(self) -> None:
        """Show none."""
        self.view, self.dangers = None, ()
        self._level.forget()

    def age_s(self, now_s: float) -> float | None:
        """Return the drive time since the state that the round began with, None without a round;
        one that is too old is forgotten.

        On a busy machine a round is old when it comes. What stamps do not tell, as while no state
        comes or after a leap of the car's clock, the time since it came does.
        """
        if self.view is None:
            return None
        age_s = now_s - self._came_s
        if self._state is not None:
            stamp_ns, at_s = self._state
            age_s = max(age_s, (stamp_ns - self.view.stamp_ns) / 1e9 + now_s - at_s)
        if age_s > ROUND_FOR_S:
            self.forget()
            return None
        return age_s
