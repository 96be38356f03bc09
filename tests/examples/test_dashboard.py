"""The Grafana dashboard asks for nothing that a drive does not tell."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from foretwin.orchestrator.drive.operator_metrics import METRICS, PREFIX
from tests.test_layout import ROOT

DASHBOARD = ROOT / "examples" / "grafana" / "foretwin-drive.json"
LABELS = {"instance", "how", "quantile", "state", "worker", "process", "queue", "of", "run_id"}
"""Those of our metrics, and what Prometheus adds."""


def dashboard(file: Path = DASHBOARD) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def queries() -> list[str]:
    panels = [target["expr"] for one in dashboard()["panels"] for target in one["targets"]]
    return panels + [one["query"] for one in dashboard()["templating"]["list"]]


def test_every_query_names_metrics_that_exist() -> None:
    asked = {name for query in queries() for name in re.findall(rf"\b{PREFIX}\w+", query)}

    assert asked - {PREFIX + name for name in METRICS} == set()
    assert len(asked) > 20


def test_only_what_counts_up_is_asked_for_its_rate() -> None:
    rated = re.findall(rf"(?:rate|increase)\({PREFIX}(\w+)", " ".join(queries()))

    assert {METRICS[name].kind for name in rated} == {"counter"}
    assert {name for name, metric in METRICS.items() if metric.kind == "counter"} == {
        name for name in METRICS if name.endswith("_total")
    }


def test_labels_of_queries_and_legends_exist() -> None:
    told = [one["legendFormat"] for panel in dashboard()["panels"] for one in panel["targets"]]
    legends = set(re.findall(r"\{\{(\w+)\}\}", " ".join(told)))
    chosen = set(re.findall(r"(\w+)(?:=~|!=|=)\"", " ".join(queries())))
    grouped = set(re.findall(r"by \((\w+)\)", " ".join(queries())))

    assert legends | chosen | grouped <= LABELS


def test_panels_have_places_of_their_own() -> None:
    panels = dashboard()["panels"]
    taken = [
        (x, y)
        for at in (panel["gridPos"] for panel in panels)
        for x in range(at["x"], at["x"] + at["w"])
        for y in range(at["y"], at["y"] + at["h"])
    ]

    assert len(set(taken)) == len(taken)
    assert max(x for x, _ in taken) < 24
    assert len({panel["id"] for panel in panels}) == len(panels)
