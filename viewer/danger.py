"""Which futures of a round are dangers, the worst first, and how they come at the car."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.simulation import AMBER_FROM, GREEN_TO, RED_FROM, RoundView

Level = Literal["none", "calm", "watch", "danger"]
"""How critical a round is; `none` where nothing is known."""
LEVELS: tuple[Level, ...] = ("none", "calm", "watch", "danger")
ROUND_FOR_S = 3.0
"""So old a round may be that is shown, counted from the state that it began with; the slowest pace
is one in two seconds."""
FALLS_AFTER_ROUNDS = 2
"""A level rises at once; it falls when so many rounds in a row are below it, so that nobody looks
at a band that flickers."""
_STANDS_M = 0.5
_SAME_WAY_RAD, _AGAINST_RAD = math.radians(45.0), math.radians(135.0)
_SAID = {"static": "fixed object", "unknown": "somebody"}


class Danger(NamedTuple):
    """A future that is worth a look: who comes from where, how likely, in how many seconds.

    `likelihood` from 0 to 1 is relative: 1 is as likely as any future of the round.
    """

    future: int
    what: str
    likelihood: float
    criticality: float
    in_s: float
    hits: bool
    level: Level

    @property
    def odds(self) -> str:
        """How likely it is beside the likeliest future, as it is said at a glance."""
        if self.likelihood >= 0.00995:
            return f"{100.0 * self.likelihood:.0f} %"
        if self.likelihood >= 0.001:
            return f"1 in {float(f'{1.0 / self.likelihood:.1g}'):.0f}"
        return "rare"


def level_of(criticality: float) -> Level:
    """Return the level of a criticality by the limits that every view of foretwin has."""
    if criticality >= RED_FROM:
        return "danger"
    return "watch" if criticality >= AMBER_FROM else "calm"


def dangers_of(view: RoundView) -> tuple[Danger, ...]:
    """Return the dangers of a round by likelihood times severity, the worst first.

    Of futures that say the same (a car from the right) the worst stands for all. None of a late
    round: nothing of it is current.
    """
    if view.late:
        return ()
    met = {one.future: (one, number) for number, one in enumerate(view.met)}
    hits = {one.future: one for one in view.hits}
    found: dict[str, Danger] = {}
    for future in np.argsort(-view.criticality, kind="stable").tolist():
        criticality = float(view.criticality[future])
        if not criticality > GREEN_TO:
            break
        hit = hits.get(future)
        if hit is not None and hit.what == "static":
            what, in_s = _SAID["static"], hit.time_s
        elif future in met:
            one, number = met[future]
            side = _side(view, future, view.user_xy_m[number], one.time_s)
            what, in_s = f"{_SAID.get(one.kind, one.kind)} {side}", one.time_s
        else:
            continue
        if what not in found:
            likelihood = float(view.likelihood[future])
            level = level_of(criticality)
            found[what] = Danger(
                future, what, likelihood, criticality, in_s, hit is not None, level
            )
    return tuple(found.values())


class SteadyLevel:
    """The level that is shown: up at once, down only when it stays down."""

    def __init__(self) -> None:
        self.shown: Level = "none"
        self._below: list[Level] = []

    def take(self, level: Level) -> Level:
        """Take a round's level and return the one to show."""
        if LEVELS.index(level) >= LEVELS.index(self.shown):
            self.shown, self._below = level, []
            return level
        self._below.append(level)
        if len(self._below) >= FALLS_AFTER_ROUNDS:
            self.shown = max(self._below, key=LEVELS.index)
            self._below = []
        return self.shown

    def forget(self) -> None:
        """Show nothing: there is no current round."""
        self.shown, self._below = "none", []


def instant_of(view: RoundView, time_s: float) -> int:
    """Return which point of the round's lines is nearest to so many seconds; never the first."""
    last = int(view.xy_m.shape[1]) - 1
    at = last if view.horizon_s <= 0.0 else round(time_s / view.horizon_s * last)
    return min(max(at, 1), last)


def _side(view: RoundView, future: int, track_m: Array, at_s: float) -> str:
    """Return from where a road user on `track_m` (M, 2) comes, as the car will then see it."""
    own_m = np.asarray(view.xy_m[future], dtype=np.float64)
    at = instant_of(view, at_s)
    own_rad = _heading(own_m, at)
    track_m = np.asarray(track_m, dtype=np.float64)
    came_m = track_m[at] - track_m[0]
    if float(np.hypot(*came_m)) < _STANDS_M:
        return "ahead"
    turned = float(wrap_angle(math.atan2(came_m[1], came_m[0]) - own_rad))
    if abs(turned) > _AGAINST_RAD:
        return "oncoming"
    if abs(turned) >= _SAME_WAY_RAD:
        # Who moves to the left comes from the right.
        return "from the right" if turned > 0.0 else "from the left"
    ahead = track_m[0] - own_m[0]
    along_m = ahead[0] * math.cos(own_rad) + ahead[1] * math.sin(own_rad)
    return "ahead" if along_m > 0.0 else "from behind"


def _heading(line_m: Array, at: int) -> float:
    """Return the direction of a line at a place, of one that stands there its last before."""
    for place in range(at, 0, -1):
        step = line_m[place] - line_m[place - 1]
        if float(np.hypot(*step)) > 1e-3:
            return math.atan2(step[1], step[0])
    return math.atan2(*(line_m[-1] - line_m[0])[::-1])
