"""Map files for tests, and what both readers must say of them."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from foretwin.world_gen.osm.map_store import MapStore
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError, OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from tests.world_gen.sketch import Sketch, star

EVERYWHERE = LatLonBounds(-90.0, -180.0, 90.0, 180.0)


def crossing() -> Sketch:
    return star([0.0, 90.0, 180.0, 270.0])


def with_more(xml: str) -> str:
    """Return the crossing with more objects in the file."""
    return crossing().xml().replace("</osm>", f"{xml}</osm>")


def file_of(folder: Path, text: str | bytes | Sketch, name: str = "map.osm") -> Path:
    path = folder / name
    body = text.xml() if isinstance(text, Sketch) else text
    path.write_bytes(body if isinstance(body, bytes) else body.encode())
    return path


def both_ways(path: Path, folder: Path) -> OsmMap:
    """Read a map whole and through an index, which must agree."""
    whole = read_map(path)
    store = MapStore.open(path, folder / "index")
    clip = store.clip(EVERYWHERE)
    assert (clip.ways, clip.locations, clip.frame) == (whole.ways, whole.locations, whole.frame)
    assert set(clip.notes) <= set(whole.notes)
    return whole


def refused(path: Path, folder: Path, complaint: str) -> None:
    """Expect the same line from the reader and from the index."""
    for read in (read_map, lambda p: MapStore.open(p, folder / "index")):
        begin_s = time.process_time()
        with pytest.raises(MapError, match=complaint) as caught:
            read(path)
        message = str(caught.value)
        assert message.startswith(str(path))
        assert "\n" not in message
        assert time.process_time() - begin_s < 10.0
