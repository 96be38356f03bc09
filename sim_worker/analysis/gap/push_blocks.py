"""Accelerations as commanded, as the car did them and as the model did, over blocks of driving."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord

BLOCK = round(0.2 / PERIOD_S)
BLOCK_S = BLOCK * PERIOD_S
_LAG = round(0.1 / PERIOD_S)
"""With which a car follows its command, give or take as much."""
_NOISE_MPS2, _UNEVEN = 0.15, 0.6
"""Noise of a block's acceleration, and how much counts what another lag would have asked for."""


class PushBlocks(NamedTuple):
    """Accelerations (K,) over blocks: commanded, the car's, the model's; speeds, deviations."""

    stamp_ns: Array
    asked_mps2: Array
    car_mps2: Array
    model_mps2: Array
    speed_mps: Array
    std_mps2: Array


def push_blocks(
    record: MotionRecord,
    speed_mps: Array,
    starts: Indices,
    model_mps: Array,
    *,
    doubt_mps2: float = 0.0,
) -> PushBlocks:
    """Return the last two blocks of each run at grid indices `starts` (K,).

    `doubt_mps2` is how far what slopes take is off.
    `speed_mps` (N,) is the car's on the grid, `model_mps` (K, steps + 1) the model's of each run.
    """
    asked = record.command_accel_mps2
    rows = []
    for start, model in zip(starts, model_mps, strict=True):
        for end in (len(model) - 1 - BLOCK, len(model) - 1):
            at = int(start) + end
            soon, due, late = (
                np.mean(asked[at - BLOCK - k * _LAG : at - k * _LAG]) for k in range(3)
            )
            rows.append(
                (
                    record.stamp_ns[at],
                    due,
                    (speed_mps[at] - speed_mps[at - BLOCK]) / BLOCK_S,
                    (model[end] - model[end - BLOCK]) / BLOCK_S,
                    speed_mps[at - BLOCK // 2],
                    math.hypot(_NOISE_MPS2, _UNEVEN * float(soon - late), doubt_mps2),
                )
            )
    return PushBlocks(*np.array(rows, dtype=np.float64).reshape(len(rows), 6).T)
