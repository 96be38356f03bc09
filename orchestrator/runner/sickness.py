"""Which workers refuse what they are given, and how long each is left in peace before it is tried
again.

Pure: seconds come in from outside. The pauses are those of gRPC's connection backoff
(https://github.com/grpc/grpc/blob/master/doc/connection-backoff.md), without jitter: a run's
workers are few, and are asked by one alone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

FIRST_PAUSE_S = 1.0
"""gRPC's INITIAL_BACKOFF."""
PAUSE_GROWS_BY = 1.6
"""gRPC's MULTIPLIER: each pause is so many times the one before it."""
LONGEST_PAUSE_S = 120.0
"""gRPC's MAX_BACKOFF."""


@dataclass(slots=True)
class _Sick:
    reason: str
    until_s: float
    pause_s: float = FIRST_PAUSE_S
    refused: set[str] = field(default_factory=set)
    """Keys of what it refused since it last did something."""


@dataclass(slots=True)
class Sickness:
    """The workers that refused their last task; one that answers a task is well again."""

    refusals: dict[str, int] = field(default_factory=dict)
    """How often each worker refused anything, ever."""
    last_reason: dict[str, str] = field(default_factory=dict)
    _sick: dict[str, _Sick] = field(default_factory=dict)

    @property
    def sick(self) -> dict[str, str]:
        """Which workers are sick, and why by their own words."""
        return {worker_id: one.reason for worker_id, one in sorted(self._sick.items())}

    def record(self) -> dict[str, dict[str, object]]:
        """Return of each worker that refused anything how often, why the last time, and whether it
        is sick still."""
        return {
            worker_id: {
                "count": count,
                "last": self.last_reason[worker_id],
                "sick": worker_id in self._sick,
            }
            for worker_id, count in sorted(self.refusals.items())
        }

    def refused(self, worker_id: str, key: str, reason: str, *, now_s: float) -> None:
        """Take note of a refusal; the pause grows where it comes after the pause before it."""
        self.refusals[worker_id] = self.refusals.get(worker_id, 0) + 1
        self.last_reason[worker_id] = reason
        known = self._sick.get(worker_id)
        if known is None:
            known = self._sick[worker_id] = _Sick(reason, now_s + FIRST_PAUSE_S)
        elif now_s >= known.until_s:
            known.pause_s = min(PAUSE_GROWS_BY * known.pause_s, LONGEST_PAUSE_S)
            known.until_s = now_s + known.pause_s
        known.reason = reason
        known.refused.add(key)

    def well(self, worker_id: str) -> None:
        """Take note that a worker has answered, or lives anew."""
        self._sick.pop(worker_id, None)

    def forgive(self, worker_ids: Iterable[str], key: str) -> None:
        """Hold a task against nobody: all refused it, so that it says nothing of any one."""
        for worker_id in worker_ids:
            known = self._sick.get(worker_id)
            if known is not None:
                known.refused.discard(key)
                if not known.refused:
                    del self._sick[worker_id]

    def may_hold(self, up: Collection[str], most: int, *, now_s: float) -> dict[str, int]:
        """Return how many of `most` tasks each worker that is up may hold.

        A sick one none in its pause, then one. Where all are sick, nobody is spared: what each
        refused the others have yet to try.
        """
        none_is_well = self._sick.keys() >= set(up)
        return {
            worker_id: most
            if (one := self._sick.get(worker_id)) is None
            else int(none_is_well or now_s >= one.until_s)
            for worker_id in up
        }
