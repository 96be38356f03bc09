"""A track that forgets is, at every moment, the end of one that keeps everything."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.recent_track import RecentTrack


@given(
    steps_ns=st.lists(st.integers(1, 40_000_000), min_size=1, max_size=1500),
    keep_ns=st.integers(0, 20_000_000_000),
)
def test_it_holds_the_end_of_all_that_was_added(steps_ns: list[int], keep_ns: int) -> None:
    track, stamps = RecentTrack(2), np.cumsum(steps_ns)
    for number, stamp_ns in enumerate(stamps.tolist()):
        track.add(stamp_ns, (number, -number))
        track.forget(track.since(stamp_ns - keep_ns))
    kept = stamps >= stamps[-1] - keep_ns
    assert track.stamps_ns.tolist() == stamps[kept].tolist()
    numbers = np.flatnonzero(kept)
    assert track.rows.tolist() == np.column_stack([numbers, -numbers]).tolist()
    assert track.last_ns == stamps[-1]
    assert len(track) == kept.sum()


def test_it_takes_no_more_room_than_what_is_kept_needs() -> None:
    track = RecentTrack(1)
    for number in range(100_000):
        track.add(number, (number,))
        track.forget(len(track) - 300)
    assert track.rows.base is not None
    assert len(track.rows.base) < 2000


def test_a_stamp_that_is_not_after_the_last_is_refused_until_all_is_forgotten() -> None:
    track = RecentTrack(1)
    track.add(5, (1.0,))
    with pytest.raises(ValueError, match="stamp 5 is not after 5"):
        track.add(5, (2.0,))
    track.clear()
    track.add(5, (2.0,))
    assert track.rows.tolist() == [[2.0]]


def test_to_forget_less_than_nothing_forgets_nothing() -> None:
    track = RecentTrack(1)
    track.add(5, (1.0,))
    track.forget(-3)
    assert (len(track), track.last_ns) == (1, 5)
