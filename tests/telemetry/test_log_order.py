"""Whatever a source does, samples come in stamp order, and nothing vanishes uncounted."""

from __future__ import annotations

from collections import Counter

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import (
    GnssFix,
    ImuSample,
    RoadUser,
    RoadUsers,
    SignalState,
    SpeedSample,
    VehicleInfo,
)
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.log import ROAD_USER_ODD, Log, Sample, screened
from foretwin.telemetry.logs.merge import merged, reordered, stamp_ns_of

COVERS = (
    "foretwin.telemetry.logs.log",
    "foretwin.telemetry.logs.merge",
)


def speed(stamp_ns: int) -> Sample:
    return "speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=1.0)


def fix(stamp_ns: int, lat_deg: float = 52.5) -> Sample:
    return "gnss", GnssFix(stamp_ns=stamp_ns, position=GeoPoint(lat_deg, 13.4))


def turning(stamp_ns: int) -> Sample:
    return "imu", ImuSample(
        stamp_ns=stamp_ns, accel_mps2=(0.0, 0.0, 9.8), rate_radps=(0.0, 0.0, 0.1)
    )


dirty = st.lists(
    st.builds(turning, st.integers(-2, 30))
    | st.builds(speed, st.integers(-2, 30))
    | st.builds(fix, st.integers(-2, 30), st.sampled_from([52.5, float("nan"), 91.0])),
    max_size=30,
)


@given(dirty)
def test_order_is_kept_and_every_loss_counted(samples: list[Sample]) -> None:
    skipped: Counter[str] = Counter()
    kept = list(screened(iter(samples), skipped))
    stamps = [stamp_ns_of(sample) for sample in kept]
    assert stamps == sorted(stamps)
    assert len({(channel, message.stamp_ns) for channel, message in kept}) == len(kept)  # type: ignore[attr-defined]
    assert len(kept) + skipped.total() == len(samples)


@given(dirty)
def test_of_an_instant_speed_comes_first_and_positions_last(samples: list[Sample]) -> None:
    info = VehicleInfo(vehicle_id="car", time_base="log", start_stamp_ns=0)
    given_out = list(Log(info=info, read=lambda skipped: iter(samples)).samples())
    kept = list(screened(iter(samples), Counter()))
    ranks = {"speed": 0, "imu": 1, "gnss": 2}
    assert given_out == sorted(kept, key=lambda one: (stamp_ns_of(one), ranks[one[0]]))


@given(st.lists(st.integers(0, 1000), max_size=40), st.lists(st.integers(0, 1000), max_size=40))
def test_merging_sorted_streams_loses_nothing(first: list[int], second: list[int]) -> None:
    both = list(merged(map(speed, sorted(first)), map(fix, sorted(second))))
    assert [stamp_ns_of(sample) for sample in both] == sorted(first + second)


@given(st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 50)), max_size=60))
def test_lateness_within_the_window_is_put_right(sent: list[tuple[int, int]]) -> None:
    arrived = sorted(sent, key=lambda item: item[0] + item[1])
    out = list(reordered([speed(stamp) for stamp, _ in arrived], window_ns=50))
    assert [stamp_ns_of(sample) for sample in out] == sorted(stamp for stamp, _ in sent)


def test_signals_of_several_groups_share_a_stamp() -> None:
    skipped: Counter[str] = Counter()
    both: list[Sample] = [
        ("signals", SignalState(stamp_ns=5, group_id=group, colour="red")) for group in "aab"
    ]
    assert len(list(screened(iter(both), skipped))) == 2
    assert skipped == {"time doubled": 1}


def test_a_log_passes_the_guard_that_live_messages_pass() -> None:
    good = RoadUser(
        user_id="7", kind="car", position=GeoPoint(52.5, 13.4), yaw_rad=0.0, speed_mps=1.0,
        length_m=4.0, width_m=1.8,
    )  # fmt: skip
    odd = msgspec.structs.replace(good, width_m=0.0)
    skipped: Counter[str] = Counter()
    seen = RoadUsers(stamp_ns=2, users=(good, odd))
    samples = [("speed", SpeedSample(stamp_ns=1, speed_mps=1e6)), ("objects", seen)]

    assert list(screened(iter(samples), skipped)) == [
        ("objects", RoadUsers(stamp_ns=2, users=(good,)))
    ]
    assert skipped == {"SpeedSample: speed_mps out of bounds": 1, ROAD_USER_ODD: 1}
