"""A World as rows: roads, crossings, signals, islands, buildings, and the map view."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.frames import LocalFrame, geo_from_local, target_from_source
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Area, World
from foretwin.geometry.polyline import offset
from foretwin.viewer.colours import Colour
from foretwin.viewer.meshes import Mesh, Polygon, flat_mesh, prism_mesh
from foretwin.viewer.rows import Row, path_part, raised

GROUND: Colour = (25, 28, 35)
ROAD: Colour = (58, 61, 68)
JUNCTION: Colour = (70, 74, 84)
ISLAND: Colour = (66, 92, 66)
PAINT: Colour = (226, 228, 232)
LANE_EDGE: Colour = (138, 143, 152)
KERB: Colour = (112, 116, 124)
OBSTACLE: Colour = (96, 116, 84)
CONNECTION: Colour = (84, 118, 150)
SIGNAL: Colour = (150, 154, 164)
"""A head whose colour nobody tells."""
BUILDING: dict[Provenance, Colour] = {
    "tagged": (168, 174, 186),
    "inferred": (146, 152, 164),
    "default": (122, 127, 138),
}
"""The lighter, the better its height is known."""

GROUND_HEIGHT_M = -0.06
ROAD_HEIGHT_M = 0.0
JUNCTION_HEIGHT_M = 0.02
ISLAND_HEIGHT_M = 0.12
PAINT_HEIGHT_M = 0.05
LINE_HEIGHT_M = 0.06
SIGNAL_HEIGHT_M = 5.0
STRIPE_M = 0.5
"""Width of a zebra stripe and of the gap to the next."""


def rows_of_world(world: World, *, drive_frame: LocalFrame, drive_ns: int) -> list[Row]:
    """Return the rows that show `world` in `drive_frame` from `drive_ns` on."""
    move = _Mover(world.frame, drive_frame)
    base = f"world/map/{path_part(world.id)}"

    def row(name: str, components: rr.AsComponents) -> Row:
        return Row(f"{base}/{name}", drive_ns, components, lasting=True)

    def flat(name: str, polygons: Sequence[Polygon], height_m: float, colour: Colour) -> list[Row]:
        if not polygons:
            return []
        mesh = flat_mesh(move.polygons(polygons), height_m=height_m, colour=colour)
        return [row(name, _archetype(mesh))]

    round_about = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]
    disc = world.radius_m * np.column_stack([np.cos(round_about), np.sin(round_about)])
    junction = [place.area for place in world.junctions[:1] if place.area is not None]
    rows = [
        *flat("ground", [Polygon(disc)], GROUND_HEIGHT_M, GROUND),
        *flat("roads/surface", _polygons(world.road_surface), ROAD_HEIGHT_M, ROAD),
        *flat("roads/junction", _polygons(junction), JUNCTION_HEIGHT_M, JUNCTION),
    ]
    edges = [
        offset(lane.centerline, side * lane.width_m.value / 2.0)
        for lane in world.lanes
        for side in (1.0, -1.0)
    ]
    for name, lines, colour, radius_m in (
        ("roads/lanes", edges, LANE_EDGE, 0.05),
        ("roads/kerbs", world.kerbs, KERB, 0.09),
        ("roads/connections", [c.centerline for c in world.connections], CONNECTION, 0.05),
        ("stop_lines", [line.ends for line in world.stop_lines], PAINT, 0.16),
    ):
        if lines:
            rows.append(row(name, _lines(move.lines(lines), colour, radius_m)))
    stripes = [
        Polygon(stripe)
        for crossing in world.crossings
        for stripe in zebra_stripes(crossing.line, width_m=crossing.width_m.value)
    ]
    rows += flat("crossings", stripes, PAINT_HEIGHT_M, PAINT)
    rows += flat("islands", _polygons(world.islands), ISLAND_HEIGHT_M, ISLAND)
    if world.signals:
        tops = signal_tops(world, drive_frame=drive_frame)
        rows += _signal_rows(tops, f"{base}/signals", drive_ns)
    if world.buildings:
        mesh = prism_mesh(
            move.polygons(_polygons(world.buildings)),
            low_m=[building.min_height_m for building in world.buildings],
            high_m=[building.height_m.value for building in world.buildings],
            colours=[BUILDING[building.height_m.source] for building in world.buildings],
        )
        rows.append(row("buildings", _archetype(mesh)))
    if world.obstacles:
        mesh = prism_mesh(
            move.polygons(_polygons(world.obstacles)),
            low_m=[0.0] * len(world.obstacles),
            high_m=[one.height_m.value for one in world.obstacles],
            colours=[OBSTACLE] * len(world.obstacles),
        )
        rows.append(row("obstacles", _archetype(mesh)))
    if world.lanes:
        lanes = rr.GeoLineStrings(
            lat_lon=[geo_from_local(world.frame, lane.centerline) for lane in world.lanes],
            radii=rr.Radius.ui_points(1.2),
            colors=[[150, 156, 168]] * len(world.lanes),
        )
        rows.append(Row(f"geo/roads/{path_part(world.id)}", drive_ns, lanes, lasting=True))
    return rows


def _polygons(areas: Iterable[Area | Building | Obstacle]) -> list[Polygon]:
    return [Polygon(area.outline, area.holes) for area in areas]


def world_centre(world: World, *, drive_frame: LocalFrame) -> Array:
    """Return (2,) metres of the junction's centre, the World's origin, in `drive_frame`."""
    moved = target_from_source(drive_frame, world.frame, np.zeros((1, 2)), np.zeros(1))
    return moved.xy_m.reshape(2)


def zebra_stripes(line: Array, *, width_m: float) -> list[Array]:
    """Return the stripes, each (4, 2), of a crossing from kerb to kerb along `line` (2, 2)."""
    start, end = np.asarray(line, dtype=np.float64)
    length_m = float(np.hypot(*(end - start)))
    if length_m < STRIPE_M:
        return []
    along = (end - start) / length_m
    across = np.array([-along[1], along[0]]) * width_m / 2.0
    begins = np.arange(STRIPE_M / 2.0, length_m - STRIPE_M / 2.0, 2.0 * STRIPE_M)
    return [
        np.array([a - across, b - across, b + across, a + across])
        for a, b in ((start + along * s, start + along * (s + STRIPE_M)) for s in begins)
    ]


class _Mover:
    """Moves many small arrays into the drive's frame with one projection each call."""

    def __init__(self, source: LocalFrame, target: LocalFrame) -> None:
        self._source = source
        self._target = target

    def lines(self, lines: Sequence[Array]) -> list[Array]:
        every = np.concatenate([np.asarray(line, dtype=np.float64) for line in lines])
        moved = target_from_source(self._target, self._source, every, np.zeros(len(every))).xy_m
        return np.split(moved, np.cumsum([len(line) for line in lines])[:-1])

    def polygons(self, polygons: Sequence[Polygon]) -> list[Polygon]:
        if not polygons:
            return []
        rings = iter(
            self.lines([ring for shape in polygons for ring in (shape.outline, *shape.holes)])
        )
        return [Polygon(next(rings), tuple(next(rings) for _ in shape.holes)) for shape in polygons]


