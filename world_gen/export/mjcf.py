"""A World as a MuJoCo model: a plane, the road to look at, buildings, walls, trees and islands to
run into.

Collision bits of all rooms: two geoms collide where the contype of one meets the conaffinity of
the other. Static geoms stand in worldbody, never in bodies of their own (93 against 2 µs a step).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TypeVar

import mujoco
import numpy as np
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.world import Area, World
from foretwin.geometry.triangles import joined, triangulated, twice_areas_m2
from foretwin.world_gen.buildings.convex_parts import convex_cover, sound_polygons
from foretwin.world_gen.export import solids
from foretwin.world_gen.export.roofs import eaves_m, roofs_mesh
from foretwin.world_gen.export.terrain import Terrain
from foretwin.world_gen.export.xml_tree import in_comment, in_section
from foretwin.world_gen.polygon_areas import polygons_from

STATIC = 1
"""Contype of buildings, obstacles and islands; their conaffinity is VEHICLE."""
VEHICLE = 2
"""Contype of a simulated vehicle; its conaffinity is STATIC | ROAD_USER."""
ROAD_USER = 4
"""Contype of mocap road users and shadows; their conaffinity is VEHICLE. A ghost has 0 and 0."""

UNTOUCHED = {"contype": 0, "conaffinity": 0}
TIMESTEP_S = 0.01
WORKER_REACH_M = 20.0
"""Without visuals, what stands farther than this from the road is left out."""
_SLIVER_M2 = 1e-4
"""Smaller triangles are left out."""
VISUAL_GROUP, COLLISION_GROUP = 2, 1

_Block = TypeVar("_Block", Building, Obstacle)


def world_spec(world: World, *, visual: bool = True) -> mujoco.MjSpec:
    """Return the World as an editable model without vehicles, in the World's frame.

    With `visual` false (workers) the road mesh and buildings that no road comes near are left
    out. Attach vehicles to this spec: an attached spec's own options are ignored.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"world {world.id}"
    _set_options(spec)
    spec.add_text(name="attribution", data=in_section(world.attribution))
    spec.add_text(name="world", data=world.id)
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[world.radius_m, world.radius_m, 1.0],
        rgba=solids.GROUND,
        **UNTOUCHED,  # a planar car has no vertical joint: touching would only cost time
    )
    if visual:
        _add_road(spec, world)
        roofs = roofs_mesh((building, 0.0) for building in world.buildings)
        if len(roofs.triangles):
            _add_seen(spec, "roofs", roofs, solids.ROOF)
        spec.worldbody.add_light(pos=[0, 0, 200], dir=[0.3, 0.2, -1], castshadow=False)
    near = (lambda things: things) if visual else _near_road(world)
    buildings, obstacles = near(world.buildings), near(world.obstacles)
    top_m = eaves_m if visual else (lambda building: building.height_m.value)
    extents = [(f"building:{b.id}", b.min_height_m, top_m(b)) for b in buildings]
    _add_blocks(spec, "building", solids.BUILDING, buildings, extents, solid=True)
    if obstacles:
        extents = [(f"{o.kind}:{o.id}", 0.0, o.height_m.value) for o in obstacles]
        _add_blocks(spec, "obstacle", solids.OBSTACLE, obstacles, extents, solid=True)
    _add_islands(spec, world, visual=visual)
    return spec


def write_mjcf(world: World, path: Path) -> None:
    """Write the World as one MJCF file that MjModel.from_xml_path loads."""
    spec = world_spec(world)
    spec.compile()
    text = spec.to_xml()
    place = world.intersection
    about = f"{world.attribution}; world {world.id}, {place.kind} {place.name}"
    comment = f"<!-- {in_comment(about)} -->\n"
    path.write_text(comment + text, encoding="utf-8")


def _set_options(spec: mujoco.MjSpec) -> None:
    option = spec.option
    option.timestep = TIMESTEP_S
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # mujoco 4.0.0's Newton solver has a wrong Hessian with sparse Jacobians.
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # Static geoms are then not recomputed at each step.
    option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def _near_road(world: World) -> Callable[[Sequence[_Block]], Sequence[_Block]]:
    """Return what picks those things that a road comes near."""
    roads = [Polygon(area.outline).simplify(1.0) for area in world.road_surface]
    reach = shapely.union_all(shapely.buffer(roads, WORKER_REACH_M, quad_segs=2))
    shapely.prepare(reach)

    def near(things: Sequence[_Block]) -> Sequence[_Block]:
        if not things or not roads:
            return ()
        found = shapely.intersects(reach, polygons_from([(one.outline, ()) for one in things]))
        return [one for one, is_near in zip(things, found.tolist(), strict=True) if is_near]

    return near


