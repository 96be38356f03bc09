"""One World of a cut-out 500 m wide, from the middle of Bad Hersfeld, against netconvert."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import osmium

from tests.benchmarks.measuring import Measurement, UnavailableError
from tests.benchmarks.netconvert import compare

WEST, SOUTH, EAST, NORTH = 9.7040, 50.8655, 9.7111, 50.8700


def measure() -> Measurement:
    """Return wall seconds of whole processes, and of the work inside ours."""
    data = os.environ.get("FORETWIN_DATA")
    if not data:
        raise UnavailableError("FORETWIN_DATA does not name the real maps")
    source = Path(data) / "osm-badhersfeld" / "badhersfeld.osm.xml.gz"
    with tempfile.TemporaryDirectory(prefix="foretwin-bench-") as folder:
        target = Path(folder) / "cutout.osm"
        cut_out(source, target)
        return compare(target)


def cut_out(source: Path, target: Path) -> None:
    """Write the ways that have a node within the box, and the relations of these, complete."""
    ways = osmium.FileProcessor(str(source), osmium.osm.NODE | osmium.osm.WAY).with_locations()
    only_ways = osmium.filter.EntityFilter(osmium.osm.WAY)
    with osmium.BackReferenceWriter(str(target), ref_src=str(source), relation_depth=1) as writer:
        for way in ways.with_filter(only_ways):
            if any(_within(node) for node in way.nodes):
                writer.add(way)


def _within(node: osmium.osm.NodeRef) -> bool:
    place = node.location
    return bool(place.valid()) and WEST <= place.lon <= EAST and SOUTH <= place.lat <= NORTH
