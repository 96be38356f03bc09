"""Published = recorded + lost, whoever knows of it."""

from __future__ import annotations

from foretwin.contracts.tally import Tally
from foretwin.orchestrator.record.telemetry_ledger import lost_telemetry_line, telemetry_ledger


def tally() -> Tally:
    """Of ten numbers two never came, one could not be written, one fit no file."""
    found = Tally()
    for seq in (0, 1, 2, 5, 6, 7, 8, 9):
        found.numbers.take("imu", seq, sender=7)
        found.settle({8: "unwritten", 9: "refused"}.get(seq, "recorded"), "imu")
    for channel, sender in (("state", 9), ("end", 7)):
        found.numbers.take(channel, 0, sender=sender)
        found.settle("recorded", channel)
    return found


def test_each_published_sample_is_recorded_or_lost_for_a_reason() -> None:
    assert telemetry_ledger(tally(), {"imu": 10}) == {
        "published": 10,
        "recorded": 6,
        "lost": 4,
        "lost_by": {"never_came": 2, "unwritten": 1, "refused": 1},
    }


def test_what_the_recorder_never_heard_of_is_lost() -> None:
    ledger = telemetry_ledger(tally(), {"imu": 15, "gnss": 3})
    assert (ledger["published"], ledger["recorded"], ledger["lost"]) == (18, 6, 12)
    assert ledger["lost_by"]["never_came"] == 2 + 5 + 3
    assert telemetry_ledger(None, {"imu": 15})["lost"] == 15


def test_who_heard_less_than_the_recorder_does_not_count() -> None:
    assert telemetry_ledger(tally(), {"imu": 4}) == telemetry_ledger(tally(), {})


def test_what_is_lost_is_said_with_its_reasons() -> None:
    assert lost_telemetry_line(telemetry_ledger(Tally(), {})) is None
    assert lost_telemetry_line(telemetry_ledger(tally(), {"imu": 10})) == (
        "4 of 10 telemetry samples are not recorded: 2 never came to the recorder, 1 could not be"
        " written, 1 fit no recording"
    )
