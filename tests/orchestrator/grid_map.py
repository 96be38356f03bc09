"""A small town drawn for tests: streets on a grid, one block 100 m wide, nodes named by place."""

from __future__ import annotations

import itertools

import msgspec
import numpy as np

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import DrivingSide, IntersectionSummary
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge, RoadGraph

BLOCK_M = 100.0
FRAME = LocalFrame(GeoPoint(52.5, 13.4))


def node(column: int, row: int) -> int:
    return 100 * row + column + 1


def road(
    index: int,
    start: int,
    end: int,
    xy: list[tuple[float, float]],
    *,
    name: str = "",
    backward: bool = True,
    car: bool = True,
    lanes: tuple[float, float] = (1.0, 1.0),
) -> RoadEdge:
    line = np.asarray(xy, dtype=np.float64)
    return RoadEdge(
        index=index,
        way_id=1000 + index,
        start_node=start,
        end_node=end,
        node_ids=(start, end),
        xy_m=line,
        length_m=float(np.hypot(*np.diff(line, axis=0).T).sum()),
        forward=True,
        backward=backward,
        car=car,
        road_class="residential" if car else "pedestrian",
        name=name,
        limit_forward_mps=Quantity(50 / 3.6, "tagged"),
        limit_backward_mps=Quantity(50 / 3.6, "tagged"),
        lanes_forward=Quantity(lanes[0], "tagged"),
        lanes_backward=Quantity(lanes[1], "tagged"),
        layer=0,
        driving_side="right",
        tags={},
    )


def graph_of(edges: list[RoadEdge], *, driving_side: DrivingSide = "right") -> RoadGraph:
    places: dict[int, tuple[float, float]] = {}
    leaving: dict[int, list[DirectedEdge]] = {}
    edges = [msgspec.structs.replace(edge, driving_side=driving_side) for edge in edges]
    for edge in edges:
        places[edge.start_node] = (float(edge.xy_m[0, 0]), float(edge.xy_m[0, 1]))
        places[edge.end_node] = (float(edge.xy_m[-1, 0]), float(edge.xy_m[-1, 1]))
        for reverse in (False, True):
            directed = DirectedEdge(edge, reverse)
            leaving.setdefault(directed.start_node, []).append(directed)
    return RoadGraph(
        frame=FRAME,
        driving_side=driving_side,
        edges=tuple(edges),
        node_xy_m=places,
        leaving={place: tuple(found) for place, found in leaving.items()},
    )


def grid(columns: int, rows: int, *, pedestrian: frozenset[int] = frozenset()) -> RoadGraph:
    """Streets along x (edges first, row by row), then along y; `pedestrian` edges are no car's."""
    edges: list[RoadEdge] = []

    def add(a: tuple[int, int], b: tuple[int, int], name: str) -> None:
        xy = [(a[0] * BLOCK_M, a[1] * BLOCK_M), (b[0] * BLOCK_M, b[1] * BLOCK_M)]
        number = len(edges)
        edges.append(road(number, node(*a), node(*b), xy, name=name, car=number not in pedestrian))

    for row in range(rows):
        for column in range(columns - 1):
            add((column, row), (column + 1, row), f"Row {row}")
    for column in range(columns):
        for row in range(rows - 1):
            add((column, row), (column, row + 1), f"Column {column}")
    return graph_of(edges)


def junctions(graph: RoadGraph) -> tuple[Junction, ...]:
    """Every node where three roads or more meet."""
    found = []
    for place, (x, y) in graph.node_xy_m.items():
        arms = len(graph.at_node(place))
        if arms < 3:
            continue
        geo = geo_from_local(graph.frame, np.array([x, y]))
        summary = IntersectionSummary(
            id=f"n{place}", kind="crossing" if arms > 3 else "t_junction", lat=float(geo[0]),
            lon=float(geo[1]), arms=arms, control="uncontrolled",
            driving_side=graph.driving_side, osm_nodes=(place,),
        )  # fmt: skip
        found.append(
            Junction(
                summary=summary, centre_xy_m=np.array([x, y]), nodes=frozenset([place]),
                inner=(), arms=(), radius_m=0.0,
            )
        )  # fmt: skip
    return tuple(found)


def drive(corners: list[tuple[float, float]], *, spacing_m: float = 2.0) -> np.ndarray:
    """Positions (N, 2) along straight legs between corners, and at the last one."""
    points = []
    for start, end in itertools.pairwise(corners):
        leg = np.subtract(end, start)
        count = round(float(np.hypot(*leg)) / spacing_m)
        points += [np.asarray(start) + leg * (k / count) for k in range(count)]
    points.append(np.asarray(corners[-1], dtype=np.float64))
    return np.asarray(points)


def headings(xy: np.ndarray) -> np.ndarray:
    """Course (N,) into each position from the one before."""
    delta = np.diff(xy, axis=0, prepend=2 * xy[:1] - xy[1:2])
    return np.arctan2(delta[:, 1], delta[:, 0])
