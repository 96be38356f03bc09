"""Where and in what the car drove: attributes of its operational design domain, with exposure.

Names are those of OpenLABEL's tags for operational design domains, whose list was read; ISO 34503,
of which such lists are made, was not.
"""

from __future__ import annotations

import itertools
from collections import Counter, defaultdict
from collections.abc import Sequence

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import GeoPoint, wrap_angle
from foretwin.contracts.world import Lane
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, DrivenMotion, OtherCourse
from foretwin.sim_worker.analysis.occurred.sun import sun_at

UNKNOWN = "unknown"
_AROUND_M = 50.0
_ROAD_TYPES = {
    "motorway": "RoadTypeMotorway",
    "motorway_link": "RoadTypeSlip",
    "trunk": "RoadTypeRadial",
    "primary": "RoadTypeRadial",
    "secondary": "RoadTypeDistributor",
    "tertiary": "RoadTypeDistributor",
    "parking_aisle": "RoadTypeParking",
}
"""Of OpenStreetMap's classes; what is not here is a minor road."""
_JUNCTIONS = {
    "crossing": "IntersectionCrossroad",
    "t_junction": "IntersectionTJunction",
    "y_junction": "IntersectionYJunction",
    "staggered": "IntersectionStaggered",
    "roundabout": "JunctionRoundabout",
    "circular": "JunctionRoundabout",
    "mini_roundabout": "RoundaboutMini",
}
_LIGHTS = {
    "day": "IlluminationDay",
    "low_sun": "DaySunElevation below 10°",
    "twilight": "LowLightAmbient",
    "night": "LowLightNight",
}
NOT_TOLD = (
    "EnvironmentWeather",
    "EnvironmentParticulates",
    "IlluminationCloudiness",
    "IlluminationArtificial",
    "DrivableAreaSurfaceCondition",
    "DrivableAreaSurfaceFeature",
    "EnvironmentConnectivity",
    "SceneryTemporaryStructure",
)
"""What neither the map nor the car's sensors say: never guessed."""


class OddExposure(msgspec.Struct, frozen=True, kw_only=True):
    """How much of a drive had one value of an attribute: metres, seconds, and junctions passed."""

    attribute: str
    value: str
    driven_m: float
    driven_s: float
    junctions: int = 0


class DrivenSpan(msgspec.Struct, frozen=True, kw_only=True):
    """How much was driven of some of a drive's time, with a known heading."""

    driven_m: float
    driven_s: float


def driven_in(ego: DrivenMotion, spans_ns: Sequence[tuple[int, int]]) -> DrivenSpan:
    """Return how much was driven from the first stamp of each span to before its second."""
    known, step_m = _steps(ego)
    within = np.zeros_like(known)
    for begin_ns, end_ns in spans_ns:
        within |= known & (ego.stamp_ns >= begin_ns) & (ego.stamp_ns < end_ns)
    return DrivenSpan(driven_m=float(step_m[within].sum()), driven_s=float(within.sum()) * STEP_S)


def odd_of(
    ego: DrivenMotion,
    courses: Sequence[OtherCourse],
    roads: Roads,
    scenarios: Sequence[OccurredScenario],
    *,
    where: GeoPoint,
    utc: bool,
    sees_others: bool,
) -> tuple[OddExposure, ...]:
    """Return exposure by attribute and value; what is not known is a value too.

    `where` is near the drive and `utc` says whether its stamps tell the time of day.
    """
    known, step_m = _steps(ego)
    values: dict[str, list[str]] = {
        "DrivableAreaType": [],
        "LaneSpecificationLaneCount": [],
        "SpeedLimit": [],
        "SpeedLimitSource": [],
    }
    heading = np.asarray(wrap_angle(ego.yaw_rad))
    for piece in roads.piece_at(ego.xy_m, heading).tolist():
        for name, value in _of_road(roads, piece).items():
            values[name].append(value)
    values["SubjectVehicleSpeed"] = _bands(np.abs(ego.speed_mps) * 3.6, (1.0, 30.0, 50.0, 100.0))
    values["EnvironmentIllumination"] = _light(ego, where, utc=utc)
    values["TrafficAgentDensity"] = _density(ego, courses, sees_others=sees_others)
    values["GeometryLongitudinal"] = [UNKNOWN] * len(known)
    found = [row for name, told in values.items() for row in _exposures(name, told, step_m, known)]
    found += _junctions(roads, scenarios)
    span_m, span_s = float(step_m.sum()), float(known.sum()) * STEP_S
    found += [
        OddExposure(attribute=name, value=UNKNOWN, driven_m=span_m, driven_s=span_s)
        for name in NOT_TOLD
    ]
    return tuple(found)


