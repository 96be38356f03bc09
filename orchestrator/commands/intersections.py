"""The command that lists the junctions of a map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from foretwin.contracts.world import IntersectionSummary
from foretwin.orchestrator.commands.output import print_table
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.choice import choose_junctions

_WHOLE = ("id", "lat", "lon")


def list_intersections(
    map_file: Path, *, route: Path | None, service_roads: bool = False
) -> CommandResult:
    """Return the junctions of a map, or those along a line, in driving order.

    Service roads count where the line uses them, or everywhere if asked for.
    """
    junctions = choose_junctions(map_file, route=route, service_roads=service_roads).junctions
    found = [junction.summary for junction in junctions]
    return CommandResult(found, lambda: _print(map_file, found))


def _print(map_file: Path, found: Sequence[IntersectionSummary]) -> None:
    from rich.table import Column

    # Ids and places are copied from here; words go on in the next line.
    names = ("id", "kind", "control", "arms", "lat", "lon", "name")
    columns = [Column(one, no_wrap=one in _WHOLE, overflow="fold") for one in names]
    rows = [
        (s.id, s.kind, s.control, s.arms, f"{s.lat:.6f}", f"{s.lon:.6f}", s.name) for s in found
    ]
    print_table(str(map_file), columns, rows)
