"""The command `map index`: read a map of any size into an index on disk, once."""

from __future__ import annotations

import time
from pathlib import Path

from foretwin.contracts.terminal import console, described, plain, say
from foretwin.world_gen.osm.map_store import MapStore


def open_index(map_file: Path, folder: Path | None) -> MapStore:
    """Open the index of a map; where it is not there yet it is made behind a progress bar."""
    from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn

    shown = console(error=True)
    columns = described(), BarColumn(), DownloadColumn(), TimeRemainingColumn()
    bar = Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal)
    with bar:
        task = bar.add_task(plain(f"reading {map_file.name}"), total=None)

        def show(done: int, total: int) -> None:
            if done >= total:
                bar.update(task, completed=done, total=total, description="sorting into cells")
            else:
                bar.update(task, completed=done, total=total)

        return MapStore.open(map_file, folder, show)


def index_map_file(map_file: Path, *, folder: Path | None) -> None:
    """Build the index of a map in `folder`, by default in the user's cache, unless it is there."""
    begin_s = time.monotonic()
    store = open_index(map_file, folder)
    meta = store.meta
    say(
        f"{store.path}: {meta.ways} ways, {meta.nodes} nodes of {map_file} "
        f"({store.path.stat().st_size / 1e6:.1f} MB, {time.monotonic() - begin_s:.1f} s). "
        f"{meta.attribution}"
    )
    for note in meta.notes[:5]:
        say(f"note: {note}")
    if len(meta.notes) > 5:
        say(f"note: and {len(meta.notes) - 5} more")
    store.close()
