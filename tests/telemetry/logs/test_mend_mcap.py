"""Recordings whose writer was killed: cut to what is whole, and read by any MCAP reader."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.mend_mcap import look_through, mend
from foretwin.telemetry.logs.opening import open_log
from foretwin.telemetry.logs.write_mcap import create

SECONDS = 8


def write(path: Path) -> list[int]:
    """Write a drive of a fix a second, each in a chunk of its own; returns where each ends."""
    ends = []
    with create(path) as writer:
        for second in range(SECONDS):
            place = GeoPoint(50.0, 8.0 + 1e-4 * second)
            writer.add("gnss", GnssFix(stamp_ns=second * 1_000_000_000, position=place))
            writer.flush()
            ends.append(path.stat().st_size)
    return ends


def messages(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())


@given(st.data())
def test_wherever_a_recording_is_cut_what_is_whole_before_it_is_read(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "drive.mcap")
        ends = write(path)
        cut = data.draw(st.integers(0, path.stat().st_size - 1), label="cut")
        os.truncate(path, cut)
        found = mend(path)

        assert found.messages >= sum(end <= cut for end in ends)
        assert found.last_ns == max(0, found.messages - 1) * 1_000_000_000
        if found.data_bytes:
            assert messages(path) == found.messages
            assert look_through(path).ended
            assert mend(path) == look_through(path)


def test_a_whole_recording_is_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    write(path)
    before = path.read_bytes()
    found = mend(path)

    assert (found.messages, found.torn_bytes, found.ended) == (SECONDS, 0, True)
    assert path.read_bytes() == before


def test_a_recording_without_its_index_alone_has_lost_nothing(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    write(path)
    os.truncate(path, path.stat().st_size - 5)
    found = mend(path)

    assert (found.messages, found.torn_bytes, found.ended) == (SECONDS, 0, False)
    assert messages(path) == SECONDS
    assert sum(1 for _ in open_log(path).samples()) == SECONDS


@pytest.mark.parametrize(
    ("at", "damage"),
    [(60, bytes(30)), (60, b"\xff" * 30), (33, b"\x5a" * 4)],
    ids=["zeros", "ones", "another checksum"],
)
def test_a_damaged_chunk_ends_a_recording_that_was_not_ended(
    tmp_path: Path, at: int, damage: bytes
) -> None:
    path = tmp_path / "drive.mcap"
    ends = write(path)
    data = bytearray(path.read_bytes()[: ends[-1]])
    data[ends[3] + at : ends[3] + at + len(damage)] = damage  # in the fifth chunk
    path.write_bytes(data)

    assert mend(path).messages == 4
    assert messages(path) == 4


@pytest.mark.parametrize("garbage", [bytes(9000), b"\xff" * 9000], ids=["zeros", "ones"])
def test_what_never_came_to_the_disk_is_cut_off(tmp_path: Path, garbage: bytes) -> None:
    path = tmp_path / "drive.mcap"
    ends = write(path)
    path.write_bytes(path.read_bytes()[: ends[-1]] + garbage)
    found = mend(path)

    assert (found.messages, found.torn_bytes) == (SECONDS, len(garbage))
    assert messages(path) == SECONDS
