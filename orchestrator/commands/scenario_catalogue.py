"""The commands on scenarios alone: list the catalogue, check a file.

Nothing is played and no map is read: what that needs would take a second to import.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from foretwin.contracts.scenario import Scenario
from foretwin.orchestrator.commands.output import print_table
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.sim_worker.scenarios.drawing import case_count
from foretwin.sim_worker.scenarios.reading import catalogue, read_scenario


def list_scenarios() -> CommandResult:
    """Return the catalogue."""
    found = list(catalogue().values())
    return CommandResult(
        [_described(scenario) for scenario in found], lambda: _print_catalogue(found)
    )


def _print_catalogue(found: Sequence[Scenario]) -> None:
    from rich.table import Column

    columns = (Column("id", no_wrap=True), "title", "cases", "where", "source")
    rows = [(s.id, s.title, case_count(s), _where(s), s.source) for s in found]
    print_table("scenarios", columns, rows)


def check_scenario_file(file: Path) -> CommandResult:
    """Return what a scenario file holds; UserError, in one line, where it holds none."""
    scenario = read_scenario(file)
    found = _described(scenario)
    words = f"{file}: {scenario.id}, {scenario.title}: {found['cases']} cases, {_where(scenario)}"
    return CommandResult({"file": file, **found}, words)


def _described(scenario: Scenario) -> dict[str, object]:
    return {
        "id": scenario.id,
        "title": scenario.title,
        "shows": scenario.shows,
        "source": scenario.source,
        "setting": scenario.where.setting,
        "kinds": scenario.where.kinds,
        "controls": scenario.where.controls,
        "actors": [
            {"name": a.name, "kind": a.kind, "relation": a.relation, "conduct": a.conduct}
            for a in scenario.actors
        ],
        "cases": case_count(scenario),
        "horizon_s": scenario.horizon_s,
    }


def _where(scenario: Scenario) -> str:
    where = scenario.where
    if where.setting != "junction":
        return where.setting.replace("_", " ")
    return ", ".join((*where.kinds, *where.controls)) or "any junction"
