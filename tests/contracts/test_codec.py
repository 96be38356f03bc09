"""Messages survive the wire; anything that is no message of this version is refused as such."""

from __future__ import annotations

import errno
import struct
import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.codec import (
    MOST_SENDER,
    SCHEMA_VERSION,
    SchemaMismatch,
    content_bytes,
    content_parts,
    decode,
    encode,
    header_of,
    read_given,
    read_message,
    sender_of,
    write_message,
)
from foretwin.contracts.drive import GnssFix, PlannedTrajectory, SpeedSample, VehicleInfo
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.futures import FuturesResult
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from tests.contracts.bus_sides import DEADLINE_S
from tests.contracts.messages import messages, same

COVERS = (
    "foretwin.contracts.arrays",
    "foretwin.contracts.drive",
    "foretwin.contracts.provenance",
    "foretwin.contracts.side_by_side",
    "foretwin.contracts.signals",
    "foretwin.contracts.simulation",
    "foretwin.contracts.towards_vehicle",
    "foretwin.contracts.tuning",
)

KINDS = {channel.kind for channel in CHANNELS.values()}
KINDS |= {channel.reply for channel in CHANNELS.values() if channel.reply is not None}
KINDS |= {World, VehicleParameters}

PLAN = PlannedTrajectory(
    stamp_ns=12,
    time_from_stamp_s=np.array([0.0, 0.1]),
    lat_deg=np.array([52.1, 52.2]),
    lon_deg=np.array([13.1, 13.2]),
    yaw_rad=np.array([0.0, np.nan]),
    speed_mps=np.array([3.0, 4.0]),
)


@pytest.mark.parametrize("kind", sorted(KINDS, key=lambda kind: kind.__name__))
@given(data=st.data())
@settings(max_examples=10, deadline=None)
def test_every_message_survives_the_wire(kind: type, data: st.DataObject) -> None:
    message = data.draw(messages(kind))

    envelope = decode(encode(message, seq=7, sent_ns=-3), kind)

    assert same(envelope.message, message)
    assert (envelope.seq, envelope.sent_ns) == (7, -3)
    assert b"".join(content_parts(message)) == content_bytes(message)


def test_a_sender_is_told_by_two_bytes_and_may_stay_untold() -> None:
    fix = GnssFix(stamp_ns=1, position=GeoPoint(52.0, 13.0))
    assert MOST_SENDER == 65_535
    assert sender_of(encode(fix, sender=MOST_SENDER)) == MOST_SENDER
    assert sender_of(encode(fix)) == 0
    assert header_of(encode(fix), where="") == (0, 0)
    with pytest.raises(struct.error):
        encode(fix, sender=MOST_SENDER + 1)
    assert sender_of(b"FTw1") == 0, "no header at all"


def test_equal_messages_have_equal_content_whatever_their_header() -> None:
    fix = GnssFix(stamp_ns=1, position=GeoPoint(52.0, 13.0))
    again = decode(encode(fix, seq=9, sent_ns=5), GnssFix).message

    assert content_bytes(again) == content_bytes(fix)
    assert content_bytes(GnssFix(stamp_ns=2, position=fix.position)) != content_bytes(fix)


@pytest.mark.parametrize("array", [np.ones((2, 3))[:, ::2], np.arange(3, dtype=">f8")])
def test_arrays_of_any_layout_arrive_contiguous_and_little_endian(array: np.ndarray) -> None:
    plan = PlannedTrajectory(
        stamp_ns=0,
        time_from_stamp_s=array,
        lat_deg=array,
        lon_deg=array,
        yaw_rad=array,
        speed_mps=array,
    )

    arrived = decode(encode(plan), PlannedTrajectory).message.yaw_rad

    assert arrived.dtype == np.dtype("<f8")
    assert np.array_equal(arrived, array)


def test_arrays_of_anything_but_plain_numbers_are_refused() -> None:
    plan = msgspec.structs.replace(PLAN, yaw_rad=np.array([1j]))

    with pytest.raises(SchemaMismatch, match="array of type '<c16' is refused"):
        decode(encode(plan), PlannedTrajectory)


@pytest.mark.parametrize("given", [[0.5, 1.0], [0.5, 1.0, 2.0], 1.0])
def test_lists_and_numbers_in_place_of_an_array_are_named(given: object) -> None:
    plan = msgspec.structs.replace(PLAN, yaw_rad=given)

    with pytest.raises(SchemaMismatch, match=r"an array of numpy is wanted.*`\$.yaw_rad`"):
        decode(encode(plan), PlannedTrajectory)


def test_another_schema_version_is_refused_with_both_versions_named() -> None:
    data = bytearray(encode(SpeedSample(stamp_ns=1, speed_mps=2.0)))
    struct.pack_into("<H", data, 4, SCHEMA_VERSION + 1)

    with pytest.raises(SchemaMismatch) as caught:
        decode(bytes(data), SpeedSample, where="foretwin/v1/vehicle/ego/telemetry/speed")

    assert str(caught.value) == (
        "foretwin/v1/vehicle/ego/telemetry/speed: schema version 3; this foretwin reads version 2"
    )


