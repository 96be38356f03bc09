"""The drive as rows: the cars, where they have been, the plan, the gap, and where the eye looks."""

from __future__ import annotations

import collections
import math

import numpy as np
import rerun as rr

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, PlannedTrajectory, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw, wrap_angle
from foretwin.contracts.gap import limits_after
from foretwin.contracts.simulation import MirrorSample, PlaneState
from foretwin.viewer.colours import GHOST, SHADOW, TWIN, Colour
from foretwin.viewer.log_roles import RolesLog, box_of, pose_of
from foretwin.viewer.rows import Row, point_at, raised, static

TRAIL: Colour = (126, 132, 144)
PLAN: Colour = (88, 150, 255)
LIMIT: Colour = (229, 72, 66)

GAPS = ("pos_m", "yaw_deg", "speed_mps")
"""Of the free twin, as plotted."""


def gap_limits(since_reset_s: float) -> dict[str, float]:
    """Return the lines of the gap plots so long after the free twin started anew.

    Who is farther away than `pos_m` is beyond the limit along or across.
    """
    limits = limits_after(since_reset_s)
    return {
        "pos_m": math.hypot(limits["along_m"], limits["across_m"]),
        "yaw_deg": math.degrees(limits["yaw_rad"]),
        "speed_mps": limits["speed_mps"],
    }


TRAIL_S = 10.0
PERIOD_NS = 95_000_000
"""Cars and gaps are logged at most at about 10 Hz of drive time."""
TRAIL_PERIOD_NS = 195_000_000
LIMIT_PERIOD_NS = 995_000_000
"""Straight lines need few points."""
FOCUS_REACH_M = 32.0
MARK_HEIGHT_M = 60.0
FOCUS_TIME_CONSTANT_S = 1.5


def static_rows() -> list[Row]:
    """Return what never changes: axes, the cars' boxes, the colours of the curves."""
    rows = [static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)]
    rows += [
        static(f"world/ego/{name}", box_of(name)) for name in ("real", "twin", "shadow", "ghost")
    ]
    # Said once for all instants: turned into Rerun's form each time, colours cost most of a row.
    mark, place, fix = (rr.Radius.ui_points(size) for size in (6, 9, 3))
    trail = rr.Radius.ui_points(2.5)
    rows += [
        static("map/ego", rr.Points3D.from_fields(radii=mark, colors=[TWIN])),
        static("geo/ego/real", rr.GeoPoints.from_fields(radii=place, colors=[TWIN])),
        static("geo/ego/trail", rr.GeoLineStrings.from_fields(radii=trail, colors=[TWIN])),
        static("geo/gnss", rr.GeoPoints.from_fields(radii=fix, colors=[GHOST])),
        static("world/ego/trail/real", rr.LineStrips3D.from_fields(radii=0.12, colors=[TRAIL])),
        static("world/plan", rr.LineStrips3D.from_fields(radii=0.22, colors=[PLAN])),
    ]
    for quantity in GAPS:
        names = ["limit"] if quantity == "pos_m" else ["limit", "-limit"]
        count = len(names)
        limit = rr.SeriesLines(colors=[LIMIT] * count, names=names, widths=[2.5] * count)
        rows += [
            static(f"gap/{quantity}/twin", rr.SeriesLines(colors=TWIN, names="twin", widths=2.0)),
            static(
                f"gap/{quantity}/shadow", rr.SeriesLines(colors=SHADOW, names="shadow", widths=1.5)
            ),
            static(f"gap/{quantity}/limit", limit),
        ]
    return rows