def _steps(ego: DrivenMotion) -> tuple[Flags, Array]:
    """Return where the car is known to be, and how far it moves from there to the next row."""
    known = np.asarray(np.isfinite(ego.xy_m).all(axis=1))
    moved = np.hypot(*np.diff(ego.xy_m, axis=0, append=ego.xy_m[-1:]).T)
    return known, np.where(known, np.nan_to_num(moved), 0.0)


def _of_road(roads: Roads, piece: int) -> dict[str, str]:
    if piece < 0:
        return dict.fromkeys(
            ("DrivableAreaType", "LaneSpecificationLaneCount", "SpeedLimit", "SpeedLimitSource"),
            UNKNOWN,
        )
    one = roads.pieces[piece]
    limit = one.way.speed_limit_mps if isinstance(one.way, Lane) else None
    kind = _ROAD_TYPES.get(one.road_class, "RoadTypeMinor") if one.road_class else UNKNOWN
    return {
        "DrivableAreaType": "JunctionIntersection" if one.in_junction else kind,
        "LaneSpecificationLaneCount": str(one.lanes) if one.lanes else UNKNOWN,
        "SpeedLimit": UNKNOWN if limit is None else f"{limit.value * 3.6:.0f} km/h",
        "SpeedLimitSource": UNKNOWN if limit is None else limit.source,
    }


def _bands(values: Array, edges: Sequence[float]) -> list[str]:
    names = [f"below {edges[0]:g} km/h"]
    names += [f"{a:g} to {b:g} km/h" for a, b in itertools.pairwise(edges)]
    names.append(f"{edges[-1]:g} km/h and more")
    return [names[i] for i in np.searchsorted(edges, np.nan_to_num(values), side="right").tolist()]


def _light(ego: DrivenMotion, where: GeoPoint, *, utc: bool) -> list[str]:
    if not utc:
        return [UNKNOWN] * len(ego.stamp_ns)
    every = round(60.0 / STEP_S)
    lights = [
        _LIGHTS[sun_at(int(stamp), where.lat_deg, where.lon_deg).light]
        for stamp in ego.stamp_ns[::every]
    ]
    return [lights[row // every] for row in range(len(ego.stamp_ns))]


def _density(ego: DrivenMotion, courses: Sequence[OtherCourse], *, sees_others: bool) -> list[str]:
    if not sees_others:
        return [UNKNOWN] * len(ego.stamp_ns)
    count = np.zeros(len(ego.stamp_ns), dtype=np.intp)
    for course in courses:
        away = np.hypot(*(course.xy_m - ego.xy_m[course.rows]).T)
        count[course.rows[away <= _AROUND_M]] += 1
    names = np.array(["none", "1 to 3", "4 to 9", "10 and more"])
    told = names[np.searchsorted([1, 4, 10], count, side="right")]
    return [f"{name} within {_AROUND_M:.0f} m" for name in told.tolist()]


def _exposures(name: str, told: list[str], step_m: Array, known: Flags) -> list[OddExposure]:
    metres: dict[str, float] = defaultdict(float)
    rows: Counter[str] = Counter()
    for value, step, there in zip(told, step_m.tolist(), known.tolist(), strict=True):
        if there:
            metres[value] += step
            rows[value] += 1
    return [
        OddExposure(
            attribute=name, value=value, driven_m=metres[value], driven_s=rows[value] * STEP_S
        )
        for value in sorted(metres, key=lambda one: -metres[one])
    ]


def _junctions(roads: Roads, scenarios: Sequence[OccurredScenario]) -> list[OddExposure]:
    """Return junctions passed by kind and by control."""
    passed = [row for row in scenarios if row.junction_id and not row.other_id]
    found = []
    for attribute in ("kind", "control"):
        count: Counter[str] = Counter()
        seconds: dict[str, float] = defaultdict(float)
        for row in passed:
            told = str(getattr(roads.junctions[row.junction_id].summary, attribute))
            value = _JUNCTIONS.get(told, told)
            count[value] += 1
            seconds[value] += (row.end_ns - row.begin_ns) * 1e-9
        found += [
            OddExposure(
                attribute="SceneryJunction " + attribute,
                value=value,
                driven_m=0.0,
                driven_s=seconds[value],
                junctions=passes,
            )
            for value, passes in count.most_common()
        ]
    return found