def _add_islands(spec: mujoco.MjSpec, world: World, *, visual: bool) -> None:
    for solid in (True, False):
        chosen = [island for island in world.islands if solids.stops_cars(island) is solid]
        if chosen and (solid or visual):
            extents = [(i.id, 0.0, solids.island_height_m(solid=solid)) for i in chosen]
            name = "mound" if solid else "island"
            _add_blocks(spec, name, solids.ISLAND, chosen, extents, solid=solid)


def _add_blocks(
    spec: mujoco.MjSpec,
    default: str,
    rgba: solids.Rgba,
    outlines: Sequence[Building | Obstacle | Area],
    extents: Sequence[tuple[str, float, float]],
    *,
    solid: bool,
) -> None:
    """Add outlines, each with a name, an underside and a top, as boxes and convex prisms.

    All have the default class `default`, and none is touched that is not `solid`.
    """
    block = spec.add_default(default, spec.default)
    block.geom.type, block.geom.group = mujoco.mjtGeom.mjGEOM_BOX, COLLISION_GROUP
    block.geom.rgba = rgba
    block.geom.contype, block.geom.conaffinity = (STATIC, VEHICLE) if solid else (0, 0)
    parts = convex_cover([(one.outline, one.holes) for one in outlines])
    add_geom, add_mesh = spec.worldbody.add_geom, spec.add_mesh
    low_m, high_m = np.array([extent[1:] for extent in extents]).reshape(-1, 2)[parts.owner].T
    centres = np.column_stack([parts.centre_m, (low_m + high_m) / 2])
    halves = np.column_stack([parts.half_m, (high_m - low_m) / 2])
    quaternions = np.zeros((len(parts.owner), 4))
    quaternions[:, 0], quaternions[:, 3] = np.cos(parts.yaw_rad / 2), np.sin(parts.yaw_rad / 2)
    count: dict[int, int] = {}
    owners, boxes = parts.owner.tolist(), parts.is_box.tolist()
    for k, (owner, is_box) in enumerate(zip(owners, boxes, strict=True)):
        name, low, high = extents[owner]
        if high - low < solids.THINNEST_M:
            continue
        count[owner] = n = count.get(owner, -1) + 1
        name = f"{name}:{n}"
        geom = add_geom(block)
        geom.name = name
        if is_box:
            # Said in the call, or as lists, the same values take twice as long.
            geom.pos, geom.size, geom.quat = centres[k], halves[k], quaternions[k]
            continue
        ring = parts.rings[k]
        corners = np.empty((2, len(ring), 3))
        corners[:, :, :2] = ring
        corners[0, :, 2], corners[1, :, 2] = low, high
        mesh = add_mesh()
        mesh.name = name
        mesh.uservert, mesh.userface = corners.ravel().tolist(), _prism_faces(len(ring))
        geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, name


@cache
def _prism_faces(n: int) -> list[int]:
    """Return the triangles of a prism whose bottom ring of `n` corners stands before its top."""
    k = np.arange(n)
    after = (k + 1) % n
    sides = np.concatenate([np.stack([k, after, after + n], 1), np.stack([k, after + n, k + n], 1)])
    fan = np.arange(1, n - 1)
    lid = np.stack([np.full(n - 2, n), fan + n, fan + n + 1], 1)
    base = np.stack([np.zeros(n - 2, dtype=int), fan + 1, fan], 1)
    faces: list[int] = np.concatenate([sides, lid, base]).ravel().tolist()
    return faces


def _add_road(spec: mujoco.MjSpec, world: World) -> None:
    """Add the road surface as a mesh that is seen and never touched."""
    shapes = polygons_from([(area.outline, area.holes) for area in world.road_surface])
    sound, _ = sound_polygons(shapes)
    found = triangulated(sound).corners_m
    found = found[twice_areas_m2(found) > 2.0 * _SLIVER_M2]
    if not len(found):
        return
    corners, faces = joined(found, sliver_m2=_SLIVER_M2)
    surface = np.column_stack([corners, np.full(len(corners), solids.ROAD_TOP_M)])
    _add_seen(spec, "road", Terrain(surface, faces), solids.ROAD)


def _add_seen(spec: mujoco.MjSpec, name: str, seen: Terrain, rgba: solids.Rgba) -> None:
    """Add a mesh that is seen and never touched."""
    mesh = spec.add_mesh()
    mesh.name = name
    mesh.uservert, mesh.userface = seen.points.ravel().tolist(), seen.triangles.ravel().tolist()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    look = {"meshname": name, "rgba": rgba, "group": VISUAL_GROUP}
    shape = mujoco.mjtGeom.mjGEOM_MESH
    spec.worldbody.add_geom(name=name, type=shape, **look, **UNTOUCHED)
