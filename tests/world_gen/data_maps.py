"""Which real maps a measuring command reads: those of the data folder, by the words it is given."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NoReturn

MAPS = {
    "austin": "osm-austin-downtown/austin.osm.gz",
    "badhersfeld": "osm-badhersfeld/badhersfeld.osm.xml.gz",
    "berlin-mitte": "osm-berlin-mitte/berlin-mitte.osm",
    "grosser-stern": "osm-berlin-grosser-stern/berlin-siegessaeule.osm.gz",
    "kingsway": "osm-kingsway/kingsway_junction.osm",
    "leeds": "osm-leeds/leeds.osm.gz",
    "liechtenstein": "osm-liechtenstein/liechtenstein-latest.osm.pbf",
    "monaco": "osm-monaco/monaco.osm.gz",
    "moritzplatz": "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    "testfeld": "osm-testfeld-nds/TestfeldNDS_main_roads.osm.xml.gz",
}


def data_folder() -> Path:
    """Return the folder named by FORETWIN_DATA; where it names none, end the command."""
    folder = os.environ.get("FORETWIN_DATA", "")
    if not Path(folder or "?").is_dir():
        _end("FORETWIN_DATA names no folder with maps and drives")
    return Path(folder)


def named(words: Sequence[str], names: Iterable[str]) -> list[str]:
    """Return the names that are one of the words or hold it, all of them where there is no word.

    A word that no name holds ends the command, in one line and with exit code 2.
    """
    names = list(names)
    chosen = set() if words else set(names)
    for word in words:
        found = [word] if word in names else [name for name in names if word in name]
        if not found:
            _end(f"{word} is none of {', '.join(names)}")
        chosen.update(found)
    return [name for name in names if name in chosen]


def _end(line: str) -> NoReturn:
    print(line, file=sys.stderr)
    sys.exit(2)
