"""Small drives drawn by formula: the car along a line, others along theirs."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths, headings_rad, points_at
from foretwin.sim_worker.analysis.occurred.recognise import recognise
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario
from foretwin.sim_worker.analysis.occurred.scene import Detected, DrivenMotion
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.sim_worker.scenarios.worlds import cross

START_NS = 5_000_000_000
CAR = load_vehicle()


def ego_along(line: Array, speed_mps: Array) -> DrivenMotion:
    """The car's base_link along a line at speeds (N,), every 0.1 s, from the line's beginning."""
    arc = np.concatenate([[0.0], np.cumsum(speed_mps[:-1] * 0.1)])
    xy = points_at(line, arc)
    yaw = np.interp(arc, arc_lengths(line), np.unwrap(headings_rad(line)))
    return DrivenMotion(
        stamp_ns=START_NS + np.arange(len(speed_mps), dtype=np.int64) * 100_000_000,
        xy_m=xy,
        yaw_rad=yaw,
        speed_mps=speed_mps,
        accel_mps2=np.gradient(speed_mps, 0.1),
        yaw_rate_radps=np.gradient(yaw, 0.1),
    )


def ego_eastwards(
    seconds: float = 18.0, *, speed_mps: float = 8.0, y_m: float = -1.6
) -> DrivenMotion:
    """The car straight over a crossing at the origin, which it reaches after 10 s."""
    speed = np.full(round(seconds * 10), speed_mps)
    begin = -10.0 * speed_mps - box_centre_from_base_m(CAR)
    return ego_along(np.array([[begin, y_m], [400.0, y_m]]), speed)


def other(name: str, at: Array, *, kind: RoadUserKind = "car", first_s: float = 0.0) -> Detected:
    """Somebody detected at points (N, 2), each 0.1 s, from a second of the drive on."""
    stamps = START_NS + round(first_s * 1e9) + np.arange(len(at), dtype=np.int64) * 100_000_000
    return Detected(name, kind, None, stamps, np.asarray(at), np.full(len(at), np.nan))


def moving(
    name: str,
    meets: tuple[float, float],
    velocity: tuple[float, float],
    at_s: float,
    *,
    kind: RoadUserKind = "car",
    seconds: float = 18.0,
) -> Detected:
    """Somebody who keeps a velocity and is at a point at a second of the drive."""
    time_s = np.arange(0.0, seconds, 0.1)[:, None]
    return other(name, np.array(meets) + (time_s - at_s) * np.array(velocity), kind=kind)


def seen_in(
    ego: DrivenMotion, *others: Detected, world: World | None = None
) -> tuple[OccurredScenario, ...]:
    """What is recognised at the drawn crossing."""
    place = cross() if world is None else world
    return recognise(ego, others, Roads((place,), place.frame), vehicle=CAR)


def kinds(rows: tuple[OccurredScenario, ...], other_id: str = "") -> list[str]:
    """The kinds of one road user's rows, or of the car's own."""
    return [row.kind for row in rows if row.other_id == other_id]
