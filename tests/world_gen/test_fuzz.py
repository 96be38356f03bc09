"""Maps drawn by chance go the whole way, from the file to models that compile."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.world import World
from tests.world_gen.chain import build_all
from tests.world_gen.sketch import MANCHESTER, NORTH_SEA_COAST, Sketch

NODES = 16
STEP_M = 17.0
CASES = int(os.environ.get("FORETWIN_FUZZ_CASES", "10000"))

WORDS = st.one_of(
    st.sampled_from(
        [
            "yes",
            "no",
            "-1",
            "0",
            "3",
            "999",
            "-3",
            "1.5",
            "walk",
            "none",
            ";",
            "|",
            "left",
            "right",
            "through",
            "both",
            "12 m",
            "30 mph",
            "nan",
            "1e9",
        ]
    ),
    st.text(
        st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff"),
        max_size=8,
    ),
)
CLASSES = st.sampled_from(
    [
        "residential",
        "primary",
        "secondary",
        "motorway",
        "motorway_link",
        "service",
        "track",
        "living_street",
        "tertiary_link",
        "footway",
        "cycleway",
        "steps",
        "raceway",
        "construction",
    ]
)
TURNS = st.lists(
    st.sampled_from(
        [
            "left",
            "right",
            "through",
            "left;through",
            "",
            "none",
            "reverse",
            "slight_left",
            "merge_to_left",
            "bad",
        ]
    ),
    min_size=1,
    max_size=5,
).map("|".join)
ROAD_TAGS = st.fixed_dictionaries(
    {"highway": CLASSES},
    optional={
        "lanes": st.one_of(st.integers(-2, 8).map(str), WORDS),
        "lanes__forward": st.one_of(st.integers(0, 4).map(str), WORDS),
        "lanes__backward": st.one_of(st.integers(0, 4).map(str), WORDS),
        "oneway": st.one_of(st.sampled_from(["yes", "no", "-1"]), WORDS),
        "junction": st.one_of(st.sampled_from(["roundabout", "circular"]), WORDS),
        "turn__lanes": st.one_of(TURNS, WORDS),
        "turn__lanes__forward": TURNS,
        "change__lanes": st.one_of(TURNS, WORDS),
        "maxspeed": WORDS,
        "width": st.one_of(st.floats(-5, 60).map(str), WORDS),
        "placement": st.one_of(st.sampled_from(["left_of:1", "right_of:3", "transition"]), WORDS),
        "sidewalk": WORDS,
        "cycleway": st.one_of(st.sampled_from(["lane", "track", "opposite_lane"]), WORDS),
        "busway": st.sampled_from(["lane", "opposite_lane"]),
        "parking__both": st.sampled_from(["lane", "street_side", "no"]),
        "layer": st.one_of(st.integers(-3, 3).map(str), WORDS),
        "bridge": WORDS,
        "tunnel": WORDS,
        "access": st.sampled_from(["no", "private", "destination", "yes"]),
        "priority_road": st.sampled_from(["designated", "end"]),
        "name": WORDS,
        "dual_carriageway": st.just("yes"),
        "embedded_rails": st.just("tram"),
    },
)
BUILDING_TAGS = st.fixed_dictionaries(
    {},
    optional={
        "building": st.one_of(st.just("yes"), WORDS),
        "building__part": st.sampled_from(["yes", "no"]),
        "height": WORDS,
        "min_height": WORDS,
        "building__levels": WORDS,
        "roof__levels": WORDS,
        "railway": st.sampled_from(["tram", "level_crossing", "rail"]),
        "area__highway": st.just("residential"),
        "barrier": st.sampled_from(["kerb", "wall"]),
    },
)
NODE_TAGS = st.fixed_dictionaries(
    {},
    optional={
        "highway": st.sampled_from(
            [
                "traffic_signals",
                "stop",
                "give_way",
                "crossing",
                "mini_roundabout",
                "turning_circle",
                "street_lamp",
            ]
        ),
        "crossing": st.one_of(st.sampled_from(["zebra", "traffic_signals", "island"]), WORDS),
        "crossing__island": st.just("yes"),
        "direction": st.one_of(st.sampled_from(["forward", "backward", "both", "270"]), WORDS),
        "traffic_signals__direction": st.sampled_from(["forward", "backward"]),
        "stop": st.sampled_from(["all", "minor"]),
        "barrier": st.sampled_from(["bollard", "gate", "lift_gate"]),
        "railway": st.sampled_from(["level_crossing", "tram_crossing"]),
    },
)
STEPS = st.one_of(
    st.integers(-6, 6).map(lambda n: n * STEP_M),
    st.floats(-120.0, 120.0, allow_nan=False),
    st.sampled_from([0.0, 1e-4, 0.3]),
)
MEMBERS = st.lists(
    st.tuples(
        st.integers(100, 112), st.sampled_from(["from", "to", "via", "outer", "inner", "part", ""])
    ),
    max_size=5,
)
RELATION_TAGS = st.one_of(
    st.fixed_dictionaries(
        {
            "type": st.just("restriction"),
            "restriction": st.sampled_from(
                ["no_left_turn", "only_straight_on", "no_u_turn", "only_", "no_entry", "x"]
            ),
        }
    ),
    st.fixed_dictionaries(
        {"type": st.sampled_from(["multipolygon", "building"]), "building": WORDS}
    ),
)


class Case(NamedTuple):
    """A map as drawn: places of its nodes, and objects by their parts."""

    place: GeoPoint
    places: list[tuple[float, float]]
    node_tags: dict[int, dict[str, str]]
    ways: list[tuple[list[int], dict[str, str]]]
    relations: list[tuple[list[tuple[int, str]], int, dict[str, str]]]


NODE_IDS = st.integers(1, NODES + 1)
CASE = st.builds(
    Case,
    place=st.sampled_from([NORTH_SEA_COAST, MANCHESTER, GeoPoint(0.0, 179.9999)]),
    places=st.lists(st.tuples(STEPS, STEPS), min_size=NODES, max_size=NODES),
    node_tags=st.dictionaries(NODE_IDS, NODE_TAGS, max_size=5),
    ways=st.lists(
        st.tuples(
            st.lists(NODE_IDS, min_size=1, max_size=9),
            st.one_of(ROAD_TAGS, ROAD_TAGS, ROAD_TAGS, BUILDING_TAGS),
        ),
        min_size=1,
        max_size=12,
    ),
    relations=st.lists(st.tuples(MEMBERS, NODE_IDS, RELATION_TAGS), max_size=3),
)


def drawn(case: Case) -> Sketch:
    sketch = Sketch(case.place)
    for node, (x_m, y_m) in enumerate(case.places, start=1):
        sketch.node(node, x_m, y_m, **case.node_tags.get(node, {}))
    for way, (nodes, tags) in enumerate(case.ways, start=100):
        closed = "building" in tags or tags.get("junction") in ("roundabout", "circular")
        sketch.way(way, [*nodes, nodes[0]] if closed else nodes, **tags)
    for relation, (members, via, tags) in enumerate(case.relations, start=500):
        sketch.relation(relation, dict(members), **tags)
        node = f'<member type="node" ref="{via}" role="via"/></relation>'
        sketch.relations[-1] = sketch.relations[-1].replace("</relation>", node)
    return sketch


def drive_through(case: Case) -> None:
    """Build everything; what cannot be built must be a clear error in one line."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawn.osm"
        path.write_text(drawn(case).xml(), encoding="utf-8")
        worlds: tuple[World, ...] = ()
        complaint = ""
        try:
            worlds = build_all(path, most=3, radius_m=60.0).worlds
        except UserError as error:
            complaint = str(error)
    assert "\n" not in complaint
    for world in worlds:
        for lane in (*world.lanes, *world.connections):
            assert np.isfinite(lane.centerline).all(), lane.id
            assert len(lane.centerline) >= 2, lane.id
        for area in (*world.road_surface, *world.buildings):
            assert np.isfinite(area.outline).all()


@settings(max_examples=50, derandomize=True, suppress_health_check=list(HealthCheck))
@given(CASE)
def test_fifty_maps_drawn_by_chance(case: Case) -> None:
    drive_through(case)


@pytest.mark.judge
@pytest.mark.timeout(7200)
@settings(max_examples=CASES, suppress_health_check=list(HealthCheck), database=None)
@given(CASE)
def test_thousands_of_maps_drawn_by_chance(case: Case) -> None:
    drive_through(case)
