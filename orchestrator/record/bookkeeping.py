"""What a drive counts: telemetry received and lost, futures, errors of prediction, latencies."""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from foretwin.contracts.keys import SAMPLE_CHANNELS
from foretwin.contracts.numbering import Numberings
from foretwin.contracts.running import MOST_LISTED, RunningMeans, RunningQuantiles
from foretwin.contracts.simulation import Comparison, PlanComparison
from foretwin.orchestrator.runner.open_rounds import RoundDone


def percentile(values: RunningQuantiles, q: float) -> float | None:
    """Return the q-th percentile as records have it, None of nothing."""
    found = values.percentile(q)
    return None if found is None else round(found, 3)


@dataclass(slots=True)
class TelemetryCount:
    """Samples by key: received, lost (gaps in the sender's numbering), and their age."""

    received: int = 0
    lost_before: int = 0
    """Beyond the gaps: what the vehicle says it sent, before the first sample or after the last."""
    by_channel: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    """Samples that came, each once, those that were refused included."""
    ages_ms: RunningQuantiles = field(default_factory=RunningQuantiles)
    numbers: Numberings = field(default_factory=Numberings)

    @property
    def lost(self) -> int:
        """Samples that never came."""
        return self.numbers.missing.total() + self.lost_before

    def take(self, channel: str, *, sender: int, seq: int, sent_ns: int, now_ns: int) -> None:
        """Count one sample that was sent and came at these instants of both UTC clocks."""
        self.came(channel, sender=sender, seq=seq, sent_ns=sent_ns)
        self.received += 1
        self.ages_ms.take(max(0.0, (now_ns - sent_ns) / 1e6))

    def came(self, channel: str, *, sender: int, seq: int, sent_ns: int) -> None:
        """Count a sample as not lost, whatever is made of it."""
        if self.numbers.take(channel, seq, sender=sender, sent_ns=sent_ns) is not None:
            self.by_channel[channel] += 1

    def settle(self, published: dict[str, int]) -> None:
        """Count what the vehicle says it published and that never came, first samples included."""
        missing = sum(
            max(0, published.get(name, 0) - self.by_channel.get(name, 0))
            for name in SAMPLE_CHANNELS
        )
        self.lost_before = max(self.lost_before, missing - self.numbers.missing.total())

    def record(self, skipped_invalid: int) -> dict[str, Any]:
        """Return the `telemetry` part of run.json."""
        return {
            "received": self.received,
            "lost": self.lost,
            "skipped_invalid": skipped_invalid,
            "age_ms_p50": percentile(self.ages_ms, 50),
            "age_ms_p95": percentile(self.ages_ms, 95),
        }


