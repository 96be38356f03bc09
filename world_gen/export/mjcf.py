"""A World as a MuJoCo model: a plane, the road to look at, buildings and islands to run into.

Collision bits of all rooms: two geoms collide where the contype of one meets the conaffinity of
the other. Static geoms stand in worldbody, never in bodies of their own (93 against 2 µs a step).
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import shapely
from shapely.geometry import Polygon

from contracts.arrays import Array
from contracts.world import World
from world_gen.convex_parts import convex_parts
from world_gen.road_surface import RING_ISLAND

STATIC = 1
"""Contype of buildings and islands; their conaffinity is VEHICLE."""
VEHICLE = 2
"""Contype of a simulated vehicle; its conaffinity is STATIC | ROAD_USER."""
ROAD_USER = 4
"""Contype of mocap road users and shadows; their conaffinity is VEHICLE. A ghost has 0 and 0."""

TIMESTEP_S = 0.01
RING_ISLAND_HEIGHT_M = 1.0
"""A roundabout's middle is a mound with plants: a car that drives straight on must hit it."""
TRAFFIC_ISLAND_HEIGHT_M = 0.12
WORKER_REACH_M = 20.0
"""Without visuals, buildings farther than this from the road are left out."""
VISUAL_GROUP, COLLISION_GROUP = 2, 1

_ROAD_RGBA = (0.25, 0.25, 0.27, 1.0)
_ISLAND_RGBA = (0.45, 0.55, 0.35, 1.0)
_BUILDING_RGBA = (0.72, 0.68, 0.62, 1.0)
_GROUND_RGBA = (0.55, 0.58, 0.52, 1.0)


def world_spec(world: World, *, visual: bool = True) -> mujoco.MjSpec:
    """Return the World as an editable model without vehicles, in the World's frame.

    With `visual` false (workers) the road mesh and buildings that no road comes near are left
    out. Attach vehicles to this spec: an attached spec's own options are ignored.
    """
    spec = mujoco.MjSpec()
    spec.modelname = f"world {world.id}"
    _set_options(spec)
    spec.add_text(name="attribution", data=world.attribution)
    spec.add_text(name="world", data=world.id)
    ground = spec.worldbody.add_geom()
    ground.name = "ground"
    ground.type = mujoco.mjtGeom.mjGEOM_PLANE
    ground.size = [world.radius_m, world.radius_m, 1.0]
    ground.rgba = _GROUND_RGBA
    # A planar car has no vertical joint: touching the plane would only cost time.
    ground.contype = ground.conaffinity = 0
    if visual:
        _add_road(spec, world)
        spec.worldbody.add_light(pos=[0, 0, 200], dir=[0.3, 0.2, -1], castshadow=False)
    reach = None if visual else _near_road(world)
    for building in world.buildings:
        if reach is not None and not reach.intersects(Polygon(building.outline)):
            continue
        low, high = building.min_height_m, building.height_m.value
        for i, part in enumerate(convex_parts(building.outline, building.holes)):
            _add_prism(spec, f"building:{building.id}:{i}", part, low, high, _BUILDING_RGBA, True)
    for island in world.islands:
        solid = island.id.startswith(RING_ISLAND)
        height = RING_ISLAND_HEIGHT_M if solid else TRAFFIC_ISLAND_HEIGHT_M
        if solid or visual:
            for i, part in enumerate(convex_parts(island.outline, island.holes)):
                _add_prism(spec, f"{island.id}:{i}", part, 0.0, height, _ISLAND_RGBA, solid)
    return spec


def write_mjcf(world: World, path: Path) -> None:
    """Write the World as one MJCF file that MjModel.from_xml_path loads."""
    spec = world_spec(world)
    spec.compile()
    text = spec.to_xml()
    place = world.intersection
    about = f"{world.attribution}; world {world.id}, {place.kind} {place.name}"
    comment = f"<!-- {about.replace('--', '- ')} -->\n"
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


def _near_road(world: World) -> shapely.Geometry:
    roads = [Polygon(area.outline).simplify(1.0) for area in world.road_surface]
    reach = shapely.union_all(shapely.buffer(roads, WORKER_REACH_M, quad_segs=2))
    shapely.prepare(reach)
    return reach


def _add_prism(
    spec: mujoco.MjSpec,
    name: str,
    ring: Array,
    low_m: float,
    high_m: float,
    rgba: tuple[float, float, float, float],
    solid: bool,
) -> None:
    n = len(ring)
    if n < 3 or high_m - low_m < 0.01:
        return
    bottom = np.column_stack([ring, np.full(n, low_m)])
    top = np.column_stack([ring, np.full(n, high_m)])
    k = np.arange(n)
    after = (k + 1) % n
    sides = np.concatenate([np.stack([k, after, after + n], 1), np.stack([k, after + n, k + n], 1)])
    fan = np.arange(1, n - 1)
    lid = np.stack([np.full(n - 2, n), fan + n, fan + n + 1], 1)
    base = np.stack([np.zeros(n - 2, dtype=int), fan + 1, fan], 1)
    mesh = spec.add_mesh()
    mesh.name = name
    mesh.uservert = np.concatenate([bottom, top]).ravel()
    mesh.userface = np.concatenate([sides, lid, base]).ravel()
    geom = spec.worldbody.add_geom()
    geom.name = name
    geom.type = mujoco.mjtGeom.mjGEOM_MESH
    geom.meshname = name
    geom.rgba = rgba
    geom.group = COLLISION_GROUP
    geom.contype = STATIC if solid else 0
    geom.conaffinity = VEHICLE if solid else 0


def _add_road(spec: mujoco.MjSpec, world: World) -> None:
    """Add the road surface as a mesh that is seen and never touched."""
    triangles: list[Array] = []
    for area in world.road_surface:
        shape = shapely.make_valid(Polygon(area.outline, area.holes))
        found = shapely.constrained_delaunay_triangles(shape)
        triangles.extend(shapely.get_coordinates(t)[:3] for t in found.geoms if t.area > 1e-4)
    if not triangles:
        return
    corners, rows = np.unique(np.round(np.concatenate(triangles), 4), axis=0, return_inverse=True)
    faces = rows.reshape(-1, 3)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    cross = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces = np.where(cross[:, None] < 0.0, faces[:, ::-1], faces)[np.abs(cross) > 1e-4]
    mesh = spec.add_mesh()
    mesh.name = "road"
    mesh.uservert = np.column_stack([corners, np.full(len(corners), 0.01)]).ravel()
    mesh.userface = faces.ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    geom = spec.worldbody.add_geom()
    geom.name = "road"
    geom.type = mujoco.mjtGeom.mjGEOM_MESH
    geom.meshname = "road"
    geom.rgba = _ROAD_RGBA
    geom.group = VISUAL_GROUP
    geom.contype = geom.conaffinity = 0
