"""What the stand-in car drives: within limits, slow in bends, halting where its driver must."""

from __future__ import annotations

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.frames import local_from_geo
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.standin_path import (
    ACCEL_MPS2,
    BRAKE_MPS2,
    LATERAL_MPS2,
    speed_profile,
    standin_path,
    stop_signs,
)
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.orchestrator.trip import town

LIMIT_MPS = 50 / 3.6


def line(turns_rad: list[float], spacing_m: float) -> np.ndarray:
    heading = np.cumsum(turns_rad)
    steps = spacing_m * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])


@given(
    turns=st.lists(st.floats(-0.15, 0.15), min_size=8, max_size=60),
    spacing=st.floats(0.5, 3.0),
    limits=st.lists(st.floats(2.0, 30.0), min_size=1, max_size=4),
    stops=st.sets(st.integers(1, 7), max_size=2),
)
def test_a_profile_can_be_driven(
    turns: list[float], spacing: float, limits: list[float], stops: set[int]
) -> None:
    xy = line(turns, spacing)
    limit = np.repeat(limits, -(-len(xy) // len(limits)))[: len(xy)]
    speed = speed_profile(xy, limit, stop_indices=sorted(stops))

    assert (speed >= 0.0).all()
    assert (speed <= limit + 1e-9).all()
    gained = np.diff(speed**2) / (2.0 * spacing)
    assert gained.max() <= ACCEL_MPS2 + 1e-6
    assert gained.min() >= -BRAKE_MPS2 - 1e-6
    assert speed[[*stops, -1]] == pytest.approx(0.0)


@given(radius_m=st.floats(8.0, 60.0))
def test_a_bend_is_driven_at_the_lateral_acceleration_allowed(radius_m: float) -> None:
    count = 200
    xy = line([1.0 / radius_m] * count, 1.0)
    speed = speed_profile(xy, np.full(len(xy), 30.0))

    middle = speed[40:100]
    assert (middle**2 / radius_m).max() <= LATERAL_MPS2 * 1.02
    reachable = min(np.sqrt(LATERAL_MPS2 * radius_m), np.sqrt(2 * BRAKE_MPS2 * 100))
    assert middle.max() == pytest.approx(reachable, rel=0.02)


def test_a_straight_road_is_driven_at_its_limit_until_the_end_comes_near() -> None:
    xy = line([0.0] * 300, 1.0)
    speed = speed_profile(xy, np.full(len(xy), LIMIT_MPS))
    braking_m = LIMIT_MPS**2 / (2 * BRAKE_MPS2)

    assert speed[: int(300 - braking_m) - 1] == pytest.approx(LIMIT_MPS)
    assert speed[-1] == 0.0


def by_the_sign() -> tuple[int, Route]:
    """The town's stop sign, and a route out of its side street into the main street."""
    inputs = town()
    (sign,) = (n for n, tags in inputs.osm.node_tags.items() if tags.get("highway") == "stop")
    (side,) = (edge for edge in inputs.graph.edges if sign in edge.node_ids)
    (route,) = inputs.routes
    onward = [n for n, e in enumerate(route.edges) if e.start_node == side.end_node]
    return sign, Route((DirectedEdge(side, False), *route.edges[onward[0] :]), 0.0)


def test_the_embedded_drive_keeps_to_the_main_street_and_halts_at_its_end_alone() -> None:
    path = town().standin
    assert path is not None

    assert np.flatnonzero(path.speed_mps == 0.0).tolist() == [len(path.speed_mps) - 1]
    assert path.speed_mps.max() <= LIMIT_MPS + 1e-9


def test_who_comes_out_of_the_side_street_halts_at_its_sign() -> None:
    inputs = town()
    sign, route = by_the_sign()
    path = standin_path(inputs.osm, inputs.graph, route)
    (halt, _) = np.flatnonzero(path.speed_mps == 0.0)

    frame = inputs.graph.frame
    at = local_from_geo(frame, path.lat_deg[halt], path.lon_deg[halt])
    assert np.hypot(*(at - local_from_geo(frame, *inputs.osm.locations[sign]))) < 4.0


def test_a_stop_sign_binds_the_driver_it_faces_alone() -> None:
    osm = town().osm
    _, route = by_the_sign()
    away = Route(tuple(e.back for e in reversed(route.edges)), 0.0)

    assert (len(stop_signs(osm, route)), len(stop_signs(osm, away))) == (1, 0)


@pytest.mark.parametrize(
    ("tags", "there", "back"),
    [
        ({"highway": "stop"}, 1, 1),
        ({"highway": "stop", "direction": "both"}, 1, 1),
        ({"highway": "stop", "direction": "forward"}, 1, 0),
        ({"highway": "stop", "direction": "backward"}, 0, 1),
        ({"highway": "give_way", "direction": "forward"}, 0, 0),
    ],
)
def test_the_way_a_sign_faces_is_that_of_its_way(
    tags: dict[str, str], there: int, back: int
) -> None:
    inputs = town()
    edge = max(inputs.graph.edges, key=lambda e: len(e.node_ids))
    osm = msgspec.structs.replace(inputs.osm, node_tags={edge.node_ids[1]: tags})

    assert len(stop_signs(osm, Route((DirectedEdge(edge, False),), 0.0))) == there
    assert len(stop_signs(osm, Route((DirectedEdge(edge, True),), 0.0))) == back


def test_what_the_process_reads_is_plain_json() -> None:
    inputs = town()
    path = standin_path(inputs.osm, inputs.graph, inputs.routes[0])
    read = json.loads(json.dumps(path.as_json()))

    assert set(read) == {"lat_deg", "lon_deg", "speed_mps"}
    assert len({len(values) for values in read.values()}) == 1
    assert read["lat_deg"][0] == pytest.approx(path.lat_deg[0], abs=1e-8)
