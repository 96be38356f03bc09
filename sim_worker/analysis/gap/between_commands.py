"""What a car was told between two commands of a record that has few."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.sim_worker.analysis.motion_record import PERIOD_S

_SENT_S, _RARE_S, SELDOM_S = 0.06, 0.25, 0.25
"""Commands come more often than the first as a rule. Between such as come up to the second apart
there may have been others; after the third nobody knows what is commanded. Chosen."""


class BetweenCommands(NamedTuple):
    """How commands (N,) go on from one to the next where they come seldom.

    `age_s` is how long each has held, `then` the place of the one after it, `share` how much of
    the time until that is over; `rare` says where others may have been sent between.
    """

    age_s: Array
    then: Indices
    share: Array
    rare: Flags

    def of(self, held: Array) -> Array:
        """Return held commands (N,) as they change linearly, NaN where nobody knows them."""
        told = np.where(self.age_s <= SELDOM_S, held, np.nan)
        return np.where(self.rare, told + self.share * (held[self.then] - held), told)


def between_commands(age_s: Array) -> BetweenCommands:
    """Return how commands go on that have held for `age_s` (N,).

    Recorders thin out what is sent: held, such commands are late and go in steps.
    """
    count, known = len(age_s), np.isfinite(age_s)
    begins = np.flatnonzero((np.diff(age_s) < 0.0) | (known[1:] & ~known[:-1])) + 1
    next_one = np.searchsorted(begins, np.arange(count), side="right")
    then = np.append(begins, count - 1)[next_one]
    apart_s = age_s[np.maximum(then - 1, 0)] + PERIOD_S - age_s[then]
    rare = (apart_s > _SENT_S) & (apart_s < _RARE_S)
    return BetweenCommands(age_s, then, age_s / np.where(rare, apart_s, 1.0), rare)
