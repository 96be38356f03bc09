"""The roofs of a World's buildings as one mesh: they are seen, and nothing is run into up there."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec
import numpy as np

from foretwin.contracts.beside_road import Building
from foretwin.geometry.roofs import roof_mesh
from foretwin.world_gen.export.terrain import Terrain


def eaves_m(building: Building) -> float:
    """Return how high a building's walls stand above the road: up to its roof, or to its top."""
    roof = building.roof
    top_m = building.height_m.value
    return top_m if isinstance(roof, msgspec.UnsetType) else top_m - roof.height_m.value


def roofs_mesh(buildings: Iterable[tuple[Building, float]]) -> Terrain:
    """Return the roofs of buildings, each with how much higher it stands than the road."""
    points, triangles = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.intp)]
    count = 0
    for building, lifted_m in buildings:
        roof = building.roof
        if isinstance(roof, msgspec.UnsetType):
            continue
        mesh = roof_mesh(
            building.outline,
            building.holes,
            form=roof.form,
            ridge_rad=roof.ridge_rad,
            eaves_m=eaves_m(building) + lifted_m,
            top_m=building.height_m.value + lifted_m,
        )
        points.append(mesh.points)
        triangles.append(mesh.triangles + count)
        count += len(mesh.points)
    return Terrain(np.concatenate(points), np.concatenate(triangles))
