"""What operators may watch while a drive goes on: its metrics, and what they are now.

All is read from what a drive counts anyway, and only when somebody asks.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts.cpu_use import cpu_uses
from foretwin.contracts.running import RunningQuantiles
from foretwin.contracts.simulation import WorkerStatus
from foretwin.contracts.versions import versions
from foretwin.orchestrator.drive.conductor import Conductor
from foretwin.orchestrator.drive.progress import worker_statuses
from foretwin.orchestrator.record.ledger import jobs_ledger
from foretwin.orchestrator.record.refused_elsewhere import refused_elsewhere

PREFIX = "foretwin_"
_QUANTILES = {"0.5": 50.0, "0.95": 95.0}
_STATES = "idle", "busy", "sick", "dead"


class MetricRow(NamedTuple):
    """A row of the table of metrics; seconds and bytes, as Prometheus has them."""

    kind: Literal["counter", "gauge"]
    text: str


METRICS: dict[str, MetricRow] = {
    "drive_info": MetricRow("gauge", "Always 1; what the drive is, in its labels."),
    "drive_seconds": MetricRow("gauge", "Time of the drive, by the vehicle's clock."),
    "rounds_due_total": MetricRow("counter", "Rounds that were due."),
    "rounds_ended_total": MetricRow("counter", "Rounds by how they ended, as in the ledger."),
    "rounds_late_total": MetricRow("counter", "Complete rounds that took longer than a period."),
    "rounds_open": MetricRow("gauge", "Rounds that are begun and not complete."),
    "round_futures": MetricRow(
        "gauge", "Futures of the next round: fewer where the machine is slow."
    ),
    "futures_total": MetricRow("counter", "Futures of complete rounds."),
    "jobs_given_total": MetricRow("counter", "Jobs that were given to workers."),
    "jobs_ended_total": MetricRow("counter", "Jobs by how they ended, as in the ledger."),
    "jobs_open": MetricRow("gauge", "Jobs that wait or are at work, by which of the two."),
    "jobs_requeued_total": MetricRow(
        "counter", "Jobs given out again since their worker was lost."
    ),
    "result_latency_seconds": MetricRow(
        "gauge", "State to complete round, quantiles of the drive."
    ),
    "result_age_seconds": MetricRow("gauge", "Since the last complete round."),
    "telemetry_age_seconds": MetricRow(
        "gauge", "Since the sample came that gave the newest state."
    ),
    "telemetry_delay_seconds": MetricRow(
        "gauge", "Sent to received by UTC, quantiles of the drive."
    ),
    "telemetry_received_total": MetricRow("counter", "Samples of the car that came."),
    "telemetry_lost_total": MetricRow("counter", "Samples of the car that never came."),
    "refused_total": MetricRow("counter", "What was not let in, by who refused it."),
    "queue_length": MetricRow("gauge", "What waits in a queue."),
    "lost_total": MetricRow("counter", "Items that a full queue or a disk lost, by which."),
    "worker_state": MetricRow("gauge", "1 for the state in which a worker is, 0 for the others."),
    "worker_speed_ratio": MetricRow("gauge", "Simulated seconds for one of its processor's."),
    "worker_link_seconds": MetricRow("gauge", "There and back to a worker on another computer."),
    "worker_clock_offset_seconds": MetricRow("gauge", "How far its computer's clock is ahead."),
    "process_cpu_seconds_total": MetricRow("counter", "Processor time by process, all its lives."),
    "process_memory_bytes": MetricRow("gauge", "Memory of its own, by process."),
    "process_starts_total": MetricRow("counter", "How often a process was started."),
    "metrics_seconds_total": MetricRow("counter", "What telling these took the drive's own loop."),
}
"""Every metric by its name, less the prefix."""


class MetricSample(NamedTuple):
    """One value of a metric."""

    name: str
    value: float
    labels: tuple[tuple[str, str], ...] = ()


class DriveCounts:
    """Reads a drive's metrics; `look` often, so that it is known when the last round was."""

    def __init__(self, conductor: Conductor) -> None:
        self._conductor = conductor
        self._rounds, self._round_s = 0, 0.0
        self._took_s = 0.0

    def look(self, now_s: float) -> None:
        """See whether a round was completed."""
        if (rounds := self._conductor.rounds.futures.rounds) != self._rounds:
            self._rounds, self._round_s = rounds, now_s

    def samples(self, now_s: float) -> list[MetricSample]:
        """Return what everything is now, but for what lies in files."""
        began_s = time.perf_counter()
        found = [*self._drive(), *self._work(), *self._telemetry(now_s), *self._workers()]
        if self._rounds:
            found.append(MetricSample("result_age_seconds", now_s - self._round_s))
        self._took_s += time.perf_counter() - began_s
        return [*found, MetricSample("metrics_seconds_total", self._took_s)]

    def _drive(self) -> Iterator[MetricSample]:
        plan, rounds = self._conductor.plan, self._conductor.rounds
        about = {
            "run_id": plan.run_id,
            "vehicle_id": plan.config.vehicle_id,
            "map_sha256": plan.osm.sha256,
            "version": versions()["foretwin"],
        }
        yield MetricSample("drive_info", 1, tuple(about.items()))
        yield MetricSample("drive_seconds", self._conductor.mission.drive_time_s)
        yield MetricSample("futures_total", rounds.futures.count)
        yield MetricSample("round_futures", rounds.pace.now.futures)
        yield from _quantiles("result_latency_seconds", rounds.futures.latencies_ms)

    def _work(self) -> Iterator[MetricSample]:
        rounds, dispatch = self._conductor.rounds, self._conductor.rounds.dispatcher.dispatch
        ended = msgspec.structs.asdict(rounds.tally.ledger())
        yield MetricSample("rounds_due_total", ended.pop("due"))
        yield from _by("rounds_ended_total", "how", ended)
        yield MetricSample("rounds_late_total", rounds.futures.late_rounds)
        yield MetricSample("rounds_open", len(rounds.open.orders))
        ended = msgspec.structs.asdict(jobs_ledger(dispatch.count))
        yield MetricSample("jobs_given_total", ended.pop("given"))
        yield from _by("jobs_ended_total", "how", ended)
        waiting = dispatch.waiting
        counts = {"at_work": dispatch.open - waiting, "waiting": waiting}
        yield from _by("jobs_open", "state", counts)
        yield MetricSample("jobs_requeued_total", dispatch.requeued)

    def _telemetry(self, now_s: float) -> Iterator[MetricSample]:
        intake, conductor = self._conductor.intake, self._conductor
        if intake.latest is not None:
            age_s = now_s - intake.latest.receipt_mono_ns / 1e9
            yield MetricSample("telemetry_age_seconds", max(0.0, age_s))
        yield from _quantiles("telemetry_delay_seconds", intake.counts.ages_ms)
        yield MetricSample("telemetry_received_total", intake.counts.received)
        yield MetricSample("telemetry_lost_total", intake.counts.lost)
        own = {"orchestrator": conductor.refusals.counted.record()["count"]}
        yield from _by("refused_total", "by", own)
        yield MetricSample("queue_length", len(conductor.mailbox), (("queue", "mailbox"),))
        lost = {"mailbox": conductor.mailbox.dropped, "result_rows": conductor.tables.dropped}
        yield from _by("lost_total", "of", lost)

    def _workers(self) -> Iterator[MetricSample]:
        now_mb = self._conductor.context.memory.now_mb
        in_bytes = {name: 1e6 * held for name, held in now_mb.items()}
        yield from _by("process_memory_bytes", "process", in_bytes)
        for status in worker_statuses(self._conductor, 0):
            yield from _of_worker(status)


