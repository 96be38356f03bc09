"""The antenna's place and the receiver's lateness: found in turns, with what is left unknown."""

from __future__ import annotations

import functools

import msgspec
import pytest

from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.mounting import Mounting
from tests.telemetry.city_drive import city_drive
from tests.telemetry.impaired import BAD, ForeignClock, impaired

LATE_S = 0.1


@functools.cache
def heard(
    *, late_s: float = 0.0, seed: int = 3, until_s: float = 1e3, network: bool = False
) -> Mounting:
    """What the town's drive tells whose fixes are stamped so late."""
    drive = city_drive(seed=seed)
    first_ns = drive.samples[0][1].stamp_ns
    samples = [
        (channel, msgspec.structs.replace(said, stamp_ns=said.stamp_ns + round(late_s * 1e9)))
        if channel == "gnss"
        else (channel, said)
        for channel, said in drive.samples
        if said.stamp_ns < first_ns + until_s * 1e9
    ]
    samples.sort(key=lambda sample: sample[1].stamp_ns)
    estimator = StateEstimator(drive.source.info)
    if network:
        for channel, said, at in impaired(samples, BAD, clock=ForeignClock()):
            estimator.handle(channel, said, received_ns=at)
    else:
        for channel, said in samples:
            estimator.handle(channel, said)
    return estimator.consistency.mounting


@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.judge)])
@pytest.mark.parametrize("late_s", [0.0, LATE_S])
def test_turns_show_the_antenna_and_the_clock_within_what_is_said_of_them(
    seed: int, late_s: float
) -> None:
    info = city_drive(seed=seed).source.info
    assert info.body_from_antenna_m is not None
    found = heard(late_s=late_s, seed=seed)
    for learnt, true in (
        (found.antenna_forward_m, info.body_from_antenna_m[0]),
        (found.antenna_left_m, info.body_from_antenna_m[1]),
        (found.fixes_late_s, late_s),
    ):
        assert learnt.observable
        assert abs(learnt.value - true) < 2.0 * learnt.std
    assert found.fixes_late_s.std < 0.02
    assert found.antenna_forward_m.std < 0.2


def test_before_a_turn_nothing_is_claimed() -> None:
    found = heard(until_s=12.0)
    assert found.turns == 0
    for learnt in (found.antenna_forward_m, found.antenna_left_m, found.fixes_late_s):
        assert not learnt.observable


def test_a_bad_network_tells_the_same() -> None:
    by_log, by_network = heard(late_s=LATE_S), heard(late_s=LATE_S, network=True)
    assert by_network.turns >= 2
    assert abs(by_network.fixes_late_s.value - by_log.fixes_late_s.value) < 0.03
    assert abs(by_network.antenna_forward_m.value - by_log.antenna_forward_m.value) < 0.3