def _archetype(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices_m,
        vertex_normals=mesh.normals,
        vertex_colors=mesh.colours,
        triangle_indices=mesh.triangles,
    )


def _lines(lines: Sequence[Array], colour: Colour, radius_m: float) -> rr.LineStrips3D:
    return rr.LineStrips3D(
        [raised(line, LINE_HEIGHT_M) for line in lines],
        colors=[colour] * len(lines),
        radii=[radius_m] * len(lines),
    )


def signal_tops(world: World, *, drive_frame: LocalFrame) -> Array:
    """Return (N, 3) metres in `drive_frame` where the heads of a World's signals are shown."""
    heads = np.array([signal.position for signal in world.signals], dtype=np.float64).reshape(-1, 3)
    xy_m = target_from_source(drive_frame, world.frame, heads[:, :2], np.zeros(len(heads))).xy_m
    return np.column_stack([xy_m, np.where(heads[:, 2] > 0.5, heads[:, 2], SIGNAL_HEIGHT_M)])


def _signal_rows(tops: Array, path: str, drive_ns: int) -> list[Row]:
    feet = tops * [1.0, 1.0, 0.0]
    return [
        Row(path, drive_ns, rr.Points3D(tops, colors=[SIGNAL] * len(tops), radii=0.35), True),
        Row(
            f"{path}/poles",
            drive_ns,
            rr.LineStrips3D(np.stack([feet, tops], axis=1), colors=[KERB] * len(tops), radii=0.06),
            True,
        ),
    ]
