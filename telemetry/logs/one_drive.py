"""Which rows of a table can be of one drive by their stamps: one wild clock must not cost the rest.

A stamp far ahead makes all after it look as if time ran backwards, and one of before the clock was
set makes a drive last for decades.
"""

from __future__ import annotations

import bisect
import datetime
from collections import Counter
from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Flags, Stamps
from foretwin.contracts.drive import TimeBase
from foretwin.telemetry.logs.log import CLOCK_NOT_SET, TIME_BACKWARDS
from foretwin.telemetry.logs.merge import LATE_NS

_SET_SINCE_NS = round(datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC).timestamp()) * 10**9
"""Computers without a battery begin in 1970, satellite receivers in 1980."""


def of_one_drive(stamps_ns: Stamps, time_base: TimeBase) -> tuple[Flags, Counter[str]]:
    """Return (N,) which stamps, in the order of their rows, to keep, and how many not by reason.

    Where time runs back by more than what may come late, as many are kept as rise. Of UTC none are
    kept from before the clock was set, if it ever was. Stamps below zero are left to who reads.
    """
    kept, refused = stamps_ns >= 0, Counter[str]()
    unset = kept & (stamps_ns < _SET_SINCE_NS)
    if time_base == "utc" and unset.any() and not unset[kept].all():
        refused[CLOCK_NOT_SET] = int(unset.sum())
        kept &= ~unset
    rows = np.flatnonzero(kept)
    known_ns = stamps_ns[rows]
    if len(known_ns) and (np.maximum.accumulate(known_ns) - known_ns).max() > LATE_NS:
        rising = _longest_rise(known_ns.tolist())
        refused[TIME_BACKWARDS] = len(rows) - len(rising)
        kept[:] = False
        kept[rows[rising]] = True
    return kept | (stamps_ns < 0), refused


def _longest_rise(stamps_ns: Sequence[int]) -> list[int]:
    """Return the places of as many stamps as can be kept of which none falls.

    Patience sorting (Fredman 1975, On computing the length of longest increasing subsequences).
    """
    ends_ns: list[int] = []
    end_at: list[int] = []
    before: list[int] = []
    for place, stamp_ns in enumerate(stamps_ns):
        length = bisect.bisect_right(ends_ns, stamp_ns)
        before.append(end_at[length - 1] if length else -1)
        ends_ns[length : length + 1] = [stamp_ns]
        end_at[length : length + 1] = [place]
    found, place = [], end_at[-1]
    while place >= 0:
        found.append(place)
        place = before[place]
    return found[::-1]
