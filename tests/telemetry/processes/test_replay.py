from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import GnssFix, SpeedSample, VehicleInfo
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.log import Log, Sample
from foretwin.telemetry.processes.replay import ReplaySource

SECOND_NS = 1_000_000_000
START_NS = 50 * SECOND_NS


INFO = VehicleInfo(
    vehicle_id="as recorded",
    time_base="log",
    start_stamp_ns=START_NS,
    end_stamp_ns=START_NS + 60 * SECOND_NS,
    source="minute.log",
)


def recorded_minute(extra: tuple[Sample, ...] = ()) -> Log:
    """Positions each second and speeds each half, from 50 s of the clock on."""

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        skipped["unreadable row"] += 2
        for half in range(121):
            stamp = START_NS + half * SECOND_NS // 2
            if half % 2 == 0:
                position = GeoPoint(52.5 + half * 1e-5, 13.4)
                yield "gnss", GnssFix(stamp_ns=stamp, position=position)
            yield "speed", SpeedSample(stamp_ns=stamp, speed_mps=float(half))
            if half == 20:
                yield from extra

    return Log(info=INFO, read=read)


def stamps(source: ReplaySource, until_s: float) -> list[float]:
    until_ns = START_NS + round(until_s * SECOND_NS)
    return [(m.stamp_ns - START_NS) / SECOND_NS for _, m in source.advance(until_ns)]


def test_it_gives_everything_once_up_to_and_including_the_stamp() -> None:
    source = ReplaySource(recorded_minute(), vehicle_id="car")
    assert source.next_stamp_ns == START_NS
    assert stamps(source, 1.0) == [0.0, 0.0, 0.5, 1.0, 1.0]
    assert stamps(source, 1.0) == []
    assert source.next_stamp_ns == START_NS + 1.5 * SECOND_NS
    assert stamps(source, 1.9) == [1.5]
    assert not source.ended
    assert stamps(source, 100.0)[-1] == 60.0
    assert source.ended


@given(st.lists(st.floats(0.0, 70.0), max_size=12))
def test_the_steps_do_not_matter(steps: list[float]) -> None:
    whole = list(ReplaySource(recorded_minute(), vehicle_id="car").advance(START_NS + 10**12))
    source = ReplaySource(recorded_minute(), vehicle_id="car")
    parts = [
        sample
        for until_s in [*sorted(steps), 70.0]
        for sample in source.advance(START_NS + round(until_s * SECOND_NS))
    ]
    assert parts == whole


def test_a_part_keeps_the_stamps_and_the_drive_time_of_the_log() -> None:
    source = ReplaySource(recorded_minute(), vehicle_id="car", start_s=10.0, end_s=12.0)
    assert source.info.vehicle_id == "car"
    assert source.info.start_stamp_ns == START_NS
    assert source.info.end_stamp_ns == START_NS + 12 * SECOND_NS
    assert source.first_stamp_ns == START_NS + 10 * SECOND_NS
    assert sorted(set(stamps(source, 60.0))) == [10.0, 10.5, 11.0, 11.5, 12.0]
    assert source.ended


def test_what_the_log_refuses_is_not_given_and_counted() -> None:
    at = START_NS + 10 * SECOND_NS
    dirty = (
        ("gnss", GnssFix(stamp_ns=at, position=GeoPoint(math.nan, 13.4))),
        ("gnss", GnssFix(stamp_ns=at, position=GeoPoint(0.0, 0.0))),
        ("speed", SpeedSample(stamp_ns=START_NS, speed_mps=1.0)),
    )
    source = ReplaySource(recorded_minute(dirty), vehicle_id="car")
    clean = ReplaySource(recorded_minute(), vehicle_id="car")
    end = START_NS + 10**12
    assert list(source.advance(end)) == list(clean.advance(end))
    assert (source.skipped_invalid, clean.skipped_invalid) == (5, 2)


@pytest.mark.parametrize(
    ("start_s", "end_s", "complaint"),
    [
        (-1.0, None, "start must be before"),
        (5.0, 5.0, "start must be before"),
        (61.0, None, "minute.log holds no sample"),
    ],
)
def test_times_that_hold_nothing_are_refused(
    start_s: float, end_s: float | None, complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        ReplaySource(recorded_minute(), vehicle_id="car", start_s=start_s, end_s=end_s)
