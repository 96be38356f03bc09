"""Roles as rows: who of the car's three is there, the vehicles beside it, what corrects twins."""

from __future__ import annotations

import numpy as np
import rerun as rr

from foretwin.contracts.arrays import Array
from foretwin.contracts.simulation import MirroredVehicle, MirrorSample, PlaneState, TwinCorrection
from foretwin.viewer.colours import GHOST, REAL, SHADOW, TWIN, Colour
from foretwin.viewer.rows import Row, path_part, point_at, static

FREE: Colour = (0, 92, 120)
CORRECTION: Colour = (255, 196, 0)

CARS: dict[str, tuple[Colour, float]] = {
    "real": (REAL, 0.0),
    "twin": (TWIN, 0.02),
    "shadow": (SHADOW, 0.05),
    "ghost": (GHOST, 0.08),
    "free": (FREE, -0.04),
}
"""Colour of each role, and by how many metres its wireframe stands off, so that all are seen."""

CAR_SIZE_M = (4.5, 1.8, 1.5, 0.95)
"""Length, width, height and rear overhang of the drawn car; base_link is the rear-axle centre."""

ARROW_M_PER_MPS2 = 4.0
_ARROW = "world/ego/twin/correction"
_GONE = 1e-3
"""Scale of who is not there: a static box cannot be taken away."""


def box_of(role: str, size_m: tuple[float, float, float, float] = CAR_SIZE_M) -> rr.Boxes3D:
    """Return the box of a vehicle in its role, about base_link."""
    length, width, height, overhang = size_m
    colour, margin_m = CARS[role]
    return rr.Boxes3D(
        half_sizes=[[length / 2 + margin_m, width / 2 + margin_m, height / 2 + margin_m]],
        centers=[[length / 2 - overhang, 0.0, height / 2 + 0.05]],
        colors=[colour],
        radii=0.04,
        fill_mode="solid" if role == "real" else "majorwireframe",
    )


def static_rows() -> list[Row]:
    """Return the colours and names of the correction's curves and arrows."""
    curves = (("along", CORRECTION), ("across", TWIN))
    rows = [
        static(f"correction/{name}", rr.SeriesLines(colors=colour, names=name, widths=2.0))
        for name, colour in curves
    ]
    arrow = rr.Arrows3D.from_fields(colors=[CORRECTION], radii=0.12)
    return [*rows, static(_ARROW, arrow)]


def pose_of(xy_m: Array, yaw_rad: float, *, scale: float | None = None) -> rr.Transform3D:
    """Return a pose on the ground of the drive's frame."""
    return rr.Transform3D(
        translation=point_at(xy_m, 0.0),
        quaternion=rr.Quaternion(xyzw=[0.0, 0.0, np.sin(yaw_rad / 2.0), np.cos(yaw_rad / 2.0)]),
        scale=scale,
    )


class RolesLog:
    """Turns samples of the mirror into rows of roles; a drive without any costs nothing more."""

    def __init__(self) -> None:
        self._used = False
        """Whether the car has ever been in another role than all three."""
        self._free_shown = self._drawn = False
        self._shown: dict[str, str] = {}
        """Role in which each vehicle beside the car is drawn."""

    def rows(self, sample: MirrorSample, drive_ns: int) -> list[Row]:
        """Return the car's twin, shadow and ghost as far as they are there, and all others."""
        rows = self._own(sample, drive_ns)
        here = {other.vehicle_id for other in sample.others}
        for gone in [name for name in self._shown if name not in here]:
            del self._shown[gone]
            rows += [Row(path, drive_ns, rr.Clear(recursive=True)) for path in _paths(gone)]
        for other in sample.others:
            rows += self._other(other, drive_ns)
        return rows

    def _own(self, sample: MirrorSample, drive_ns: int) -> list[Row]:
        self._used = self._used or sample.role != "all"
        rows = []
        for name in ("twin", "shadow", "ghost"):
            scale = None
            if self._used:
                scale = 1.0 if sample.role in ("all", name) else _GONE
            rows.append(Row(f"world/ego/{name}", drive_ns, _plane(getattr(sample, name), scale)))
        if sample.free is not None:
            if not self._free_shown:
                rows.append(Row("world/ego/free/box", drive_ns, box_of("free")))
            rows.append(Row("world/ego/free", drive_ns, _plane(sample.free)))
        elif self._free_shown:
            rows.append(Row("world/ego/free", drive_ns, rr.Clear(recursive=True)))
        self._free_shown = sample.free is not None
        if sample.correction is not None:
            rows += _drawn(sample.correction, drive_ns)
        elif self._drawn:
            rows.append(Row(_ARROW, drive_ns, rr.Clear(recursive=False)))
        self._drawn = sample.correction is not None
        return rows

    def _other(self, other: MirroredVehicle, drive_ns: int) -> list[Row]:
        path, measured = _paths(other.vehicle_id)
        size_m = (other.length_m, other.width_m, other.height_m, other.rear_overhang_m)
        rows = [Row(path, drive_ns, _plane(other.shown))]
        if self._shown.get(other.vehicle_id) != other.role:
            self._shown[other.vehicle_id] = other.role
            # Of one that is all three at once its twin is shown.
            drawn = "twin" if other.role == "all" else other.role
            label = rr.Points3D(
                [[0.0, 0.0, other.height_m + 0.6]],
                labels=[f"{other.vehicle_id}: {other.role}"],
                colors=[CARS[drawn][0]],
                radii=0.05,
            )
            rows += [
                Row(f"{path}/box", drive_ns, box_of(drawn, size_m)),
                Row(f"{path}/name", drive_ns, label),
                Row(f"{measured}/box", drive_ns, box_of("real", size_m)),
            ]
        return [*rows, Row(measured, drive_ns, _plane(other.real))]


def _paths(vehicle_id: str) -> tuple[str, str]:
    part = path_part(vehicle_id)
    return f"world/others/{part}", f"world/others_real/{part}"


def _plane(car: PlaneState, scale: float | None = None) -> rr.Transform3D:
    return pose_of(np.array([car.x_m, car.y_m]), car.yaw_rad, scale=scale)


def _drawn(correction: TwinCorrection, drive_ns: int) -> list[Row]:
    vector = np.array([correction.along_mps2, correction.across_mps2, 0.0]) * ARROW_M_PER_MPS2
    arrow = rr.Arrows3D.from_fields(vectors=[vector], origins=[[0.0, 0.0, CAR_SIZE_M[2] + 0.4]])
    return [
        Row(_ARROW, drive_ns, arrow),
        Row("correction/along", drive_ns, rr.Scalars(correction.along_mps2)),
        Row("correction/across", drive_ns, rr.Scalars(correction.across_mps2)),
    ]
