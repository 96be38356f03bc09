"""A ledger balances where everything ended in exactly one way, and says where it does not."""

from __future__ import annotations

import pytest

from foretwin.contracts.runner import TaskCount
from foretwin.orchestrator.record.ledger import (
    JobsLedger,
    Ledger,
    RoundsLedger,
    RoundTally,
    jobs_ledger,
)

ROUNDS = RoundsLedger(due=21, run=1, missed=2, spared=3, unseeded=5, given_up=10)
JOBS = JobsLedger(given=7, results=1, refused=2, lost=4)


def test_what_is_counted_once_on_each_side_balances() -> None:
    assert Ledger(rounds=ROUNDS, jobs=JOBS).balanced()


@pytest.mark.parametrize("name", ["due", "run", "missed", "spared", "unseeded", "given_up"])
def test_a_round_too_many_or_too_few_anywhere_is_noticed(name: str) -> None:
    fields = {one: getattr(ROUNDS, one) for one in ROUNDS.__struct_fields__}
    for by in (-1, 1):
        torn = RoundsLedger(**fields | {name: fields[name] + by})
        assert Ledger(rounds=torn, jobs=JOBS).unbalanced() == ("rounds",)


@pytest.mark.parametrize("name", ["given", "results", "refused", "lost"])
def test_a_job_too_many_or_too_few_anywhere_is_noticed(name: str) -> None:
    fields = {one: getattr(JOBS, one) for one in JOBS.__struct_fields__}
    for by in (-1, 1):
        torn = JobsLedger(**fields | {name: fields[name] + by})
        assert Ledger(rounds=ROUNDS, jobs=torn).unbalanced() == ("jobs",)


def test_rounds_are_given_up_by_failure_or_by_the_end() -> None:
    tally = RoundTally(due=7, run=1)
    tally.not_ready(world_late=True)
    tally.not_ready(world_late=False)
    tally.fail("every worker died")
    tally.cut_off += 1
    tally.missed += 1
    tally.spared += 1
    made = RoundsLedger(due=7, run=1, missed=2, spared=1, unseeded=1, given_up=2)
    assert tally.ledger() == made
    assert (made.balanced(), tally.last_failure) == (True, "every worker died")


def test_a_round_whose_start_raises_is_given_up_with_the_reason() -> None:
    tally = RoundTally(due=1)
    with pytest.raises(ValueError, match="torn"), tally.starting():
        raise ValueError("the path is torn")
    assert tally.ledger().balanced()
    assert "the path is torn" in tally.last_failure


def test_jobs_are_what_the_dispatch_counted() -> None:
    assert jobs_ledger(TaskCount(given=7, results=1, refused=2, lost=4)) == JOBS
