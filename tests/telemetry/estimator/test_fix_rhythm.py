"""When a fix is about to follow at the stamp of other samples."""

from __future__ import annotations

from collections.abc import Iterable

from foretwin.telemetry.estimator.fix_rhythm import FixRhythm

MS = 1_000_000


def due_at(samples: Iterable[tuple[str, int]]) -> list[int]:
    """The stamps in ms of samples other than fixes at which the next fix was awaited."""
    rhythm, found = FixRhythm(), []
    for channel, stamp_ms in samples:
        rhythm = rhythm.after(channel, stamp_ms * MS)
        if channel != "gnss" and rhythm.due:
            found.append(stamp_ms)
    return sorted(set(found))


def row(stamp_ms: int, *channels: str) -> list[tuple[str, int]]:
    return [(channel, stamp_ms) for channel in channels]


def test_rows_that_hold_all_are_summed_up_by_their_fixes_however_uneven_they_are() -> None:
    stamps = (0, 1000, 1950, 3100, 4000)
    rows = [sample for at in stamps for sample in row(at, "speed", "heading", "gnss")]
    assert due_at(rows) == [1950, 3100, 4000]


def test_between_fixes_nothing_is_awaited_and_a_fix_that_fails_to_come_is_so_once() -> None:
    samples = [
        sample
        for at in range(0, 1000, 20)
        for sample in row(at, "imu", *(("gnss",) if at % 100 == 0 and at != 500 else ()))
    ]
    assert due_at(samples) == [*range(200, 600, 100), *range(800, 1000, 100)]


def test_fixes_at_stamps_of_their_own_or_with_nothing_beside_are_not_waited_for() -> None:
    samples = [s for at in range(0, 1000, 100) for s in (("speed", at), ("gnss", at + 7))]
    assert due_at(samples) == []
    assert due_at([("gnss", at) for at in range(0, 1000, 100)]) == []
