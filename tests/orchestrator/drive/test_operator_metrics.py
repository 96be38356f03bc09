from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.contracts.cpu_use import CpuMeter
from foretwin.contracts.refusal_counts import OwnRefusals, RefusalFile, RefusedKind
from foretwin.contracts.simulation import WorkerStatus
from foretwin.orchestrator.drive import operator_metrics
from foretwin.orchestrator.drive.operator_metrics import (
    METRICS,
    PREFIX,
    DriveCounts,
    MetricSample,
    exposition,
    process_samples,
)
from tests.orchestrator.house import House
from tests.test_layout import ROOT

LINE = re.compile(rf"{PREFIX}(\w+?)(\{{(?:\w+=\"(?:[^\"\\]|\\.)*\",?)+\}})? (\S+)")
"""A sample, as the text format 0.0.4 writes it."""


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def told(samples: list[MetricSample]) -> dict[str, float]:
    """The page as who scrapes it reads it."""
    found = {}
    for line in exposition(samples).splitlines():
        if not line.startswith("#"):
            named = LINE.fullmatch(line)
            assert named is not None, line
            found[named[1] + (named[2] or "")] = float(named[3])
    return found


def test_a_page_tells_what_the_record_of_the_drive_will_say(house: House) -> None:
    house.drive(20)
    rounds = house.conductor.rounds
    rounds.tally.due, rounds.tally.run, rounds.tally.missed = 5, 3, 2
    rounds.futures.latencies_ms.take(120.0)

    page = told(DriveCounts(house.conductor).samples(1e6))

    assert page["rounds_due_total"] == 5
    ended = {how: page[f'rounds_ended_total{{how="{how}"}}'] for how in ("run", "missed")}
    assert ended == {"run": 3, "missed": 2}
    assert page["telemetry_received_total"] == house.conductor.intake.counts.received > 0
    assert page['result_latency_seconds{quantile="0.95"}'] == pytest.approx(0.12)
    assert page["drive_seconds"] == pytest.approx(1.9)
    states = {name: value for name, value in page.items() if name.startswith("worker_state")}
    assert sum(states.values()) == house.plan.config.workers
    assert page["telemetry_age_seconds"] > 0.0


def test_jobs_wait_or_are_at_work(house: House) -> None:
    house.drive(20)
    assert house.conductor.start_round()

    page = told(DriveCounts(house.conductor).samples(1.0))

    jobs = len(house.conductor.rounds.open.orders[0].jobs)
    open_jobs = {state: page[f'jobs_open{{state="{state}"}}'] for state in ("at_work", "waiting")}
    assert page["rounds_open"] == 1
    assert sum(open_jobs.values()) == jobs == page["jobs_given_total"]
    assert 0 < open_jobs["at_work"] <= house.plan.config.workers

    for named in house.conductor.rounds.open.orders[0].recorded:  # their workers are at them still
        house.conductor.rounds.dispatcher.cancel(named.sha256)
    page = told(DriveCounts(house.conductor).samples(1.0))
    assert page['jobs_open{state="at_work"}'] == page['jobs_open{state="waiting"}'] == 0


def test_the_age_of_results_begins_with_the_first_one(house: House) -> None:
    counts = DriveCounts(house.conductor)
    counts.look(10.0)
    assert "result_age_seconds" not in told(counts.samples(11.0))
    house.conductor.rounds.futures.rounds = 1

    counts.look(12.0)
    counts.look(13.0)

    assert told(counts.samples(15.0))["result_age_seconds"] == 3.0


def test_workers_on_other_computers_are_told_with_their_link(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    far = WorkerStatus(
        stamp_ns=0, worker_id="box-1", state="sick", link_ms=12.0, clock_offset_ms=-3.0
    )
    monkeypatch.setattr(operator_metrics, "worker_statuses", lambda *_: [far])

    page = told(DriveCounts(house.conductor).samples(1.0))

    assert page['worker_state{worker="box-1",state="sick"}'] == 1
    assert page['worker_link_seconds{worker="box-1"}'] == 0.012
    assert page['worker_clock_offset_seconds{worker="box-1"}'] == -0.003
    assert not any("speed_ratio" in name for name in page)


def test_whatever_a_name_holds_is_told_as_one_line() -> None:
    odd = MetricSample("queue_length", 1.5, (("queue", 'a"b\\c\nd'),))

    page = exposition([odd])

    assert page.splitlines()[-1] == f'{PREFIX}queue_length{{queue="a\\"b\\\\c\\nd"}} 1.5'
    assert page.splitlines()[1] == f"# TYPE {PREFIX}queue_length gauge"


def test_processes_are_told_by_what_they_wrote(tmp_path: Path) -> None:
    CpuMeter(tmp_path, "w0").write()
    (tmp_path / f"w1-{os.getpid()}.cpu").write_bytes(b"half of it")

    page = told(process_samples(tmp_path))

    assert page['process_starts_total{process="w0"}'] == 1
    assert page['process_cpu_seconds_total{process="w0"}'] > 0.0
    assert not any("w1" in name for name in page)


@pytest.mark.judge
def test_prometheus_own_parser_reads_a_page(house: House, tmp_path: Path) -> None:
    python = Path(os.environ.get("JUDGES_VENV", "nowhere")) / "bin" / "python"
    if not python.is_file():
        pytest.skip("JUDGES_VENV names no environment with prometheus-client")
    house.drive(10)
    samples = DriveCounts(house.conductor).samples(1.0)
    (tmp_path / "page").write_text(exposition(samples), encoding="utf-8")
    code = (
        "import sys; from prometheus_client.parser import text_string_to_metric_families as read;"
        "print(sum(len(one.samples) for one in read(open(sys.argv[1]).read())))"
    )

    counted = subprocess.run(
        [python, "-c", code, tmp_path / "page"], capture_output=True, text=True, check=True
    ).stdout

    assert int(counted) == len(samples) > 30


def test_every_metric_is_in_the_document_and_none_else() -> None:
    text = (ROOT / "docs" / "operators.md").read_text(encoding="utf-8")
    rows = re.findall(rf"^\| `{PREFIX}(\w+)(?:\{{[^`]*\}})?` \|", text, re.MULTILINE)

    assert rows == list(METRICS)


def test_who_knocks_is_counted_by_who_did_not_let_it_in(house: House, tmp_path: Path) -> None:
    for by, count in (("router", 3), ("recorder", 2), ("w0", 1)):
        kind = RefusedKind(sender="viewer", reason="say", key="k", count=count)
        RefusalFile(tmp_path, by).write(OwnRefusals(kinds=(kind,)))
    page = told([*DriveCounts(house.conductor).samples(1.0), *process_samples(tmp_path)])
    refused = {name: value for name, value in page.items() if name.startswith("refused_total")}
    assert refused == {
        'refused_total{by="orchestrator"}': 0.0,
        'refused_total{by="router"}': 3.0,
        'refused_total{by="processes"}': 3.0,
    }