class DriveLog:
    """Turns the drive's messages into rows of one drive frame, at most 10 of an entity a second."""

    def __init__(self, drive_frame: LocalFrame) -> None:
        self._frame = drive_frame
        self._last_ns: dict[str, int] = {}
        self._trail: collections.deque[tuple[int, Array, tuple[float, float]]] = collections.deque()
        self._roles = RolesLog()
        self._limit_point = (0.0, 0)
        """Since when the free twin ran at the last sample, and that sample's drive time."""
        self._yaw_rad = 0.0
        self._junction: Array | None = None
        self._focus: Array | None = None

    def _due(self, what: str, drive_ns: int, period_ns: int = PERIOD_NS) -> bool:
        last = self._last_ns.get(what)
        if last is not None and 0 <= drive_ns - last < period_ns:
            return False
        self._last_ns[what] = drive_ns
        return True

    def look_at(self, centre_m: Array | None) -> None:
        """Let the intersection view lean towards the junction at (2,) `centre_m`."""
        self._junction = centre_m

    def state(self, state: VehicleState, drive_ns: int) -> list[Row]:
        """Return the real car's pose, its trail, its place on the map, and the view's focus."""
        if state.yaw_valid:
            self._yaw_rad = float(
                local_from_geo_yaw(
                    self._frame, state.yaw_rad, state.position.lat_deg, state.position.lon_deg
                )
            )
        if not self._due("state", drive_ns):
            return []
        here = local_from_geo(self._frame, state.position.lat_deg, state.position.lon_deg)
        lat_lon = (state.position.lat_deg, state.position.lon_deg)
        self._trail.append((drive_ns, here, lat_lon))
        while drive_ns - self._trail[0][0] > TRAIL_S * 1e9 or self._trail[0][0] > drive_ns:
            self._trail.popleft()
        rows = [
            Row("world/ego/real", drive_ns, pose_of(here, self._yaw_rad)),
            Row("world/focus", drive_ns, rr.Transform3D(translation=self._look(here, drive_ns))),
            # From straight above, the car itself is a few pixels.
            Row("map/ego", drive_ns, rr.Points3D([point_at(here, MARK_HEIGHT_M)])),
            Row("geo/ego/real", drive_ns, rr.GeoPoints(lat_lon=[lat_lon])),
        ]
        rows += [
            Row(f"estimate/{name}", drive_ns, rr.Scalars(scale * std))
            for name, std, scale in (
                ("position_m", state.position_std_m, 1.0),
                ("yaw_deg", state.yaw_std_rad, float(np.degrees(1.0))),
                ("speed_mps", state.speed_std_mps, 1.0),
            )
            if std is not None
        ]
        if len(self._trail) > 1 and self._due("trail", drive_ns, TRAIL_PERIOD_NS):
            path = raised(np.array([point for _, point, _ in self._trail]), 0.1)
            places = [place for _, _, place in self._trail]
            rows += [
                Row("world/ego/trail/real", drive_ns, rr.LineStrips3D([path])),
                Row("geo/ego/trail", drive_ns, rr.GeoLineStrings(lat_lon=[places])),
            ]
        return rows

    def _look(self, here: Array, drive_ns: int) -> list[float]:
        """Move the focus smoothly to between the car and the junction it is concerned with."""
        wanted = here + 15.0 * np.array([np.cos(self._yaw_rad), np.sin(self._yaw_rad)])
        if self._junction is not None:
            towards = self._junction - here
            distance_m = float(np.hypot(*towards))
            if distance_m > 1e-6:
                wanted = here + towards * min(1.0, FOCUS_REACH_M / distance_m)
        last_ns = self._last_ns.get("focus")
        if self._focus is None or last_ns is None or not 0 <= drive_ns - last_ns < 5e9:
            self._focus = wanted
        else:
            weight = 1.0 - np.exp(-(drive_ns - last_ns) / (FOCUS_TIME_CONSTANT_S * 1e9))
            self._focus = self._focus + weight * (wanted - self._focus)
        self._last_ns["focus"] = drive_ns
        return point_at(self._focus, 0.0)

    def gnss(self, fix: GnssFix, drive_ns: int) -> list[Row]:
        """Return the antenna's raw position on the map."""
        if not self._due("gnss", drive_ns):
            return []
        place = [fix.position.lat_deg, fix.position.lon_deg]
        return [Row("geo/gnss", drive_ns, rr.GeoPoints(lat_lon=[place]))]

    def plan(self, plan: PlannedTrajectory, drive_ns: int) -> list[Row]:
        """Return the car's own plan as a line."""
        if len(plan.lat_deg) < 2 or not self._due("plan", drive_ns):
            return []
        xy_m = local_from_geo(self._frame, plan.lat_deg, plan.lon_deg)
        return [Row("world/plan", drive_ns, rr.LineStrips3D([raised(xy_m, 0.22)]))]

    def mirror(self, sample: MirrorSample, drive_ns: int) -> list[Row]:
        """Return who stands where in which role, and the free twin's gaps to the real car."""
        if not self._due("mirror", drive_ns):
            return []
        real, shadow = sample.real, sample.shadow
        rows = self._roles.rows(sample, drive_ns)
        twin_gap = (sample.gap_m, np.degrees(sample.gap_yaw_rad), sample.gap_speed_mps)
        gaps = zip(GAPS, twin_gap, _gap(shadow, real), strict=True)
        for quantity, twin, other in gaps:
            rows += [
                Row(f"gap/{quantity}/twin", drive_ns, rr.Scalars(float(twin))),
                Row(f"gap/{quantity}/shadow", drive_ns, rr.Scalars(float(other))),
            ]
        # What estimated commands lose is no alarm: there is no limit then.
        return rows + (self._limits(sample.since_reset_s, drive_ns) if sample.independent else [])

    def _limits(self, since_reset_s: float, drive_ns: int) -> list[Row]:
        """Return points of the limits' lines: once a second, and both ends of each fall."""
        before, self._limit_point = self._limit_point, (since_reset_s, drive_ns)
        points = [self._limit_point]
        if since_reset_s < before[0] and drive_ns > before[1]:
            points = [before, self._limit_point]
            self._last_ns["limit"] = drive_ns
        elif not self._due("limit", drive_ns, LIMIT_PERIOD_NS):
            return []
        return [
            Row(
                f"gap/{quantity}/limit",
                at_ns,
                rr.Scalars([limit] if quantity == "pos_m" else [limit, -limit]),
            )
            for at_s, at_ns in points
            for quantity, limit in gap_limits(at_s).items()
        ]


def _gap(car: PlaneState, real: PlaneState) -> tuple[float, float, float]:
    """Return distance in metres, yaw in degrees and speed in m/s of `car` minus `real`."""
    return (
        float(np.hypot(car.x_m - real.x_m, car.y_m - real.y_m)),
        float(np.degrees(wrap_angle(car.yaw_rad - real.yaw_rad))),
        car.speed_mps - real.speed_mps,
    )
