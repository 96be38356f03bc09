"""Tracks laid on the HD map that was recorded with them, where recorder and map differ by a move.

Karlsruhe's lie 1.0 m (median) beside the lanes that they drive straight along, to the north-east on
both carriageways: a fixed recorder that was set up a little askew, and no way to drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import left_of
from tests.world_gen.truth.lane_model import LaneModel, Nearby
from tests.world_gen.truth.tracks import driven

_ROUNDS = 12
_SCALE_M = 0.3
"""Residuals beyond weigh less: who drives beside the middle of a lane tells nothing of the map."""


class Move(NamedTuple):
    """A rigid motion: a turn about `about_m` (2,), then a shift (2,)."""

    about_m: Array
    shift_m: Array
    turn_rad: float

    def of(self, xy_m: Array) -> Array:
        """Return points (N, 2) moved."""
        cos, sin = np.cos(self.turn_rad), np.sin(self.turn_rad)
        turned = (xy_m - self.about_m) @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(turned + self.about_m + self.shift_m)


def laid_on(model: LaneModel, tracks: Sequence[Array]) -> Move:
    """Return the motion that lays tracks (N, 2), where they go straight, best on a model's lanes.

    Lanes are matched and weighed anew in every round, by Cauchy's weights. What turns has no say.
    """
    nearby = Nearby(model.lines())
    each = [driven(xy_m) for xy_m in tracks]
    straight = np.concatenate([~one.turning for one in each])
    xy_m = np.concatenate([one.xy_m for one in each])[straight]
    along = np.concatenate([one.along for one in each])[straight]
    move = Move(xy_m.mean(axis=0), np.zeros(2), 0.0)
    for _ in range(_ROUNDS):
        at = move.of(xy_m)
        aside_m, _ = nearby.lateral(at, along)
        known = ~np.isnan(aside_m)
        across = left_of(along[known])
        arm_m = left_of(at[known] - move.about_m - move.shift_m)
        rows = np.column_stack([across, (across * arm_m).sum(axis=1)])
        weight = 1.0 / np.hypot(1.0, aside_m[known] / _SCALE_M)
        step, *_ = np.linalg.lstsq(weight[:, None] * rows, -weight * aside_m[known], rcond=None)
        move = Move(move.about_m, move.shift_m + step[:2], move.turn_rad + float(step[2]))
    return move
