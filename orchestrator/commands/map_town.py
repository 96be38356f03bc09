"""The command `map town`: the drawn town as files, for who has no map at hand."""

from __future__ import annotations

import shutil
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import plain
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE


def write_town(out: Path) -> CommandResult:
    """Write the town's map to `out` and its route to a `.geojson` of that name.

    Raises UserError where `out` is not named as a map, OSError where it cannot be written.
    """
    if out.suffix != ".osm":
        raise UserError(f"--out {out}: a file named .osm")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: folder {out.parent} does not exist")
    route = out.with_suffix(".geojson")
    for source, target in ((MAP_FILE, out), (ROUTE_FILE, route)):
        shutil.copyfile(source, target)
    words = plain(f"{out} and a route, {route}: drawn for foretwin, an invented town")
    return CommandResult({"map": out, "route": route}, words)
