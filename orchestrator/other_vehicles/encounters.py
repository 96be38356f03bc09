"""How near vehicles came to one another in the World, wherever each of them really is.

Outlines are compared at one time, by the car's own clock: evenly between two measurements, and
after the last one where the vehicle is reckoned to be, for as long as that is known to a metre.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from itertools import combinations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, local_pose, wrap_angle
from foretwin.contracts.roles import VehicleEncounter
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.constant_turn import constant_turn_rate
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.orchestrator.other_vehicles.dead_reckoning import astray_m, reckoned_for_s
from foretwin.sim_worker.batch.collision_detection import ego_rectangles

NEAR_M = 10.0
"""Two whose outlines come this near meet; apart by twice as much, that is over."""
STEP_NS = 2_000_000
"""Between two looks at two that are near: closing at 50 m/s they move by 10 cm."""
WAITS_NS = 2_000_000_000
"""So long may a measurement be on its way: until then nobody is taken for silent."""
_MOST_KEPT = 1024
_KEPT_NS = 2 * WAITS_NS
_TAIL_NS = 20_000_000


class _OutlineTrack:
    """What was measured of one vehicle lately, in one plane."""

    def __init__(self, vehicle: VehicleParameters, frame: LocalFrame) -> None:
        self._vehicle, self._frame = vehicle, frame
        self._reckoned_ns = round(reckoned_for_s(vehicle) * 1e9)
        self._stamps_ns: deque[int] = deque(maxlen=_MOST_KEPT)
        self._poses: deque[tuple[float, float, float]] = deque(maxlen=_MOST_KEPT)
        self._newest: VehicleState | None = None
        self._clock_std_s = 0.0

    def take(self, state: VehicleState, clock_std_s: float) -> None:
        """Take a state; one that is not newer than those before it is passed over."""
        last = self._newest
        yaw_before = state.yaw_rad
        if last is not None:
            if state.stamp_ns <= last.stamp_ns:
                return
            if state.stamp_ns - last.stamp_ns > self._reckoned_ns:
                self._end_in_nowhere(last.stamp_ns)
            else:
                yaw_before = self._poses[-1][2]
        x_m, y_m, yaw_rad = local_pose(self._frame, state.position, state.yaw_rad)
        yaw_rad = yaw_before + float(wrap_angle(np.float64(yaw_rad - yaw_before)))
        self._keep(state.stamp_ns, (x_m, y_m, yaw_rad))
        self._newest, self._clock_std_s = state, clock_std_s
        while self._stamps_ns[-1] - self._stamps_ns[0] > _KEPT_NS:
            self._stamps_ns.popleft()
            self._poses.popleft()

    def _end_in_nowhere(self, last_ns: int) -> None:
        """Keep where it was reckoned to be, and that nobody knows where it was afterwards."""
        tail = np.arange(last_ns + _TAIL_NS, last_ns + self._reckoned_ns, _TAIL_NS)
        for stamp_ns, (x_m, y_m, yaw_rad) in zip(tail, self.poses(tail), strict=True):
            self._keep(int(stamp_ns), (float(x_m), float(y_m), float(yaw_rad)))
        self._keep(self._stamps_ns[-1] + 1, (math.nan, math.nan, math.nan))

    def _keep(self, stamp_ns: int, pose: tuple[float, float, float]) -> None:
        self._stamps_ns.append(stamp_ns)
        self._poses.append(pose)

    def first_ns(self) -> int | None:
        """Return since when it is known where it was, None of nothing heard."""
        return self._stamps_ns[0] if self._stamps_ns else None

    def silent(self, now_ns: int) -> bool:
        """Whether it was not measured for so long that nothing can be on its way any more."""
        return now_ns - self._stamps_ns[-1] > WAITS_NS

    def settled_ns(self, now_ns: int) -> int:
        """Return until when what is known of it stays as it is."""
        return self._stamps_ns[-1] + (self._reckoned_ns if self.silent(now_ns) else 0)

    def poses(self, stamps_ns: Stamps) -> Array:
        """Return (N, 3) poses of base_link at stamps (N,), NaN where it is not known where."""
        assert self._newest is not None
        origin_ns = self._stamps_ns[-1]
        at_s = (stamps_ns - origin_ns) / 1e9
        known_s = (np.array(self._stamps_ns) - origin_ns) / 1e9
        columns = np.array(self._poses).T
        poses = np.stack([np.interp(at_s, known_s, column) for column in columns], axis=1)
        late = at_s > 0.0
        if late.any():
            poses[late] = constant_turn_rate(
                columns[:, -1],
                speed_mps=self._newest.speed_mps,
                accel_mps2=self._newest.accel_mps2,
                yaw_rate_radps=self._newest.yaw_rate_radps,
                time_s=at_s[late],
            )
        return poses

    def outlines(self, stamps_ns: Stamps) -> Rectangles:
        """Return its outlines (N,) at stamps (N,)."""
        return ego_rectangles(self._vehicle, self.poses(stamps_ns))

    def std_m(self) -> float:
        """Return how sure its place is along its way, from position and clock."""
        assert self._newest is not None
        along_m = self._newest.speed_mps * self._clock_std_s
        return math.hypot(self._newest.position_std_m or 0.0, along_m)

    def astray_m(self, stamp_ns: int) -> float:
        """Return the bound of where it is reckoned to be; 0 up to its last measurement."""
        return astray_m(self._vehicle, max(0, stamp_ns - self._stamps_ns[-1]) / 1e9)


class EncounterWatch:
    """Judges all pairs of vehicles of one World; no clock, no bus.

    An instant is judged once both vehicles have been measured after it, or one of them has been
    silent for two seconds. Stamps are by one clock.
    """

    def __init__(self, vehicles: Mapping[str, VehicleParameters], frame: LocalFrame) -> None:
        self._motions = {name: _OutlineTrack(one, frame) for name, one in vehicles.items()}
        self._judged_ns: dict[tuple[str, str], int] = {}
        self._open: dict[tuple[str, str], VehicleEncounter] = {}

    def take(self, state: VehicleState, *, clock_std_s: float = 0.0) -> None:
        """Take where a vehicle was measured; `clock_std_s` says how sure its stamp is."""
        self._motions[state.vehicle_id].take(state, clock_std_s)

    def judge(self, now_ns: int, *, apart: Iterable[str] = ()) -> list[VehicleEncounter]:
        """Return the encounters that have ended; `apart` are those whom nobody meets."""
        alone = set(apart)
        ended = [self._open.pop(pair) for pair in list(self._open) if alone & set(pair)]
        for pair in combinations([name for name in self._motions if name not in alone], 2):
            over = self._judge(pair, now_ns)
            if over and pair in self._open:
                ended.append(self._open.pop(pair))
        return ended

    def finish(self) -> list[VehicleEncounter]:
        """Return the encounters that are still open, as far as they were judged."""
        left = list(self._open.values())
        self._open.clear()
        return left

    @property
    def open(self) -> tuple[VehicleEncounter, ...]:
        """The encounters that go on, as far as they were judged."""
        return tuple(self._open.values())

    def _judge(self, pair: tuple[str, str], now_ns: int) -> bool:
        """Look at what has settled of two; returns whether they meet no more."""
        a, b = (self._motions[name] for name in pair)
        first_a, first_b = a.first_ns(), b.first_ns()
        if first_a is None or first_b is None:
            return True
        first_ns = max(first_a, first_b, self._judged_ns.get(pair, 0) + STEP_NS)
        last_ns = min(a.settled_ns(now_ns), b.settled_ns(now_ns))
        if first_ns > last_ns:
            return a.silent(now_ns) or b.silent(now_ns)
        stamps_ns = np.arange(first_ns, last_ns + 1, STEP_NS)
        self._judged_ns[pair] = int(stamps_ns[-1])
        one, other = a.outlines(stamps_ns), b.outlines(stamps_ns)
        # NaN, where one is gone, would count as an overlap.
        known = np.isfinite(one.yaw_rad) & np.isfinite(other.yaw_rad)
        apart_m = np.where(known, clearance(one, other), np.inf)
        least = int(apart_m.argmin())
        if apart_m[least] <= NEAR_M or pair in self._open:
            self._note(pair, a, b, stamps_ns, apart_m)
        return bool(apart_m[-1] > 2.0 * NEAR_M)

    def _note(
        self,
        pair: tuple[str, str],
        a: _OutlineTrack,
        b: _OutlineTrack,
        stamps_ns: Stamps,
        apart_m: Array,
    ) -> None:
        """Keep how near two were at stamps (N,): apart_m (N,), infinite where one is gone."""
        known = self._open.get(pair)
        least = int(apart_m.argmin())
        if known is None:
            began = int((apart_m <= NEAR_M).argmax())
            known = VehicleEncounter(
                one=pair[0], other=pair[1], stamp_ns=int(stamps_ns[began]), end_stamp_ns=0,
                least_m=math.inf, least_stamp_ns=0, uncertain_m=0.0, touched=False,
            )  # fmt: skip
        if apart_m[least] < known.least_m:
            stamp_ns = int(stamps_ns[least])
            known = msgspec.structs.replace(
                known,
                least_m=float(apart_m[least]),
                least_stamp_ns=stamp_ns,
                uncertain_m=math.hypot(a.std_m(), b.std_m())
                + a.astray_m(stamp_ns)
                + b.astray_m(stamp_ns),
                touched=bool(apart_m[least] <= 0.0),
            )
        together = np.flatnonzero(apart_m <= 2.0 * NEAR_M)
        if len(together):
            known = msgspec.structs.replace(known, end_stamp_ns=int(stamps_ns[together[-1]]))
        self._open[pair] = known
