"""The ledger of a run: what was to be done, and in which one way each of it ended.

docs/results.md says what each count means. Both sides of a balance are counted where they happen,
and neither is made from the other.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from foretwin.contracts.errors import one_line
from foretwin.contracts.runner import TaskCount


class RoundsLedger(msgspec.Struct, frozen=True, kw_only=True):
    """Rounds that were due, and what became of each."""

    due: int
    run: int
    missed: int
    spared: int
    unseeded: int
    given_up: int

    def balanced(self) -> bool:
        """Whether every round that was due ended in exactly one way."""
        return self.open == 0

    @property
    def open(self) -> int:
        """How many have not ended in any way."""
        ended = self.run + self.missed + self.spared + self.unseeded + self.given_up
        return self.due - ended

    def known_to_have_run(self, count: int) -> RoundsLedger:
        """Return it for rounds of which at least so many have run."""
        more = max(0, count - self.run)
        due = self.due + max(0, more - max(0, self.open))
        return msgspec.structs.replace(self, run=self.run + more, due=due)

    def ended(self) -> RoundsLedger:
        """Return it as it is once every round that is open is given up."""
        return msgspec.structs.replace(self, given_up=self.given_up + max(0, self.open))


class JobsLedger(msgspec.Struct, frozen=True, kw_only=True):
    """Jobs that were given to the run's workers, and what became of each."""

    given: int
    results: int
    refused: int
    lost: int

    def balanced(self) -> bool:
        """Whether every job that was given ended in exactly one way."""
        return self.open == 0

    @property
    def open(self) -> int:
        """How many have not ended in any way."""
        return self.given - (self.results + self.refused + self.lost)

    def known_to_have_results(self, count: int) -> JobsLedger:
        """Return it for jobs of which at least so many have results."""
        more = max(0, count - self.results)
        given = self.given + max(0, more - max(0, self.open))
        return msgspec.structs.replace(self, results=self.results + more, given=given)

    def ended(self) -> JobsLedger:
        """Return it as it is once every job that is open is lost."""
        return msgspec.structs.replace(self, lost=self.lost + max(0, self.open))

    def since(self, before: JobsLedger) -> JobsLedger:
        """Return what was counted since an earlier count."""
        names = self.__struct_fields__
        return JobsLedger(**{n: getattr(self, n) - getattr(before, n) for n in names})


class Ledger(msgspec.Struct, frozen=True, kw_only=True):
    """The `ledger` of run.json."""

    rounds: RoundsLedger
    jobs: JobsLedger

    def balanced(self) -> bool:
        """Whether nothing is missing and nothing doubled."""
        return not self.unbalanced()

    def unbalanced(self) -> tuple[str, ...]:
        """Return the names of the sections that do not balance."""
        balanced = {"rounds": self.rounds.balanced(), "jobs": self.jobs.balanced()}
        return tuple(name for name, holds in balanced.items() if not holds)


@dataclass(slots=True)
class RoundTally:
    """Counts rounds while a drive goes on; `ledger` once none is open."""

    due: int = 0
    run: int = 0
    missed: int = 0
    spared: int = 0
    """Rounds that were not run since the machine is too slow for them."""
    unseeded: int = 0
    """Rounds that no machine could have run: no state or no heading, or no road ahead."""
    failed: int = 0
    """Rounds given up since their jobs came to nothing."""
    cut_off: int = 0
    """Rounds that the drive's end found open."""
    last_failure: str = ""
    """Why a round was given up last."""

    @property
    def ended(self) -> int:
        """How many rounds have ended, in whatever way."""
        given_up = self.failed + self.cut_off
        return self.run + self.missed + self.spared + self.unseeded + given_up

    def not_ready(self, *, world_late: bool) -> None:
        """Count a round that is due and cannot be run now."""
        if world_late:
            self.missed += 1
        else:
            self.unseeded += 1

    @contextlib.contextmanager
    def starting(self) -> Iterator[None]:
        """Count a round as given up where starting it raises."""
        try:
            yield
        except Exception as error:
            self.fail(one_line(error))
            raise

    def fail(self, reason: str) -> None:
        """Count a round that is given up since its jobs came to nothing."""
        self.failed += 1
        self.last_failure = reason

    def ledger(self) -> RoundsLedger:
        """Return what became of the rounds."""
        return RoundsLedger(
            due=self.due,
            run=self.run,
            missed=self.missed,
            spared=self.spared,
            unseeded=self.unseeded,
            given_up=self.failed + self.cut_off,
        )


def jobs_ledger(count: TaskCount) -> JobsLedger:
    """Return what became of the jobs."""
    return JobsLedger(
        given=count.given, results=count.results, refused=count.refused, lost=count.lost
    )


def lost_rounds_line(record: Mapping[str, Any]) -> str | None:
    """Return what the engineer reads of rounds that failed, from run.json; None where none did."""
    given_up = record["dropped"]["given_up_rounds"]
    if not given_up:
        return None
    due, jobs = record["ledger"]["rounds"]["due"], record["ledger"]["jobs"]
    return (
        f"{given_up} of {due} rounds are given up ({jobs['refused']} jobs refused by every worker, "
        f"{jobs['lost']} lost), the last since: {record['dropped']['last_given_up']}"
    )
