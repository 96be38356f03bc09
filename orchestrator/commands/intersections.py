"""The command that lists the junctions of a map."""

from __future__ import annotations

from pathlib import Path

import msgspec

from foretwin.orchestrator.worlds.choice import junctions_along, read_route
from foretwin.orchestrator.worlds.opening import Clip, open_map


def list_intersections(
    map_file: Path, *, route: Path | None, as_json: bool, service_roads: bool = False
) -> None:
    """Print the junctions of a map, or those along a line, in driving order.

    Service roads count where the line uses them, or everywhere if asked for.
    """
    if route is not None:
        line_deg = read_route(route)
        opened = open_map(map_file, clip=Clip(line_deg, 0.0), service_roads=service_roads)
        junctions = junctions_along(opened, route, line_deg).junctions
    else:
        opened = open_map(map_file, service_roads=service_roads)
        junctions = tuple(sorted(opened.junctions, key=lambda j: j.summary.id))
    if as_json:
        body = msgspec.json.encode([j.summary for j in junctions])
        print(msgspec.json.format(body, indent=1).decode())
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("id", "kind", "control", "arms", "lat", "lon", "name", title=str(map_file))
    for junction in junctions:
        s = junction.summary
        table.add_row(s.id, s.kind, s.control, str(s.arms), f"{s.lat:.6f}", f"{s.lon:.6f}", s.name)
    Console().print(table)
