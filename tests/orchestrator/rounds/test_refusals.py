"""Workers that refuse jobs: one costs nothing, all cost the round, and the drive goes on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.orchestrator.drive.progress import ProgressLine, worker_statuses
from foretwin.orchestrator.rounds.runner import RoundRunner
from tests.orchestrator.house import House, Worker


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def refuse_all(house: House, *workers: Worker, reason: str) -> int:
    """Let workers refuse whatever they are asked; returns how much that was."""
    refused = 0
    while requests := [one for worker in workers for one in worker.take()]:
        refused += len(requests)
        assert refused < 100
        for request in requests:
            request.refuse(reason)
        house.settle()
    return refused


def test_a_job_that_every_worker_refuses_ends_its_round_and_not_the_drive(house: House) -> None:
    house.drive(20)
    assert house.conductor.start_round()
    # The second job is wanted no more once the first is refused by both.
    assert refuse_all(house, *house.workers, reason="path has no length") in (3, 4)

    rounds: RoundRunner = house.conductor.rounds
    assert not rounds.open
    assert rounds.tally.failed == 1
    count = rounds.dispatcher.dispatch.count
    assert (count.given, count.refused, count.lost) == (2, 1, 1)
    assert [e.text for e in house.watched("event") if e.level == "error"] == [
        "round 0 is given up: path has no length"
    ]
    house.drive(30)
    assert house.conductor.start_round()
    house.work()
    assert rounds.futures.rounds == rounds.tally.run == 1


def test_the_jobs_of_a_sick_worker_are_done_by_the_other_and_it_is_shown(house: House) -> None:
    house.drive(20)
    assert house.conductor.start_round()
    assert refuse_all(house, house.workers[0], reason="no disk") == 1
    house.work()

    rounds = house.conductor.rounds
    assert (rounds.tally.run, rounds.tally.failed) == (1, 0)
    assert (house.workers[0].jobs, house.workers[1].jobs) == (0, 2)
    (told,) = (e.text for e in house.watched("event") if e.level == "warning")
    assert told == "w0 is sick, it refuses jobs: no disk; others are asked"
    line = ProgressLine(house.conductor, house.mission)
    assert "workers 2/2 (w0 sick)" in line._text(line._progress(0.0))
    assert [one.state for one in worker_statuses(house.conductor, 0)] == ["sick", "idle"]


def test_a_round_that_no_worker_which_is_up_will_do_ends_when_the_next_is_due(house: House) -> None:
    house.drive(20)
    house.workers[1].die()
    house.settle()
    assert house.conductor.start_round()
    refuse_all(house, house.workers[0], reason="no disk")
    rounds = house.conductor.rounds
    assert rounds.open  # the other may come back
    rounds.next_is_due()
    assert not rounds.open
    assert (rounds.tally.failed, rounds.tally.last_failure) == (1, "no disk")


def test_a_worker_that_is_never_started_again_is_waited_for_no_more(house: House) -> None:
    house.drive(20)
    house.workers[1].die()
    house.settle()
    assert house.conductor.start_round()
    refuse_all(house, house.workers[0], reason="no disk")
    assert house.conductor.rounds.open
    house.conductor.rounds.never_again("w1")
    assert not house.conductor.rounds.open
    assert house.conductor.rounds.tally.failed == 1


def test_what_a_slow_round_still_sends_after_it_was_given_up_is_late(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = [10**9]
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns[0])
    house.drive(20)
    assert house.conductor.start_round()
    rounds = house.conductor.rounds
    now_ns[0] += 9_000_000_000
    rounds.next_is_due()
    assert rounds.open
    now_ns[0] += 2_000_000_000
    rounds.next_is_due()
    assert not rounds.open
    house.work()
    dispatch = rounds.dispatcher.dispatch
    assert (rounds.tally.run, rounds.tally.failed, dispatch.late) == (0, 1, 2)
    assert (dispatch.count.given, dispatch.count.lost, dispatch.count.results) == (2, 2, 0)


@pytest.mark.parametrize(("seconds", "smaller"), [(0.0, False), (11.0, True)])
def test_only_rounds_that_were_slow_when_given_up_make_the_next_ones_smaller(
    seconds: float, smaller: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = [10**9]
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns[0])
    house = House(tmp_path, futures=64, futures_per_job=32, least_futures=16, rate_hz=2.0)
    house.drive(20)
    rounds = house.conductor.rounds
    for _ in range(6):
        assert house.conductor.start_round()
        now_ns[0] += round(1e9 * seconds)
        if smaller:
            rounds.next_is_due()
            house.work()
        else:
            refuse_all(house, *house.workers, reason="no disk")
        assert not rounds.open
    house.tables.close()

    assert rounds.tally.failed == 6
    assert (rounds.pace.now.futures < 64) is smaller
