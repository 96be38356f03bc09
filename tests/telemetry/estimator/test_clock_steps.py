"""Clocks that jump: time goes on, after a second of stamps that agree."""

from __future__ import annotations

import pytest

from foretwin.telemetry.estimator.clock import ClockEstimator
from foretwin.telemetry.estimator.clock_steps import ClockSteps

START_NS = 1_700_000_000_000_000_000
MONO_NS = 7_000_000_000
STEP_NS = 100_000_000


class Listener:
    """Hears samples at 10 Hz, on time; the receiver's clock may be left out."""

    def __init__(self, *, with_receipt: bool) -> None:
        self.clock = ClockEstimator()
        self.steps = ClockSteps(self.clock)
        self._with_receipt = with_receipt
        self._count = 0

    def hear(self, *, jump_ns: int = 0, count: int = 1, channel: str = "gnss") -> list[int | None]:
        """Return where each of the samples is placed, relative to the true time."""
        placed = []
        for _ in range(count):
            true_ns = START_NS + self._count * STEP_NS
            received_ns = MONO_NS + self._count * STEP_NS if self._with_receipt else None
            self._count += 1
            at_ns = self.steps.place(channel, true_ns + jump_ns, received_ns)
            if at_ns is not None and received_ns is not None:
                self.clock.handle(at_ns, received_ns)
            placed.append(None if at_ns is None else at_ns - true_ns)
        return placed


@pytest.mark.parametrize("with_receipt", [False, True])
def test_a_steady_clock_is_left_as_it_is(with_receipt: bool) -> None:
    listener = Listener(with_receipt=with_receipt)
    assert listener.hear(count=50) == [0] * 50
    assert listener.steps.steps == []


@pytest.mark.parametrize("with_receipt", [False, True])
def test_after_a_second_behind_the_new_clock_is_accepted(with_receipt: bool) -> None:
    listener = Listener(with_receipt=with_receipt)
    listener.hear(count=40)
    back_ns = -3600_000_000_000
    placed = listener.hear(jump_ns=back_ns, count=30)
    doubtful = None if with_receipt else back_ns
    assert placed[:10] == [doubtful] * 10
    assert placed[10:] == [0] * 20
    (step,) = listener.steps.steps
    assert step.step_ns == back_ns
    assert listener.steps.shift_ns("gnss") == -back_ns


def test_a_step_ahead_is_seen_by_the_receivers_clock() -> None:
    listener = Listener(with_receipt=True)
    listener.hear(count=40)
    placed = listener.hear(jump_ns=5_000_000_000, count=30)
    assert placed[:10] == [None] * 10
    assert placed[10:] == [0] * 20
    assert listener.steps.steps[0].step_ns == 5_000_000_000


@pytest.mark.parametrize("with_receipt", [False, True])
def test_what_one_channel_has_confirmed_the_others_take_over(with_receipt: bool) -> None:
    listener = Listener(with_receipt=with_receipt)
    for _ in range(20):
        listener.hear(channel="imu")
        listener.hear(channel="gnss")
    back_ns = -50_000_000_000
    listener.hear(jump_ns=back_ns, count=12, channel="imu")
    assert listener.hear(jump_ns=back_ns, channel="gnss") == [0]
    assert len(listener.steps.steps) == 1


def test_single_wild_stamps_and_wild_runs_of_several_clocks_are_no_step() -> None:
    listener = Listener(with_receipt=True)
    listener.hear(count=40)
    for jump_s in (-100, 900, -7, 3, -5000, 40, -2, 60, 11, -9, 5, -77):
        assert listener.hear(jump_ns=jump_s * 10**9) == [None]
    assert listener.hear(count=5) == [0] * 5
    assert listener.steps.steps == []


def test_what_waited_for_the_connection_does_not_put_the_rest_in_doubt() -> None:
    """The first samples were kept for two seconds and come all at once."""
    clock = ClockEstimator()
    steps = ClockSteps(clock)
    for k in range(60):
        stamp_ns = START_NS + k * STEP_NS
        received_ns = MONO_NS + max(k * STEP_NS, 2_000_000_000)
        placed = steps.place("gnss", stamp_ns, received_ns)
        assert placed == stamp_ns
        clock.handle(stamp_ns, received_ns)
    assert clock.offset_ns == MONO_NS - START_NS
