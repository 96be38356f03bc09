"""Rounds of few futures, drawn by hand: the car goes east from the origin at 10 m/s for 8 s."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.simulation import FutureHit, MetRoadUser, RoundView

POINTS, HORIZON_S = 25, 8.0
TIMES_S = np.linspace(0.0, HORIZON_S, POINTS)


def line(from_m: tuple[float, float], velocity_mps: tuple[float, float]) -> Array:
    """Return where somebody is at each point of a round."""
    return np.asarray(from_m) + TIMES_S[:, None] * np.asarray(velocity_mps)


OWN = line((0.0, 0.0), (10.0, 0.0))


def round_of(
    *threats: tuple[RoadUserKind, Array, float],
    likelihood: float = 0.12,
    hits: bool = True,
    static: float | None = None,
    late: bool = False,
    own: Array = OWN,
) -> RoundView:
    """Return a round: the nominal future, one for each (kind, track, criticality), which meets it
    after 2 s, and with `static` one of that criticality that runs into a wall after 3 s."""
    more = () if static is None else (static,)
    criticality = [0.0, *(value for _, _, value in threats), *more]
    count = len(criticality)
    found = [
        FutureHit(future=1 + number, time_s=2.0, what=kind)
        for number, (kind, _, _) in enumerate(threats)
        if hits
    ]
    if static is not None:
        found.append(FutureHit(future=count - 1, time_s=3.0, what="static"))
    return RoundView(
        round_id=1,
        stamp_ns=1,
        intersection_id="n4",
        world_id="w4",
        xy_m=np.repeat(own[None], count, axis=0).astype(np.float32),
        criticality=np.array(criticality, dtype=np.float32),
        likelihood=np.array([1.0] + [likelihood] * (count - 1), dtype=np.float32),
        nominal_index=0,
        names=tuple(f"future {number}" for number in range(count)),
        collided=len(found),
        min_clearance_m=None,
        latency_ms=120.0,
        user_xy_m=np.array([track for _, track, _ in threats], dtype=np.float32).reshape(
            -1, POINTS, 2
        ),
        touch_xy_m=np.zeros((0, 2), dtype=np.float32),
        touch_names=(),
        late=late,
        horizon_s=HORIZON_S,
        hits=tuple(found),
        met=tuple(
            MetRoadUser(future=1 + number, time_s=2.0, kind=kind)
            for number, (kind, _, _) in enumerate(threats)
        ),
    )