@pytest.mark.parametrize("data", [b"", b"FTw1", b"\x00" * 24, b"<osm>" + b"." * 100])
def test_other_data_is_no_message(data: bytes) -> None:
    with pytest.raises(SchemaMismatch, match="not a foretwin message"):
        decode(data, SpeedSample)


def test_a_message_of_another_type_is_refused_by_name() -> None:
    data = encode(GnssFix(stamp_ns=1, position=GeoPoint(0.0, 0.0)))

    with pytest.raises(SchemaMismatch, match="no valid SpeedSample"):
        decode(data, SpeedSample)


@given(where=st.integers(0, 10_000), byte=st.integers(0, 255), cut=st.integers(0, 400))
def test_corrupted_bytes_are_a_schema_mismatch_or_another_message(
    where: int, byte: int, cut: int
) -> None:
    data = bytearray(encode(PLAN))
    data[where % len(data)] = byte
    data = data[: len(data) - cut] if cut % 2 else data

    try:
        message = decode(bytes(data), PlannedTrajectory).message
    except SchemaMismatch:
        return
    assert isinstance(message, PlannedTrajectory)


@given(body=st.binary(max_size=200))
def test_random_bodies_raise_nothing_but_schema_mismatch(body: bytes) -> None:
    header = encode(PLAN)[:24]
    for kind in (PlannedTrajectory, FuturesResult, World):
        with pytest.raises(SchemaMismatch):
            decode(header + body, kind)


def test_deeply_nested_bodies_are_refused() -> None:
    with pytest.raises(SchemaMismatch):
        decode(encode(PLAN)[:24] + b"\x91" * 100_000, PlannedTrajectory)


@pytest.mark.parametrize("count", [0, 15, 16, 255, 256, 257, 40_000, 70_000])
def test_parts_of_long_fields_are_those_of_the_whole(count: int) -> None:
    info = VehicleInfo(
        vehicle_id="car",
        time_base="utc",
        start_stamp_ns=0,
        sends=tuple(f"channel {i}" for i in range(count)),
    )
    parts = list(content_parts(info))

    assert b"".join(parts) == content_bytes(info)
    assert max(map(len, parts)) < 5_000


def test_files_hold_one_whole_message(tmp_path: Path) -> None:
    path = tmp_path / "plan.bin"

    write_message(PLAN, path)

    assert same(read_message(path, PlannedTrajectory), PLAN)
    assert [p.name for p in tmp_path.iterdir()] == ["plan.bin"]
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(SchemaMismatch, match=r"plan\.bin"):
        read_message(path, PlannedTrajectory)


def test_only_structs_and_arrays_can_be_sent() -> None:
    with pytest.raises(TypeError, match="type object cannot be sent"):
        encode(SpeedSample(stamp_ns=1, speed_mps=object()))  # type: ignore[arg-type]


def test_a_disk_without_room_is_left_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_message(PLAN, tmp_path / "plan")

    def no_room(self: Path, mode: str) -> None:
        self.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(Path, "open", no_room)
        with pytest.raises(OSError, match="No space left"):
            write_message(PLAN, tmp_path / "plan")
    assert [path.name for path in tmp_path.iterdir()] == ["plan"]
    assert same(read_message(tmp_path / "plan", type(PLAN)), PLAN)


AT_ONCE = """
import threading
import msgspec
from foretwin.contracts.codec import content_bytes, decode_content

begun, done = threading.Event(), threading.Event()

def held():
    begun.set()
    done.wait(0.5)
    return int

class Leaf(msgspec.Struct):
    number: "held()"

class Middle(msgspec.Struct):
    leaf: Leaf

class One(msgspec.Struct):
    middle: Middle

class Two(msgspec.Struct):
    middle: Middle

data = content_bytes(One(Middle(Leaf(3))))

def other():
    begun.wait()
    assert decode_content(data, Two, where="two") == Two(Middle(Leaf(3)))
    done.set()

thread = threading.Thread(target=other)
thread.start()
assert decode_content(data, One, where="one") == One(Middle(Leaf(3)))
thread.join()
"""
"""Two threads that decode for the first time what has a type in common, one while msgspec still
asks the other's for its fields."""


def test_threads_that_meet_a_type_for_the_first_time_decode_it() -> None:
    ended = subprocess.run(
        [sys.executable, "-P", "-c", AT_ONCE], capture_output=True, text=True, timeout=DEADLINE_S
    )

    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_file_that_a_user_named_is_named_first_where_it_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=rf"^{tmp_path}/none\.world: No such file or directory$"):
        read_given(tmp_path / "none.world", World)
    with pytest.raises(UserError, match=rf"^{tmp_path}: Is a directory$"):
        read_given(tmp_path, World)
