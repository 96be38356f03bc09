"""What came and what is missing, by the senders' numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts import tally as module
from foretwin.contracts.tally import (
    RESERVED_BYTES,
    Numbering,
    Numberings,
    Tally,
    read_tally,
    tally_file,
    write_tally,
)


@given(st.lists(st.integers(0, 60), max_size=120))
def test_each_number_counts_once_and_the_rest_is_missing(seqs: list[int]) -> None:
    numberings = Numberings()
    new = [numberings.take("imu", 7, seq) for seq in seqs]
    later = {seq for seq in seqs if seq >= seqs[0]}  # before the first one nothing was expected
    assert sum(new) == len(later)
    assert numberings.published["imu"] == numberings.missing["imu"] + len(later)


def test_a_sender_that_begins_anew_is_another_one() -> None:
    numberings = Numberings()
    told = [numberings.take("imu", sender, seq) for sender in (7, 8) for seq in (0, 1, 1, 3)]
    assert told == [True, True, False, True] * 2
    assert (numberings.published["imu"], numberings.missing["imu"]) == (8, 2)


def test_who_does_not_tell_who_it_is_may_begin_anew_all_the_same() -> None:
    numberings = Numberings()
    assert all(numberings.take("imu", 0, seq) for seq in (5, 6, 7, 0, 1, 0))
    assert (numberings.published["imu"], numberings.missing["imu"]) == (6, 0)


def test_what_a_sender_says_it_sent_is_missing_until_it_comes() -> None:
    numberings = Numberings()
    numberings.reach("imu", 7, 5)
    assert numberings.missing["imu"] == 5
    assert numberings.take("imu", 7, 2)
    numberings.reach("imu", 7, 3)
    assert (numberings.published["imu"], numberings.missing["imu"]) == (5, 4)


def test_more_holes_than_are_kept_still_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_HOLES", 10)
    numbering = Numbering("imu", 0, 0)
    for seq in range(0, 100, 2):
        numbering.take(seq)
    assert (len(numbering.holes), numbering.missing) == (10, 49)
    assert not numbering.take(1), "given up"
    assert numbering.take(97)


def test_a_tally_survives_and_takes_the_room_that_it_has(tmp_path: Path) -> None:
    path = tally_file(tmp_path / "drive.mcap")
    assert read_tally(path) is None
    tally = Tally()
    assert [tally.settle("recorded", "imu", 7, seq) for seq in (0, 3)] == [1, 2]
    tally.settle("unwritten", "imu", 7, 4)
    write_tally(tally, path)
    assert path.name == "drive.tally.json"
    assert path.stat().st_size == RESERVED_BYTES
    assert read_tally(path) == tally
    write_tally(Tally(), path)
    assert read_tally(path) == Tally()
    path.write_bytes(b"{")
    assert read_tally(path) is None
