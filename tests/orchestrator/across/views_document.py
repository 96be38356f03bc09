"""The views as docs/query.md lists them: `python -m tests.orchestrator.across.views_document`
writes them there."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.across.run_rows import RunRow
from foretwin.orchestrator.across.tables import RUN, RUNS
from foretwin.orchestrator.record.results import TABLES

DOCUMENT = Path(__file__).parents[3] / "docs" / "query.md"
BEGIN = "### Views\n"
_SAID = {
    RUNS: "a run or sweep; `record` is its run.json or sweep.json",
    "futures": "a future; the columns that begin with `metric_` are [metrics](metrics.md)",
    "jobs": "a job, with all that decides it",
    "road_users": "a road user that all futures of a job share",
    "metrics": "what a metric of the run's futures means",
    "rounds": "a round of futures",
    "comparisons": "the nominal future beside what was driven, by horizon",
    "forecasts": "what came of a forecast of the car's progress ([progress](progress.md))",
    "plan_comparisons": "a plan of the driving software beside what was driven",
    "disagreements": "a stretch where human and software differ ([judging](judging.md))",
    "driven_segments": "a stretch that one of them drove",
    "agreement": "a window judged as simulated and as driven",
    "windows": "what that was judged from",
    "siblings": "a future that a second engine played as well ([engines](engines.md))",
    "mirror": "car, twin, shadow and ghost at an instant ([roles](roles.md))",
    "mirrored": "the same of another vehicle",
    "virtual_road_users": "a road user of [virtual traffic](virtual-traffic.md) at an instant",
    "touches": "a vehicle of the mirror that touches another",
    "encounters": "two vehicles that came near each other ([roles](roles.md))",
    "changes": "a change of the running drive by `foretwin set`",
    "parameters": "a change of the vehicle's parameters ([tuning](tuning.md))",
    "identifications": "an estimate of a parameter ([identification](identification.md))",
    "gaps": "how far the model was from the car after a horizon ([gap](gap.md))",
    "verdicts": "who departs, vehicle or model, and why",
    "junctions": "a passage of a junction",
    "events": "an event of the drive",
    "marks": "an event that somebody marked, or a note to one ([co-pilot display](copilot.md))",
}


def views_text() -> str:
    """Return a row for each view, with its columns in their order."""
    columns = {RUNS: list(RunRow.__struct_fields__)}
    columns |= {name: [RUN, *table.names] for name, table in TABLES.items()}
    lines = ["| view | one row is | columns |", "|---|---|---|"]
    for view, names in columns.items():
        told = [f"`{name}`" for name in names if not name.startswith("metric_")]
        told += ["`metric_…`"] if len(told) < len(names) else []
        lines.append(f"| `{view}` | {_SAID[view]} | {', '.join(told)} |")
    return "\n".join(lines) + "\n"


def written(text: str) -> str:
    """Return the document with the list in place of what stood there."""
    before, _, after = text.partition(BEGIN)
    rest = after.partition("\n## ")
    return f"{before}{BEGIN}\n{views_text()}" + ("\n## " + rest[2] if rest[1] else "")


if __name__ == "__main__":
    DOCUMENT.write_text(written(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
