"""Whether a car on a lot may be shown what is not there: well within its fence, and heard of now.

Pure: times are monotonic nanoseconds of one host, states those of the lot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.ros2.safety import GateTrouble

REACTION_S = 2.5
"""Of whoever takes over, until the brake acts: AASHTO, A Policy on Geometric Design of Highways and
Streets (2018), section 3.2.2, brake reaction time."""
BRAKING_MPS2 = 3.4
"""With which whoever takes over stops: the same, comfortable for most drivers."""
STALE_NS = 150_000_000
"""Nothing is known of a car of which nothing new was heard for so long, or of its state."""

APART_M = 5.0
"""A position may lie so far from the state, beside the car's own reach: 0.3 s at 15 m/s, or what a
receiver without corrections is off. Beyond, one of the two is wrong. Chosen."""


def margin_m(speed_mps: float) -> float:
    """Return how far a car goes at that speed until whoever takes over has stopped it."""
    speed = abs(speed_mps)
    return speed * REACTION_S + speed * speed / (2.0 * BRAKING_MPS2)


class FenceStanding(NamedTuple):
    """The vehicle's time, the way to the nearest side of its fence, and what is needed."""

    stamp_ns: int
    fence_m: float
    margin_m: float


class LotGuard:
    """Knows the fence and the newest state of the car, and says what is wrong."""

    def __init__(
        self,
        fence_deg: Sequence[tuple[float, float]],
        *,
        frame: LocalFrame,
        reach_m: float,
        apart_m: float = APART_M,
    ) -> None:
        """`fence_deg` are corners, latitude and longitude; `reach_m` is how far the car's body goes
        from base_link, `apart_m` how far a position may lie from the state besides; of a small car
        both are small."""
        lat_deg, lon_deg = np.array(fence_deg).T
        self._fence = shapely.Polygon(local_from_geo(frame, lat_deg, lon_deg))
        self._edge = self._fence.exterior
        self._frame, self._reach_m, self._apart_m = frame, reach_m, apart_m
        self._state: VehicleState | None = None
        self._state_ns = 0

    def take_state(self, state: VehicleState, *, now_ns: int) -> None:
        """Take the newest state; one that is not newer by the car's clock says nothing new."""
        if self._state is None or state.stamp_ns != self._state.stamp_ns:
            self._state, self._state_ns = state, now_ns

    def trouble(
        self, now_ns: int, *, heard_ns: int, fix: GeoPoint | None = None
    ) -> GateTrouble | None:
        """Return why nothing may go to the car now, None where it may.

        `heard_ns` is when the car itself was heard of last, `fix` its newest position as it came,
        which an estimate that takes it for a false one keeps out of the state.
        """
        state = self._state
        if state is None or now_ns - self._state_ns > STALE_NS:
            why = f"no new state of the car for {STALE_NS / 1e6:.0f} ms"
            return GateTrouble("state stale", why)
        if now_ns - heard_ns > STALE_NS:
            why = f"nothing heard of the car for {STALE_NS / 1e6:.0f} ms"
            return GateTrouble("car not heard", why)
        if "gnss" in state.stale:
            return GateTrouble("positions overdue", "the car's positions are overdue")
        place = self._place(state.position)
        if not self._fence.contains(place):
            return GateTrouble("outside the fence", "the car is outside its fence")
        if fix is not None and not (apart_m := place.distance(self._place(fix))) <= (
            self._apart_m + self._reach_m
        ):
            why = f"the car's position is {apart_m:.1f} m apart from its estimated state"
            return GateTrouble("position apart", why)
        left_m = self._left_m(place)
        if not left_m >= (needed_m := margin_m(state.speed_mps)):
            why = f"the fence is {left_m:.1f} m off, {needed_m:.1f} m are needed at this speed"
            return GateTrouble("near the fence", why)
        return None

    def standing(self, now_ns: int) -> FenceStanding | None:
        """Return where the car stands to its fence; None before any state, or without a place."""
        state = self._state
        if state is None or not math.isfinite(state.speed_mps):
            return None
        if (place := self._place(state.position)).is_empty:
            return None
        stamp_ns = state.stamp_ns + now_ns - self._state_ns
        return FenceStanding(stamp_ns, self._left_m(place), margin_m(state.speed_mps))

    def _left_m(self, place: shapely.Point) -> float:
        away_m = float(self._edge.distance(place))
        return (away_m if self._fence.contains(place) else -away_m) - self._reach_m

    def _place(self, at: GeoPoint) -> shapely.Point:
        x_m, y_m = local_from_geo(self._frame, at.lat_deg, at.lon_deg).tolist()
        return shapely.Point(x_m, y_m) if math.isfinite(x_m + y_m) else shapely.Point()
