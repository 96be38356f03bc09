"""What a second engine came to beside MuJoCo in a drive, and how it goes with the real drive."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.running import RunningQuantiles
from foretwin.contracts.siblings import APART_AFTER_S, Siblings
from foretwin.orchestrator.record.bookkeeping import percentile

HORIZON_S = APART_AFTER_S[-1]
MOST_PAIRS = 65536
"""Rounds whose disagreement is held against the drive: the newest, at most nine hours of them."""
_WAITING_ROUNDS = 256
"""A round that came so long before the one that is counted has no partner any more."""


@dataclass(slots=True)
class SiblingCount:
    """Counts futures on the second engine, and lays their disagreement beside MuJoCo's error."""

    rounds: int = 0
    futures: int = 0
    mattered: int = 0
    cpu_s: float = 0.0
    dropped: Counter[str] = field(default_factory=Counter)
    """Rounds without siblings, by the reason."""
    differ: Counter[str] = field(default_factory=Counter)
    """Futures that collide on one engine alone, by which of the round they are."""
    apart_m: RunningQuantiles = field(default_factory=RunningQuantiles)
    """Of nominal futures after `HORIZON_S`."""
    pairs: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MOST_PAIRS))
    """Of nominal futures: how far apart engines are, and how far MuJoCo's is from the real car."""
    _apart: dict[int, float] = field(default_factory=dict)
    _error: dict[int, float] = field(default_factory=dict)

    def take(self, row: Mapping[str, Any]) -> None:
        """Count a row of the table of siblings."""
        self.futures += 1
        self.mattered += row["matters"]
        self.cpu_s += row["cpu_seconds"]
        self.differ[row["which"]] += row["collided"] != row["sibling_collided"]
        if row["which"] != "nominal":
            return
        self.rounds += 1
        if (apart_m := row["apart_4_s_m"]) is not None:
            self.apart_m.take(apart_m)
            self._apart[row["round_id"]] = apart_m
            self._pair(row["round_id"])

    def take_error(self, round_id: int, horizon_s: float, fde_m: float) -> None:
        """Count how far a round's nominal future was from the car, at one horizon."""
        if horizon_s == HORIZON_S:
            self._error[round_id] = fde_m
            self._pair(round_id)
            for waiting in (self._apart, self._error):
                while waiting and (first := next(iter(waiting))) < round_id - _WAITING_ROUNDS:
                    del waiting[first]

    def _pair(self, round_id: int) -> None:
        if round_id in self._apart and round_id in self._error:
            self.pairs.append((self._apart.pop(round_id), self._error.pop(round_id)))

    def record(self, chosen: Siblings) -> dict[str, Any] | None:
        """Return the `siblings` of run.json, None where there are none.

        `with_reality` says how the engines' disagreement goes with MuJoCo's error against the real
        drive, both after 4 s: Spearman's rank correlation over `count` rounds.
        """
        if not chosen.on:
            return None
        apart, error = np.array(self.pairs).reshape(-1, 2).T
        correlation = rank_correlation(apart, error)
        return {
            "engine": chosen.engine,
            "share": chosen.share,
            "rounds": self.rounds,
            "futures": self.futures,
            "dropped": dict(sorted(self.dropped.items())),
            "apart_m_p50": percentile(self.apart_m, 50),
            "apart_m_p95": percentile(self.apart_m, 95),
            "outcome_differs": {name: self.differ[name] for name in ("nominal", "worst")},
            "mattered": self.mattered,
            "cpu_seconds": round(self.cpu_s, 3),
            "with_reality": {
                "count": len(self.pairs),
                "rank_correlation": None if correlation is None else round(correlation, 3),
            },
        }


def rank_correlation(one: Sequence[float] | Array, other: Sequence[float] | Array) -> float | None:
    """Return Spearman's rank correlation, equal values sharing their mean rank; None where it says
    nothing: fewer than three, or all alike."""
    ranks = np.array([_ranks(np.asarray(values, dtype=np.float64)) for values in (one, other)])
    if ranks.shape[1] < 3 or ranks.std(axis=1).min() == 0.0:
        return None
    return float(np.corrcoef(ranks)[0, 1])


def _ranks(values: Array) -> Array:
    _, places, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * (counts - 1))[places])


def sibling_lines(found: Mapping[str, Any] | None, share_of_core: float | None) -> list[str]:
    """Return what is said of the second engine at the end of a drive."""
    if not found:
        return []
    engine, differ = found["engine"], sum(found["outcome_differs"].values())
    core = "" if share_of_core is None else f", {share_of_core:.1%} of a core"
    line = f"  {engine} played {found['rounds']} rounds beside MuJoCo{core}"
    if found["apart_m_p50"] is not None:
        line += (
            f": nominal futures {found['apart_m_p50']:.2f} m apart after {HORIZON_S:g} s (95 % "
            f"within {found['apart_m_p95']:.2f} m), {differ} of {found['futures']} futures collide "
            "on one engine alone"
        )
    real = found["with_reality"]
    if (correlation := real["rank_correlation"]) is not None:
        line += (
            "; how far they are apart goes with the error against the drive by a rank correlation "
            f"of {correlation:.2f} ({real['count']} rounds)"
        )
    return [line]
