"""The command `map index`: read a map of any size into an index on disk, once."""

from __future__ import annotations

import time
from pathlib import Path

from foretwin.orchestrator.commands.output import size_words
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.worlds.indexing import open_index

_SHOWN_NOTES = 5


def index_map_file(map_file: Path, *, folder: Path | None) -> CommandResult:
    """Build the index of a map in `folder`, by default in the user's cache, unless it is there."""
    begin_s = time.monotonic()
    store = open_index(map_file, folder)
    meta, size_bytes = store.meta, store.path.stat().st_size
    took_s = time.monotonic() - begin_s
    store.close()
    lines = [
        f"{store.path}: {meta.ways} ways, {meta.nodes} nodes of {map_file} "
        f"({size_words(size_bytes)}, {took_s:.1f} s). {meta.attribution}",
        *(f"note: {note}" for note in meta.notes[:_SHOWN_NOTES]),
    ]
    if len(meta.notes) > _SHOWN_NOTES:
        lines.append(f"note: and {len(meta.notes) - _SHOWN_NOTES} more")
    body = {
        "index": store.path,
        "map": map_file,
        "ways": meta.ways,
        "nodes": meta.nodes,
        "size_bytes": size_bytes,
        "took_s": round(took_s, 3),
        "notes": meta.notes,
        "attribution": meta.attribution,
    }
    return CommandResult(body, "\n".join(lines))
