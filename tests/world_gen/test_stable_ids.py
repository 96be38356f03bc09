"""Same map, same id; edits elsewhere change no junction's id, nor what is told of it."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.world import IntersectionSummary
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.sketch import Sketch
from tests.world_gen.test_real_maps import MAPS

COVERS = ("foretwin.world_gen.junctions.map_index",)

EDITS = st.lists(
    st.tuples(
        st.sampled_from(["far crossing", "shape node", "cut way", "side road", "building", "name"]),
        st.floats(0.3, 0.7),
        st.booleans(),
    ),
    max_size=8,
)


def _town(edits: list[tuple[str, float, bool]]) -> Sketch:
    """Return a crossing, a T and a dual carriageway crossed by a street, 300 m apart, edited.

    New nodes have ids below or above all others.
    """
    sketch = Sketch()
    low, high = 1, 10_000
    places = {
        1000: (0, 0),
        1001: (300, 0),
        1002: (600, -8),
        1003: (600, 8),
        1004: (-200, 0),
        1005: (0, 200),
        1006: (0, -200),
        1007: (300, 200),
        1008: (600, 200),
        1009: (600, -200),
        1010: (900, -8),
        1011: (900, 8),
        1012: (580, 0),
    }
    for node, (x_m, y_m) in places.items():
        sketch.node(node, x_m, y_m)
    roads = [
        ([1004, 1000], "West", "no"),
        ([1000, 1001], "Mitte", "no"),
        ([1001, 1012], "Ost", "no"),
        ([1000, 1005], "Nord", "no"),
        ([1006, 1000], "Süd", "no"),
        ([1001, 1007], "Stich", "no"),
        ([1012, 1002, 1010], "Allee", "yes"),
        ([1011, 1003, 1012], "Allee", "yes"),
        ([1008, 1003, 1002, 1009], "Quer", "no"),
    ]
    way = 5000
    pending = list(edits)
    for nodes, name, oneway in roads:
        pieces = [nodes]
        # Edits of a road apply to the long straight ones alone, far from their ends.
        if len(nodes) == 2 and pending and pending[0][0] in ("shape node", "cut way", "side road"):
            kind, part, below = pending.pop(0)
            new = low if below else high
            low, high = low + 10, high + 10
            (x0, y0), (x1, y1) = places[nodes[0]], places[nodes[1]]
            sketch.node(new, x0 + (x1 - x0) * part, y0 + (y1 - y0) * part)
            pieces = [[nodes[0], new, nodes[1]]]
            if kind == "cut way":
                pieces = [[nodes[0], new], [new, nodes[1]]]
            if kind == "side road":
                sketch.node(new + 1, x0 + (x1 - x0) * part + 40, y0 + (y1 - y0) * part + 60)
                sketch.road(way + 500, [new, new + 1], "Neuweg")
        for piece in pieces:
            way += 1
            sketch.road(way, piece, name, highway="tertiary", oneway=oneway)
    for number, (kind, part, below) in enumerate(edits):
        base = (100 if below else 20_000) + 10 * number
        x_m, y_m = 2000.0 + 300.0 * number, 500.0 * part
        if kind == "far crossing":
            for k, (dx, dy) in enumerate(((0, 0), (80, 0), (-80, 0), (0, 80))):
                sketch.node(base + k, x_m + dx, y_m + dy)
            for k in (1, 2, 3):
                sketch.road(30_000 + base + k, [base, base + k], "Fern")
        elif kind == "building":
            corners = [
                sketch.node(base + k, 30 + 10 * (k in (1, 2)), 30 + 10 * (k > 1) + 50 * part)
                for k in range(4)
            ]
            sketch.way(30_000 + base, [*corners, corners[0]], building="yes")
    return sketch


def _summaries(sketch: Sketch) -> dict[str, IntersectionSummary]:
    with tempfile.TemporaryDirectory() as folder:
        return {j.summary.id: j.summary for j in sketch.junctions(Path(folder))}


BEFORE = {"n1000", "n1001", "n1002"}


@given(EDITS)
def test_edits_between_and_beyond_junctions_change_no_id(
    edits: list[tuple[str, float, bool]],
) -> None:
    found = _summaries(_town(edits))
    plain = _summaries(_town([]))
    assert plain.keys() == BEFORE
    for key, before in plain.items():
        after = found[key]
        assert (after.kind, after.arms, after.control, after.osm_nodes, after.name) == (
            before.kind,
            before.arms,
            before.control,
            before.osm_nodes,
            before.name,
        )
        # The map's frame moves with its bounds; places stay within a centimetre.
        assert (after.lat, after.lon) == pytest.approx((before.lat, before.lon), abs=2e-7)
    crossings = sum(kind == "far crossing" for kind, _, _ in edits)
    assert len(found) >= len(BEFORE) + crossings


def _without(osm: OsmMap, lat_deg: float, lon_deg: float, radius_m: float) -> OsmMap:
    """Return a map without the ways that come within a radius of a place."""
    nodes, lat_lon = osm.locations.ids, osm.locations.lat_lon_deg
    place = local_from_geo(osm.frame, lat_deg, lon_deg)
    xy_m = local_from_geo(osm.frame, lat_lon[:, 0], lat_lon[:, 1])
    near = set(nodes[np.hypot(*(xy_m - place).T) < radius_m].tolist())
    ways = {key: way for key, way in osm.ways.items() if near.isdisjoint(way.nodes)}
    assert len(ways) < len(osm.ways)
    return msgspec.structs.replace(osm, ways=ways)


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name", ["berlin-mitte", "monaco", pytest.param("badhersfeld", marks=pytest.mark.judge)]
)
def test_what_is_torn_down_elsewhere_leaves_junctions_as_they_are(
    name: str, data_dir: Path
) -> None:
    osm = read_map(data_dir / MAPS[name])
    graph = build_road_graph(osm)
    before = find_intersections(osm, graph)
    again = find_intersections(read_map(data_dir / MAPS[name]), build_road_graph(osm))
    assert [j.summary for j in again] == [j.summary for j in before]
    for junction in random.Random(7).sample(before, 1):
        place = (junction.summary.lat, junction.summary.lon)
        torn = _without(osm, *place, 60.0)
        left = find_intersections(torn, build_road_graph(torn))
        after = {j.summary.id: j.summary for j in left}
        compared = 0
        touched = {way for way in osm.ways if way not in torn.ways}
        for other in before:
            # Roads are followed to their next branching: what hangs on a lost way may change.
            ways = {leg.edge.way_id for arm in other.arms for leg in arm.outward}
            ways |= {graph.edges[index].way_id for index in other.inner}
            apart_m = float(np.hypot(*(other.centre_xy_m - junction.centre_xy_m)))
            if apart_m > 200.0 and ways.isdisjoint(touched):
                assert after[other.summary.id] == other.summary
                compared += 1
        assert compared > len(before) // 4
