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

from foretwin.contracts.arrays import Flags, Indices, Stamps
from foretwin.contracts.drive import TimeBase
from foretwin.telemetry.logs.log import CLOCK_NOT_SET, TIME_BACKWARDS
from foretwin.telemetry.logs.merge import WINDOW_NS

_SET_SINCE_NS = round(datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC).timestamp()) * 10**9
"""Computers without a battery begin in 1970, satellite receivers in 1980."""


def of_one_drive(stamps_ns: Stamps, time_base: TimeBase) -> tuple[Indices, Counter[str]]:
    """Return (K,) the places of stamps to keep, in order of time, and how many not by reason.

    What comes late by no more than WINDOW_NS is put in order; where time runs back by more, as many
    are kept as rise, and what is late beside them. Of UTC none are kept from before the clock was
    set, if it ever was. Stamps below zero are left to who reads.
    """
    kept, refused = stamps_ns >= 0, Counter[str]()
    unset = kept & (stamps_ns < _SET_SINCE_NS)
    if time_base == "utc" and unset.any() and not unset[kept].all():
        refused[CLOCK_NOT_SET] = int(unset.sum())
        kept &= ~unset
    rows = np.flatnonzero(kept)
    known_ns = stamps_ns[rows]
    if len(known_ns) and (np.maximum.accumulate(known_ns) - known_ns).max() > WINDOW_NS:
        near = _near_the_rise(known_ns)
        refused[TIME_BACKWARDS] = int((~near).sum())
        rows = rows[near]
    rows = np.sort(np.concatenate([rows, np.flatnonzero(stamps_ns < 0)]))
    return rows[np.argsort(stamps_ns[rows], kind="stable")], refused


def _near_the_rise(stamps_ns: Stamps) -> Flags:
    """Return (N,) which stamps are off by no more than WINDOW_NS beside those that rise.

    A clock that is ahead for one row would else cost all rows that come late by its rise as well.
    """
    rising = np.array(_longest_rise(stamps_ns.tolist()))
    before = np.searchsorted(rising, np.arange(len(stamps_ns)), side="right") - 1
    after = np.searchsorted(rising, np.arange(len(stamps_ns)), side="left")
    earliest_ns, latest_ns = stamps_ns[rising[before]], stamps_ns[rising[after % len(rising)]]
    late: Flags = (before >= 0) & (stamps_ns < earliest_ns - WINDOW_NS)
    early: Flags = (after < len(rising)) & (stamps_ns > latest_ns + WINDOW_NS)
    return ~(late | early)


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
