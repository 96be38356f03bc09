"""Channels that are overdue: found soon, and not because a sample or two were lost."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.telemetry.estimator.staleness import Staleness

MS = 1_000_000


def kept_up(
    period_ms: int, *, until_ms: int, loss: float = 0.0, jitter_ms: float = 0.0, seed: int = 0
) -> tuple[Staleness, int]:
    """Return a watcher of one channel, and how many milliseconds it was thought overdue."""
    random = np.random.default_rng(seed)
    watcher = Staleness(("imu",))
    arrivals = sorted(
        (stamp_ms + jitter_ms * random.random(), stamp_ms)
        for stamp_ms in range(0, until_ms, period_ms)
        if random.random() >= loss
    )
    overdue = 0
    for now_ms in range(until_ms):
        while arrivals and arrivals[0][0] <= now_ms:
            watcher.take("imu", arrivals.pop(0)[1] * MS, now_ms * MS)
        overdue += bool(watcher.overdue(now_ms * MS))
    return watcher, overdue


def found_after_ms(watcher: Staleness, last_ms: int) -> int:
    return next(ms for ms in range(5000) if watcher.overdue((last_ms + ms) * MS))


@pytest.mark.parametrize(
    ("period_ms", "within_ms"), [(10, 115), (20, 125), (100, 205), (1000, 1155)]
)
def test_silence_is_found_soon_after_a_sample_was_due(period_ms: int, within_ms: int) -> None:
    watcher, overdue = kept_up(period_ms, until_ms=20 * period_ms)
    assert overdue == 0
    assert period_ms < found_after_ms(watcher, 19 * period_ms) <= within_ms


@pytest.mark.parametrize(("period_ms", "within_ms"), [(10, 200), (20, 200), (50, 210), (100, 260)])
@pytest.mark.parametrize("seed", range(3))
def test_loss_and_jitter_are_learnt_and_silence_is_still_found(
    period_ms: int, within_ms: int, seed: int
) -> None:
    """Within 200 ms at 50 Hz and above, within two periods and the jitter below.

    So soon means that at 10 Hz two samples lost one after the other look like silence.
    """
    until_ms = 400 * period_ms
    watcher, overdue = kept_up(period_ms, until_ms=until_ms, loss=0.2, jitter_ms=50.0, seed=seed)
    # At first, until it is seen how late they come.
    assert overdue < (0.02 if period_ms <= 50 else 0.05) * until_ms
    assert found_after_ms(watcher, until_ms - period_ms) < within_ms


def test_a_channel_that_was_never_seen_or_is_not_declared_is_not_missed() -> None:
    watcher = Staleness(("imu",))
    for k in range(20):
        watcher.take("speed", k * 10 * MS, k * 10 * MS)
    assert watcher.overdue(10_000 * MS) == ()


def test_a_constant_delay_is_a_channels_own_way() -> None:
    """Receivers need time: positions that always come 300 ms late are not overdue for that."""
    watcher = Staleness(("gnss",))
    for now_ms in range(0, 4000, 100):
        watcher.take("gnss", (now_ms - 300) * MS, now_ms * MS)
        assert watcher.overdue((now_ms + 99) * MS) == ()
    assert watcher.overdue((3900 + 230) * MS) == ("gnss",)


def test_it_recovers_with_the_next_sample() -> None:
    watcher, _ = kept_up(10, until_ms=500)
    assert watcher.overdue(900 * MS) == ("imu",)
    watcher.take("imu", 900 * MS, 900 * MS)
    assert watcher.overdue(905 * MS) == ()


def test_samples_that_all_come_two_seconds_late_are_stale() -> None:
    watcher = Staleness(("imu",))
    for now_ms in range(0, 4000, 10):
        watcher.take("imu", (now_ms - 2000) * MS, now_ms * MS)
    assert watcher.overdue(3990 * MS) == ("imu",)
