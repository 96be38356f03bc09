"""How drivers of one crowd differ: each has its own time gap, haste and attention, by the seed.

Every number is lognormal about its median in the driver model, drawn from the future's and the road
user's names alone: the same one drives alike with whatever planner it meets, and wherever its
future is played again.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from foretwin.contracts.arrays import Array, Indices
from foretwin.sim_worker import driver_model as driver

_WIDEST = 2.0
"""Nobody is farther from the median than so many standard deviations."""


class Manners(NamedTuple):
    """What sets a driver apart; every field (S, R).

    `time_gap_s` is kept behind others, `accel_mps2` and `decel_mps2` are what it is ready to do,
    `lateral_mps2` in bends, `limit_share` is how much of the limit it drives at, `reaction_s` how
    late it sees what changes, `lag_s` what it leaves between itself and who was there before.
    """

    time_gap_s: Array
    accel_mps2: Array
    decel_mps2: Array
    lateral_mps2: Array
    limit_share: Array
    reaction_s: Array
    lag_s: Array


Spreads = tuple[tuple[float, float], ...]
"""In the order of `Manners`: the median, and the standard deviation of its logarithm."""
SPREADS: Spreads = (
    driver.OTHERS_TIME_GAP_S,
    driver.OTHERS_ACCEL_MPS2,
    driver.OTHERS_DECEL_MPS2,
    driver.OTHERS_LATERAL_MPS2,
    driver.OTHERS_LIMIT_SHARE,
    driver.OTHERS_REACTION_S,
    driver.OTHERS_LAG_S,
)


def key_of(*parts: object) -> int:
    """Return a number that names what the parts say, the same in every process."""
    return zlib.crc32("\n".join(map(str, parts)).encode())


def manners(futures: Sequence[int], users: Indices, spreads: Spreads = SPREADS) -> Manners:
    """Return the manners of road users of keys (S, R) in futures of S keys."""
    key: npt.NDArray[np.uint64] = np.array(futures, dtype=np.uint64)[:, None] << np.uint64(32)
    key = key | users.astype(np.uint64)
    found = []
    for number, (median, spread) in enumerate(spreads):
        normal = ndtri(_even(key, number))
        drawn = np.minimum(np.maximum(normal, -_WIDEST), _WIDEST)
        found.append(median * np.exp(spread * drawn))
    return Manners._make(found)


def _even(key: npt.NDArray[np.uint64], number: int) -> Array:
    """Return numbers between 0 and 1 that keys (S, R) lead to, by SplitMix64 (Steele, Lea and Flood
    2014, Fast splittable pseudorandom number generators)."""
    golden = 0x9E3779B97F4A7C15
    bits: npt.NDArray[np.uint64] = key + np.uint64((number + 1) * golden % 2**64)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    bits ^= bits >> np.uint64(31)
    return np.asarray(((bits >> np.uint64(11)).astype(np.float64) + 0.5) / 2.0**53)
