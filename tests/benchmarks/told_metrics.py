"""What a page of metrics costs a drive's loop, against a sample of the car's positions."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from foretwin.orchestrator.drive.metrics_server import told_metrics
from foretwin.orchestrator.drive.operator_metrics import DriveCounts, exposition
from tests.benchmarks.measuring import Measurement, cpu_minimum_s
from tests.orchestrator.house import House

SAMPLES, PAGES, TURNS = 40, 50, 10_000


def measure() -> Measurement:
    """Return CPU seconds of the loop for one page; the baseline is one sample taken by it."""
    with tempfile.TemporaryDirectory() as folder:
        house = House(Path(folder))
        try:
            return _measure(house)
        finally:
            house.tables.close()


def _measure(house: House) -> Measurement:
    house.drive(SAMPLES, round_every=5)
    takes_s = []
    for number in range(SAMPLES, 2 * SAMPLES):
        began_s = time.process_time()
        house.drive(number + 1, working=False)
        takes_s.append(time.process_time() - began_s)
    counts = DriveCounts(house.conductor)

    def pages() -> None:
        for _ in range(PAGES):
            counts.samples(1.0)

    def text() -> None:
        exposition(counts.samples(1.0))

    def turns() -> None:
        with told_metrics(None, counts.samples, processes=Path()) as look:
            for _ in range(TURNS):
                counts.look(1.0)
                look(1.0)

    page_s = cpu_minimum_s(pages, repeats=10) / PAGES
    more = {
        "page_and_text_ms": 1e3 * cpu_minimum_s(text, repeats=20),
        "turn_without_a_page_us": 1e6 * cpu_minimum_s(turns, repeats=5) / TURNS,
    }
    return Measurement(page_s, "CPU s", min(takes_s), more)
