"""The command `map get`: a map of a box or along a route from an Overpass endpoint."""

from __future__ import annotations

import gzip
import os
import shutil
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import console, described, plain, visible
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.overpass import OverpassConfig, fetch_map, load_overpass_config
from foretwin.orchestrator.worlds.overpass_query import (
    box_filter,
    line_filter,
    overpass_query,
    parse_bbox,
)

ROUTE_SUFFIXES = (".gpx", ".geojson", ".json")


def get_map(area: str, *, out: Path, config: Path | None) -> CommandResult:
    """Write the map of `area`, a box W,S,E,N or a file with a line, to `out`, whole or not at all.

    `config` names a TOML file with a table `[overpass]`; nobody is asked without. Raises UserError
    in one line where the endpoint gives no complete map.
    """
    if not out.name.endswith((".osm", ".osm.gz")):
        raise UserError(f"--out {out}: a file named .osm or .osm.gz")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: folder {out.parent} does not exist")
    if not _is_route(area):
        parse_bbox(area)
    settings = load_overpass_config(config)
    query = overpass_query(
        area_filter(area, margin_m=settings.margin_m),
        timeout_s=int(settings.timeout_s),
        max_bytes=max(settings.max_bytes, 1 << 29),
    )
    answer = out.with_name(f".{out.name}.{os.getpid()}.part")
    packed = answer.with_suffix(".gz")
    try:
        _fetch(settings, query, answer)
        counts = _count(answer, out)
        if out.suffix == ".gz":
            with answer.open("rb") as source, gzip.open(packed, "wb") as target:
                shutil.copyfileobj(source, target)
            packed.replace(out)
        else:
            answer.replace(out)
    finally:
        answer.unlink(missing_ok=True)
        packed.unlink(missing_ok=True)
    from foretwin.contracts.world import ATTRIBUTION

    found = {"ways": counts["w"], "nodes": counts["n"], "relations": counts["r"]}
    return CommandResult(
        {"map": out, **found, "attribution": ATTRIBUTION},
        f"{out}: {counts['w']} ways, {counts['n']} nodes. {ATTRIBUTION}",
    )


def area_filter(area: str, *, margin_m: float) -> str:
    """Return the Overpass filter of a box W,S,E,N, or of the surroundings of a file's line."""
    if not _is_route(area):
        return box_filter(parse_bbox(area))
    from foretwin.orchestrator.worlds.choice import read_route

    return line_filter(read_route(Path(area)), margin_m)


def _is_route(area: str) -> bool:
    return Path(area.rpartition("#")[0] or area).suffix.lower() in ROUTE_SUFFIXES


def _fetch(settings: OverpassConfig, query: str, answer: Path) -> None:
    from rich.progress import DownloadColumn, Progress, SpinnerColumn

    shown = console(error=True)
    columns = (SpinnerColumn(), described(), DownloadColumn())
    bar = Progress(*columns, console=shown, disable=not shown.is_terminal)
    with bar, answer.open("w+b") as target:
        task = bar.add_task(plain(f"asking {settings.endpoint}"), total=None)

        def show(done: int, total: int | None) -> None:
            bar.update(task, completed=done, total=total)

        def tell(text: str) -> None:
            shown.print(visible(text))

        fetch_map(settings, query, target, progress=show, said=tell)


def _count(answer: Path, out: Path) -> dict[str, int]:
    """Decode the whole answer; MapError where it is damaged, UserError where it is empty."""
    from foretwin.world_gen.osm.opl import sections
    from foretwin.world_gen.osm.opl_stream import OplStream

    counts = dict.fromkeys("nwr", 0)
    with OplStream(answer) as stream:
        for block in stream.blocks():
            for letter, section in sections(block):
                counts[letter] += section.count(b"\n")
    if not counts["w"]:
        raise UserError(f"--out {out}: the area holds no roads and no buildings; nothing written")
    return counts