def process_samples(processes: Path) -> list[MetricSample]:
    """Return what processes said of themselves in a run's folder `processes`."""
    found = []
    for name, use in cpu_uses(processes).items():
        found.append(MetricSample("process_cpu_seconds_total", use.cpu_s, (("process", name),)))
        found.append(MetricSample("process_starts_total", use.lives, (("process", name),)))
    refused = refused_elsewhere(processes)
    others = {by: refused[f"refused_by_{by}"]["count"] for by in ("router", "processes")}
    return [*found, *_by("refused_total", "by", others)]


def exposition(samples: list[MetricSample]) -> str:
    """Return samples as Prometheus' text format 0.0.4, each metric with its help."""
    lines = []
    for name, metric in METRICS.items():
        of = [sample for sample in samples if sample.name == name]
        if of:
            lines.append(f"# HELP {PREFIX}{name} {metric.text}")
            lines.append(f"# TYPE {PREFIX}{name} {metric.kind}")
        for sample in of:
            labels = ",".join(f'{key}="{_escaped(value)}"' for key, value in sample.labels)
            braces = f"{{{labels}}}" if labels else ""
            lines.append(f"{PREFIX}{name}{braces} {float(sample.value):.12g}")
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _by(name: str, label: str, counts: Mapping[str, float]) -> Iterator[MetricSample]:
    return (MetricSample(name, value, ((label, of),)) for of, value in counts.items())


def _quantiles(name: str, values_ms: RunningQuantiles) -> Iterator[MetricSample]:
    for quantile, q in _QUANTILES.items():
        if (value_ms := values_ms.percentile(q)) is not None:
            yield MetricSample(name, value_ms / 1e3, (("quantile", quantile),))


def _of_worker(status: WorkerStatus) -> Iterator[MetricSample]:
    worker = ("worker", status.worker_id)
    for state in _STATES:
        yield MetricSample("worker_state", status.state == state, (worker, ("state", state)))
    if status.rtf is not None:
        yield MetricSample("worker_speed_ratio", status.rtf, (worker,))
    links = {
        "worker_link_seconds": status.link_ms,
        "worker_clock_offset_seconds": status.clock_offset_ms,
    }
    for name, milliseconds in links.items():
        if milliseconds is not None:
            yield MetricSample(name, milliseconds / 1e3, (worker,))
