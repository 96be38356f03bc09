"""Opens the index of a map, and makes it behind a progress bar where it is not there yet."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.terminal import console, described, plain
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