@dataclass(slots=True)
class FuturesCount:
    """Futures of complete rounds, and the hash of all their trajectories in order."""

    rounds: int = 0
    count: int = 0
    distinct: int = 0
    distinct_min: int | None = None
    sim_seconds: float = 0.0
    cpu_seconds: float = 0.0
    latencies_ms: RunningQuantiles = field(default_factory=RunningQuantiles)
    rounds_of: Counter[int] = field(default_factory=Counter)
    """Complete rounds by the number of their futures."""
    late_rounds: int = 0
    """Complete rounds that took longer than their period."""
    off_lanes_rounds: int = 0
    """Rounds whose paths are driven in part where their World has no lane that way."""
    not_placed: Counter[str] = field(default_factory=Counter)
    """Futures whose scenario had no place, by the reason; of these, the first so many."""
    failed: Counter[str] = field(default_factory=Counter)
    """Likewise, those that were not played to their end."""
    remarked: Counter[str] = field(default_factory=Counter)
    """Likewise, those of which their planner has something to say."""
    _hash: Any = field(default_factory=hashlib.sha256)

    def take(self, done: RoundDone, *, distinct: int) -> str:
        """Count one round; returns the hash of its trajectories alone."""
        own = hashlib.sha256()
        own.update(f"{done.order.stamp_ns}".encode())
        for result in done.results:
            own.update(np.ascontiguousarray(result.trajectory.states).tobytes())
            own.update(np.ascontiguousarray(result.outcome.collided).tobytes())
            self.sim_seconds += result.sim_seconds
            self.cpu_seconds += result.cpu_seconds
            outcome = result.outcome
            for counted, words in (
                (self.not_placed, result.left_out),
                (self.failed, outcome.failures),
                (self.remarked, outcome.remarks),
            ):
                for reason in filter(None, words):
                    if reason in counted or len(counted) < MOST_LISTED:
                        counted[reason] += 1
        self.late_rounds += done.late
        futures = sum(len(result.future_indices) for result in done.results)
        self._add(own.digest(), futures, distinct, done.latency_ms)
        return own.hexdigest()

    def take_row(self, row: Mapping[str, Any]) -> None:
        """Count one round as the table of rounds holds it."""
        self.sim_seconds += row["sim_seconds"]
        self.cpu_seconds += row["cpu_seconds"]
        self.late_rounds += bool(row["late"])  # null where an older foretwin wrote it
        self._add(bytes.fromhex(row["sha256"]), row["futures"], row["distinct"], row["latency_ms"])

    def _add(self, digest: bytes, futures: int, distinct: int, latency_ms: float) -> None:
        self._hash.update(digest)
        self.count += futures
        self.rounds_of[futures] += 1
        self.rounds += 1
        self.distinct += distinct
        self.distinct_min = (
            distinct if self.distinct_min is None else min(self.distinct_min, distinct)
        )
        self.latencies_ms.take(latency_ms)

    def record(self, *, wanted: int, missed: int, spared: int, unseeded: int) -> dict[str, Any]:
        """Return the `futures` part of run.json; `rounds` counts the complete ones.

        Of these, `late_rounds` took longer than their period. `missed_rounds` were due and
        not begun, `unseeded_rounds` had nothing to start from. Since the
        machine was too slow, `smaller_rounds` had fewer futures than `wanted` and `spared_rounds`
        were not run. In `off_lanes_rounds` the path leaves the lanes of the World. `not_placed`
        counts by the reason the futures whose scenario had no place: the car drives alone in them;
        `failed` those that were not played to their end, `remarked` those of which their planner
        has something to say, such as that another one drove.
        """
        return {
            "count": self.count,
            "wanted_per_round": wanted,
            "smaller_rounds": sum(n for size, n in self.rounds_of.items() if size < wanted),
            "rounds_by_futures": {str(size): n for size, n in sorted(self.rounds_of.items())},
            "distinct": self.distinct,
            "distinct_min_per_round": self.distinct_min,
            "missed_rounds": missed,
            "spared_rounds": spared,
            "unseeded_rounds": unseeded,
            "off_lanes_rounds": self.off_lanes_rounds,
            "not_placed": dict(self.not_placed.most_common()),
            "failed": dict(self.failed.most_common()),
            "remarked": dict(self.remarked.most_common()),
            "rounds": self.rounds,
            "late_rounds": self.late_rounds,
            "sim_seconds": round(self.sim_seconds, 3),
            "cpu_seconds": round(self.cpu_seconds, 3),
            "sha256": self._hash.hexdigest(),
        }


@dataclass(slots=True)
class ComparisonCount:
    """Mean displacement errors by horizon: nominal future and two baselines on the same data, and
    the mean of all futures by their likelihood."""

    errors: dict[float, RunningMeans] = field(default_factory=lambda: defaultdict(RunningMeans))
    weighted: dict[float, RunningMeans] = field(default_factory=lambda: defaultdict(RunningMeans))

    def take(self, comparison: Comparison) -> None:
        """Count one comparison."""
        self.errors[comparison.horizon_s].take(
            (
                comparison.nominal.ade_m,
                comparison.constant_velocity.ade_m,
                comparison.constant_turn_rate.ade_m,
            )
        )
        if comparison.weighted_ade_m is not None:
            self.weighted[comparison.horizon_s].take((comparison.weighted_ade_m,))

    def record(self, *, independent: bool) -> dict[str, Any]:
        """Return the `comparison` part of run.json."""
        means = {f"{h:g}": rows.means for h, rows in sorted(self.errors.items())}
        return {
            "ade_m": {h: round(m[0], 4) for h, m in means.items()},
            "weighted_ade_m": {
                f"{h:g}": round(rows.means[0], 4) for h, rows in sorted(self.weighted.items())
            },
            "constant_velocity_ade_m": {h: round(m[1], 4) for h, m in means.items()},
            "constant_turn_rate_ade_m": {h: round(m[2], 4) for h, m in means.items()},
            "count": {f"{h:g}": rows.count for h, rows in sorted(self.errors.items())},
            "independent": independent,
        }


@dataclass(slots=True)
class PlanCount:
    """How far the car's own plans lie from the nominal futures and from the route's lane centre."""

    rows: RunningMeans = field(default_factory=RunningMeans)

    def take(self, comparison: PlanComparison) -> None:
        """Count one comparison of plans."""
        difference = comparison.difference
        self.rows.take((difference.ade_m, difference.fde_m, comparison.path_offset_m))

    def record(self) -> dict[str, Any] | None:
        """Return the `plan_comparison` part of run.json, None where the car sent no plans.

        `path_offset_m` is the mean signed distance from the lane centre, positive to the left.
        """
        if not self.rows.count:
            return None
        ade, fde, offset = (round(v, 4) for v in self.rows.means)
        return {"count": self.rows.count, "ade_m": ade, "fde_m": fde, "path_offset_m": offset}
