"""What becomes of roads on drawn hills, seen through cells like SRTM's and its noise."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.elevation.road_profiles import filter_width_m, grade_std, road_profiles
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import GERMANY, Tags, drawn_map
from tests.world_gen.elevation.hills import Hill, raster

COVERS = (
    "foretwin.world_gen.elevation.height_equations",
    "foretwin.world_gen.elevation.profiles",
)
STREET = {"highway": "residential"}
LINE = {i: (100.0 * i, 0.0) for i in range(11)}


def profiles(
    hill: Hill,
    ways: Sequence[tuple[int, Sequence[int], Tags]],
    *,
    nodes: Mapping[int, tuple[float, float]] = LINE,
    node_tags: Mapping[int, Tags] | None = None,
    noise_m: float = 0.0,
    seed: int = 0,
    arc_s: float = 3.0,
) -> RoadProfiles:
    osm = drawn_map(nodes, ways, node_tags=node_tags)
    graph = build_road_graph(osm)
    dem = raster(hill, GERMANY, noise_m=noise_m, seed=seed, arc_s=arc_s)
    return road_profiles(graph, [edge.index for edge in graph.edges], dem, osm.node_tags)


def level(x: Array, y: Array) -> Array:
    return 0.0 * x


def east(grade: float) -> Hill:
    return lambda x, y: grade * x


def test_an_even_slope_is_found_as_it_is() -> None:
    found = profiles(east(0.08), [(1, list(LINE), STREET)])
    (profile,) = found.of_edge.values()

    # Roads are thought to be level before one looks, and their free ends are seen from one side.
    assert profile.grade[10:-10] == pytest.approx(0.08, abs=0.003)
    assert profile.grade == pytest.approx(0.08, abs=0.01)
    assert profile.height_m == pytest.approx(0.08 * profile.along_m, abs=1.5)


def test_noise_is_smoothed_as_far_as_the_filter_says_that_it_is() -> None:
    errors = []
    for seed in range(6):
        found = profiles(level, [(1, list(LINE), STREET)], noise_m=3.7, seed=seed)
        (profile,) = found.of_edge.values()
        errors.append(profile.grade[8:-8])
    rms = float(np.sqrt(np.mean(np.square(errors))))

    # Between two cells it is 5.6 %; level ground is what roads are thought to be, so it is less.
    assert 0.3 * found.grade_std < rms < 1.1 * found.grade_std
    assert found.grade_std == pytest.approx(0.0273, abs=0.0005)


def test_finer_cells_are_smoothed_over_less() -> None:
    coarse, fine = raster(level, GERMANY), raster(level, GERMANY, arc_s=0.1, reach_deg=0.001)

    assert filter_width_m(coarse) == pytest.approx(84.0, abs=1.0)
    assert filter_width_m(fine) < 11.0
    assert grade_std(fine) < 0.5 * grade_std(coarse)


def test_a_roof_in_the_raster_is_not_a_hill() -> None:
    def tower(x: Array, y: Array) -> Array:
        return np.where(np.hypot(x - 500.0, y) < 60.0, 60.0, 0.0)

    (profile,) = profiles(tower, [(1, list(LINE), STREET)]).of_edge.values()

    assert profile.height_m.max() < 12.0


def test_roads_share_their_height_where_they_meet_and_keep_their_grade_where_they_go_on() -> None:
    def dome(x: Array, y: Array) -> Array:
        return 30.0 * np.exp(-(np.square(x - 500.0) + np.square(y)) / 300.0**2)

    nodes = {**LINE, 20: (500.0, 300.0)}
    ways = [(1, [0, 1, 2, 3, 4, 5], STREET), (2, [5, 6, 7, 8, 9, 10], STREET), (3, [5, 20], STREET)]
    one, two, side = profiles(dome, ways, nodes=nodes).of_edge.values()

    assert one.height_m[-1] == two.height_m[0] == side.height_m[0]
    assert one.grade[-1] == two.grade[0]
    assert one.height_m[-1] == pytest.approx(30.0, abs=6.0)


def test_a_bridge_does_not_go_down_into_the_valley() -> None:
    def valley(x: Array, y: Array) -> Array:
        return -40.0 * np.exp(-np.square(x - 500.0) / 100.0**2)

    bridge = {**STREET, "bridge": "yes"}
    ways = [(1, [0, 1, 2], STREET), (2, [2, 3, 4, 5, 6, 7, 8], bridge), (3, [8, 9, 10], STREET)]
    _, over, _ = profiles(valley, ways).of_edge.values()

    middle = over.height_at(np.array([300.0]))
    assert middle == pytest.approx(0.0, abs=3.0)
    # As straight as a ruler: within a metre of the line between its ends.
    line = np.interp(over.along_m, over.along_m[[0, -1]], over.height_m[[0, -1]])
    assert np.abs(over.height_m - line).max() < 1.0


def test_a_bridge_on_level_ground_passes_as_high_as_a_lorry() -> None:
    nodes = {**LINE, 20: (500.0, -200.0), 21: (500.0, 200.0)}
    bridge = {**STREET, "bridge": "yes"}
    ways = [
        (1, [0, 1, 2, 3, 4], STREET),
        (2, [4, 5, 6], bridge),
        (3, [6, 7, 8, 9, 10], STREET),
        (4, [20, 21], STREET),
    ]
    before, over, _, under = profiles(level, ways, nodes=nodes).of_edge.values()

    gap = over.height_at(np.array([100.0])) - under.height_at(np.array([200.0]))
    assert gap > 4.0
    assert np.abs(before.grade).max() < 0.06


@pytest.mark.parametrize(
    "tunnel_ways",
    [
        [[1, 2, 3, 4, 5, 6, 7, 8, 9]],  # the graph joins neither
        [[1, 2, 3, 4, 5], [5, 6, 7, 8, 9]],
    ],
)
def test_a_tunnel_that_a_map_joins_with_the_street_above_stays_below(
    tunnel_ways: list[list[int]],
) -> None:
    def ridge(x: Array, y: Array) -> Array:
        return 80.0 * np.exp(-np.square(x - 500.0) / 200.0**2)

    nodes = {**LINE, 20: (500.0, -300.0), 21: (500.0, 300.0)}
    tunnel = {**STREET, "tunnel": "yes"}
    ways = [
        (1, [0, 1], STREET),
        *((10 + k, way, tunnel) for k, way in enumerate(tunnel_ways)),
        (3, [9, 10], STREET),
        (2, [20, 5, 21], STREET),
    ]
    found = list(profiles(ridge, ways, nodes=nodes).of_edge.values())
    last = 1 + len(tunnel_ways)

    assert max(one.height_m.max() for one in found[1:last]) < 15.0
    assert min(one.height_m.min() for one in found[last + 1 :]) > 60.0


def test_numbers_of_incline_and_ele_are_believed() -> None:
    steep = {**STREET, "incline": "10%"}
    short = {0: (0.0, 0.0), 1: (150.0, 0.0)}
    (tagged,) = profiles(level, [(1, [0, 1], steep)], nodes=short).of_edge.values()
    (down,) = profiles(
        level, [(1, [0, 1], {**STREET, "incline": "-5,5 °"})], nodes=short
    ).of_edge.values()
    (plain,) = profiles(
        level, [(1, [0, 1], {**STREET, "incline": "up"})], nodes=short
    ).of_edge.values()
    (high,) = profiles(
        level, [(1, [0, 1], STREET)], nodes=short, node_tags={1: {"ele": "12 m"}}
    ).of_edge.values()

    assert 0.03 < np.mean(np.diff(tagged.height_m)) / np.mean(np.diff(tagged.along_m)) < 0.1
    assert np.mean(np.diff(down.height_m)) < -0.02 * math.tan(math.radians(5.5))
    assert plain.grade == pytest.approx(0.0, abs=1e-6)
    assert high.height_m[-1] > 3.0


def test_a_raster_of_another_place_is_told() -> None:
    osm = drawn_map(LINE, [(1, list(LINE), STREET)])
    graph = build_road_graph(osm)

    with pytest.raises(UserError, match="knows no height along the roads"):
        road_profiles(graph, [0], raster(level, GeoPoint(10.0, 10.0)))
