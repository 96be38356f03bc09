"""Two recordings of one drive, by clocks that differ: by how much, and when nobody can say."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Stamps
from foretwin.telemetry.logs.clock_between import clock_between
from foretwin.telemetry.logs.columns import Stream, table_log
from foretwin.telemetry.logs.log import Log, LogError, Sample
from foretwin.telemetry.logs.merge import together
from tests.telemetry.logs import merge_pairs
from tests.telemetry.logs.declare.disguised import Drive

COVERS = ("foretwin.telemetry.logs.merge", "foretwin.telemetry.logs.clock_evenness")


def drive(*, lasts_s: float = 420.0, busy: float = 1.0) -> Drive:
    """Wheels and a gyro, of a drive that never comes back to the same bends and brakes."""
    time_s = np.arange(0.0, lasts_s, 0.05)
    stamps = np.round(time_s * 1e9).astype(np.int64)
    speed = 10.0 + busy * (3.0 * np.sin(time_s**1.3 / 9.0) + 2.0 * np.sin(time_s / 4.1))
    turn = busy * (0.2 * np.sin(time_s**1.2 / 7.0) + 0.1 * np.sin(time_s / 2.9))
    still = np.zeros(len(time_s))
    axes = dict.fromkeys(("accel_x", "accel_y", "accel_z", "rate_x", "rate_y"), still)
    return {
        "imu": Stream(stamps, axes | {"rate_z": turn}),
        "speed": Stream(stamps, {"forward": speed}),
    }


def recording(
    of: Drive, *names: str, offset_s: float = 0.0, ppm: float = 0.0, noise: float = 0.0, source: str
) -> Log:
    random = np.random.default_rng(3)

    def late_of(stamps_ns: Stamps) -> Stamps:
        return np.round(1e9 * offset_s + stamps_ns * ppm * 1e-6).astype(np.int64)

    moved = {
        name: Stream(
            of[name].stamps_ns + late_of(of[name].stamps_ns),
            {field: values + random.normal(0.0, noise, len(values))
             for field, values in of[name].columns.items()},
        )
        for name in names
    }  # fmt: skip
    first = moved[names[0]].stamps_ns
    return table_log(source, moved, stamps_ns=first, time_base="boot", reference_point="unknown")  # type: ignore[arg-type]


@pytest.mark.parametrize("offset_s", [0.0, 1234.567, 60.018])
def test_offset_is_found_within_its_deviation(offset_s: float) -> None:
    whole = drive()
    first = recording(whole, "imu", "speed", source="A", noise=0.02)
    second = recording(whole, "speed", source="B", offset_s=offset_s, noise=0.1)
    clock = clock_between(first, second)
    assert clock.offset_s == pytest.approx(offset_s, abs=max(3.0 * clock.std_s, 0.03))
    assert clock.std_s < 0.05
    assert clock.drift_ppm == 0.0


def test_drift_is_found_and_stamps_come_back() -> None:
    whole = drive(lasts_s=900.0)
    first = recording(whole, "imu", "speed", source="A")
    second = recording(whole, "imu", source="B", offset_s=50.0, ppm=200.0)
    clock = clock_between(first, second)
    assert clock.drift_ppm == pytest.approx(200.0, abs=3.0 * clock.drift_std_ppm)
    assert clock.std_s < 0.02  # a drift that was found is no unevenness
    back = clock.first_from_second(first.info.start_stamp_ns)
    for at_s in (10.0, 450.0, 890.0):
        theirs_ns = round(at_s * 1e9 * (1.0 + 200e-6) + 50e9)
        assert back(theirs_ns) == pytest.approx(at_s * 1e9, abs=30e6)


def test_stretches_that_differ_as_their_noise_does_are_no_unevenness() -> None:
    whole = drive(lasts_s=900.0)
    first = recording(whole, "speed", source="A")
    second = recording(whole, "speed", source="B", offset_s=5.0, noise=2.0)
    clock = clock_between(first, second)
    assert clock.offset_s == pytest.approx(5.0, abs=3.0 * clock.std_s)
    assert clock.std_s < 0.02


def that_leaps(of: Drive, *, by_s: float, at_s: float) -> Drive:
    return {
        name: Stream(
            one.stamps_ns + np.where(one.stamps_ns > at_s * 1e9, round(by_s * 1e9), 0), one.columns
        )
        for name, one in of.items()
    }


@pytest.mark.parametrize(
    ("jump_s", "at_s"),
    [(0.2, 270.0), (-0.3, 450.0), (0.3, 720.0), (0.5, 600.0), (1.0, 300.0), (2.0, 450.0)],
)
def test_a_clock_that_leaps_is_refused_and_it_is_told_where(jump_s: float, at_s: float) -> None:
    whole = drive(lasts_s=900.0)
    first = recording(whole, "imu", "speed", source="A", noise=0.02)
    late = that_leaps(whole, by_s=jump_s, at_s=at_s)
    second = recording(late, "speed", source="B", offset_s=50.0, noise=0.1)
    with pytest.raises(LogError) as caught:
        clock_between(first, second)
    told = re.fullmatch(
        r"B: its clock leaps by ([+-]\S+) s beside A's between (\d+) and (\d+) s into that; cut it"
        " there",
        str(caught.value),
    )
    if told is None:  # a jump so long and early leaves two offsets that fit
        assert abs(jump_s) >= 1.0
        assert re.match("B: (its clock|more than one offset)", str(caught.value))
        return
    assert float(told[1]) == pytest.approx(jump_s, rel=0.2)
    assert float(told[2]) < at_s + 90.0
    assert float(told[3]) > at_s - 90.0


def test_a_leap_that_passes_for_a_drift_is_none_of_a_clock() -> None:
    whole = drive()
    first = recording(whole, "imu", "speed", source="A", noise=0.02)
    late = that_leaps(whole, by_s=0.5, at_s=126.0)
    second = recording(late, "speed", source="B", offset_s=50.0, noise=1.0)
    with pytest.raises(LogError, match=r"B: its clock (drifts by \+\d+ ppm|leaps|does not run)"):
        clock_between(first, second)


def test_what_the_first_lacks_is_taken_on_its_clock() -> None:
    whole = drive()
    first = recording(whole, "imu", source="A")
    second = recording(whole, "speed", "imu", source="B", offset_s=7.0)
    clock = clock_between(first, second)
    joined = together(first, second, stamp_ns=clock.first_from_second(first.info.start_stamp_ns))
    assert joined.info.sends == ("imu", "speed")
    samples: list[Sample] = list(joined.samples())
    assert Counter(name for name, _ in samples)["imu"] == len(whole["imu"].stamps_ns)
    stamps = [message.stamp_ns for _, message in samples]  # type: ignore[attr-defined]
    assert stamps == sorted(stamps)
    speeds = [(m.stamp_ns * 1e-9, m.speed_mps) for name, m in samples if name == "speed"]  # type: ignore[attr-defined]
    at, speed = np.array(speeds).T
    true = np.interp(at, whole["speed"].stamps_ns * 1e-9, whole["speed"].columns["forward"])
    assert np.abs(speed - true).max() < 0.15


def test_a_recording_that_began_earlier_is_laid_where_it_belongs() -> None:
    whole = drive()
    stamps = whole["imu"].stamps_ns
    late = {"imu": Stream(stamps[1200:], {n: v[1200:] for n, v in whole["imu"].columns.items()})}
    first = recording(late, "imu", source="A")
    second = recording(whole, "imu", "speed", source="B", offset_s=3.0)
    clock = clock_between(first, second)
    assert clock.offset_s == pytest.approx(3.0, abs=0.03)
    joined = together(first, second, stamp_ns=clock.first_from_second(first.info.start_stamp_ns))
    speeds = [message.stamp_ns for name, message in joined.samples() if name == "speed"]  # type: ignore[attr-defined]
    assert min(speeds) == pytest.approx(60e9, abs=60e6)


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        (("imu",), ("speed",), "nothing to compare clocks by: A tells turning, it tells speed"),
        (("speed",), ("other",), "no offset of its clock makes it the drive of A"),
        (("round",), ("round",), "more than one offset of its clock fits"),
    ],
)
def test_where_nothing_tells_it_is_refused(
    first: tuple[str, ...], second: tuple[str, ...], told: str
) -> None:
    whole = drive()
    stamps = whole["speed"].stamps_ns
    random = np.random.default_rng(1).normal(size=len(stamps))
    smooth = np.convolve(random, np.ones(60) / 8.0, mode="same")
    circles = {"forward": 10.0 + 2.0 * np.sin(stamps * 1e-9 / 5.0)}

    def recorded(names: tuple[str, ...], source: str) -> Log:
        own = {"other": {"forward": 10.0 + smooth}, "round": circles}
        of = whole | {"speed": Stream(stamps, own.get(names[0], whole["speed"].columns))}
        return recording(of, *(name if name == "imu" else "speed" for name in names), source=source)

    with pytest.raises(LogError, match=told) as caught:
        clock_between(recorded(first, "A"), recorded(second, "B"))
    assert "\n" not in str(caught.value)


def test_an_empty_recording_is_refused() -> None:
    def nothing(_: Counter[str]) -> Iterator[Sample]:
        return iter(())

    full = recording(drive(), "imu", source="A")
    empty = Log(info=msgspec.structs.replace(full.info, source="B"), read=nothing)
    with pytest.raises(LogError, match="B: nothing to compare clocks by"):
        clock_between(full, empty)


@pytest.mark.judge
@pytest.mark.real_data
@pytest.mark.usefixtures("data_dir")
def test_of_real_pairs_no_offset_is_wrong_and_no_stranger_is_taken(
    capsys: pytest.CaptureFixture[str],
) -> None:
    code = merge_pairs.main(["--seed", "7"])
    table = capsys.readouterr().out
    assert code == 0, table
    assert table.count("r = ") >= 12
