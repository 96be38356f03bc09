"""The same seconds simulated and driven: collects both during a drive, and judges them at its end.

Nothing is judged while the drive goes on: that would take time from the rounds. Each window is
handed on as soon as it is known, so that who goes on with the drive, or recovers it, judges it too.
"""

from __future__ import annotations

import contextlib
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import SchemaMismatch
from foretwin.contracts.drive import RoadUser, RoadUsers, SignalColour, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.trace import traced
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.agreement.known_windows import ThinnedWindows
from foretwin.orchestrator.instructions import LatestReports
from foretwin.orchestrator.runner.open_rounds import RoundDone
from foretwin.sim_worker.analysis.agreement.criteria import CriteriaEvaluator
from foretwin.sim_worker.analysis.agreement.doubt import WorldDoubt
from foretwin.sim_worker.analysis.agreement.tally import Judged, judged, tally
from foretwin.sim_worker.analysis.agreement.window import Heard, Users, Window
from foretwin.sim_worker.metrics.route_rules import RouteRules

MOST_KEPT = 32
"""Of a crowd the nearest: of 500, a window took 80 ms of the orchestrator's time each second. A
simulation meets half as many (`foretwin.orchestrator.rounds.seen_users`)."""
_HOLE_NS, _SEEN_HOLE_NS = 1_500_000_000, 1_000_000_000
_SPARE_NS = 3_000_000_000
_NEVER_NS = -(1 << 62)

Stamps = npt.NDArray[np.int64]


class _Simulated(NamedTuple):
    """A nominal future until it has been driven."""

    round_id: int
    stamp_ns: int
    junction_id: str
    world: World
    time_s: Array
    states: Array
    users: Users
    path: PathAhead


class OpenWindows:
    """Takes states, what is seen and heard, and rounds; gives verdicts at the end."""

    def __init__(
        self,
        vehicle: VehicleParameters,
        *,
        horizon_s: float,
        on_window: Callable[[Window], object] = lambda _: None,
    ) -> None:
        self._vehicle, self._on_window = vehicle, on_window
        self._keep_ns = round(horizon_s * 1e9) + _SPARE_NS
        self._states: deque[VehicleState] = deque()
        self._seen: deque[RoadUsers] = deque()
        self._heard: dict[str, deque[tuple[int, SignalColour]]] = defaultdict(deque)
        self._waiting: deque[_Simulated] = deque()
        self._windows = ThinnedWindows()
        self._worlds: dict[str, World] = {}
        self._last_ns: int | None = None
        self._closed_ns = _NEVER_NS
        """When the car was last on a way that is closed to cars."""
        self.antenna_known = False
        """Whether the source tells where on the car its positions are of."""
        self.judged: list[Judged] = []

    @traced("agreement: take a state")
    def take(self, said: LatestReports, state: VehicleState, closed_road: bool = False) -> None:
        """Take where the car is, what it newly saw and heard, and whether it is on a way that the
        map has but gives to no car."""
        if self._states and state.stamp_ns < self._states[-1].stamp_ns - _SPARE_NS:
            for gone in (self._states, self._seen, self._waiting):
                gone.clear()
            self._heard.clear()
            self._last_ns = None
            self._closed_ns = _NEVER_NS
        if not state.yaw_valid or (self._states and state.stamp_ns <= self._states[-1].stamp_ns):
            return
        self._states.append(state)
        if closed_road:
            self._closed_ns = state.stamp_ns
        users = said.road_users
        if users is not None and (not self._seen or users.stamp_ns > self._seen[-1].stamp_ns):
            self._seen.append(_nearest(users, state))
        for signal in said.signals:
            known = self._heard[signal.group_id]
            if not known or signal.stamp_ns > known[-1][0]:
                known.append((signal.stamp_ns, signal.colour))
        while self._waiting and _end_ns(self._waiting[0]) <= state.stamp_ns:
            self._settle(self._waiting.popleft())
        self._forget(state.stamp_ns)

    @traced("agreement: take a round")
    def take_round(self, done: RoundDone, path: PathAhead, world: World) -> None:
        """Take a round's nominal future, the first of its first job."""
        result = done.results[0]
        stamp_ns = result.trajectory.stamp_ns
        if self._last_ns is not None and stamp_ns - self._last_ns < self._windows.every_ns:
            return
        self._last_ns = stamp_ns
        others = result.road_users
        time_s, states, *users = (
            np.asarray(values, dtype=np.float64)
            for values in (
                result.trajectory.time_s,
                result.trajectory.states[0],
                *(others.poses[0], others.speed_mps[0], others.size_m[0]),
            )
        )
        what = done.order.round_id, stamp_ns, done.order.junction_id, world
        self._waiting.append(_Simulated(*what, time_s, states, Users(*users), path))

    def go_on(self, known: Iterable[Window], world_of: Callable[[str], World]) -> None:
        """Begin with the windows that another orchestrator of this drive knew, in their order."""
        for window in known:
            self._windows.take(window)
        for world_id in self._windows.world_ids:
            with contextlib.suppress(OSError, SchemaMismatch):  # a World that is gone judges none
                self._worlds[world_id] = world_of(world_id)

    def finish(self) -> list[Judged]:
        """Judge all windows, World by World."""
        self._waiting.clear()
        self.judged = judge_all(self._windows.kept, self._worlds, self._vehicle)
        self._windows = ThinnedWindows()
        return self.judged

    def record(self, start_stamp_ns: int) -> dict[str, Any] | None:
        """Return the `agreement` part of run.json, None where nothing was simulated and driven."""
        return tally(self.judged, start_stamp_ns=start_stamp_ns) if self.judged else None

    def _settle(self, one: _Simulated) -> None:
        # Negative where the vehicle's clock has been set back.
        last_ns = self._windows.last_ns
        if last_ns is not None and 0 <= one.stamp_ns - last_ns < self._windows.every_ns:
            return
        window = self._window(one)
        if window is None:
            return
        self._on_window(window)
        self._worlds[one.world.id] = one.world
        if self._windows.take(window):
            used = self._windows.world_ids
            self._worlds = {key: world for key, world in self._worlds.items() if key in used}

    def _window(self, one: _Simulated) -> Window | None:
        stamps = one.stamp_ns + np.round(one.time_s * 1e9).astype(np.int64)
        known = [s for s in self._states if s.stamp_ns >= stamps[0] - _HOLE_NS]
        at = np.array([state.stamp_ns for state in known], dtype=np.int64)
        if len(at) < 2 or at[0] > stamps[0] or (np.diff(at) > _HOLE_NS).any():
            return None
        stds = [state.position_std_m for state in known]
        seen = [s for s in self._seen if stamps[0] - _SEEN_HOLE_NS <= s.stamp_ns]
        told = np.array([stamps[0], *(s.stamp_ns for s in seen), stamps[-1]], dtype=np.int64)
        return Window(
            round_id=one.round_id,
            stamp_ns=one.stamp_ns,
            junction_id=one.junction_id,
            world_id=one.world.id,
            time_s=one.time_s,
            simulated=one.states,
            simulated_users=one.users,
            driven=_driven(known, at, stamps, one.world.frame),
            driven_users=_users(seen, stamps, one.world.frame),
            path_xy_m=one.path.xy_m,
            heard={
                group: Heard(np.array([ns for ns, _ in said]), tuple(colour for _, colour in said))
                for group, said in self._heard.items()
                if said and said[-1][0] >= stamps[0]
            },
            known_users=bool(seen) and bool((np.diff(np.sort(told)) <= _SEEN_HOLE_NS).all()),
            position_std_m=max((s for s in stds if s is not None), default=None),
            driven_std=_driven_std(known, at, stamps),
            state_period_s=float(np.diff(at[: np.searchsorted(at, stamps[-1]) + 1]).max()) / 1e9,
            antenna_known=self.antenna_known,
            closed_road=bool(self._closed_ns >= stamps[0]),
        )

    def _forget(self, now_ns: int) -> None:
        oldest = now_ns - self._keep_ns
        while self._states[0].stamp_ns < oldest:
            self._states.popleft()
        while self._seen and self._seen[0].stamp_ns < oldest:
            self._seen.popleft()
        for said in self._heard.values():
            while said and said[0][0] < oldest:
                said.popleft()


def judge_all(
    windows: Iterable[Window], worlds: Mapping[str, World], vehicle: VehicleParameters
) -> list[Judged]:
    """Judge windows in the order of their stamps; those without a World are not judged."""
    found: list[Judged] = []
    for world_id, world in worlds.items():
        mine = [window for window in windows if window.world_id == world_id]
        found += judge_in(world, mine, vehicle)
    return sorted(found, key=lambda one: one.window.stamp_ns)


def judge_in(world: World, windows: list[Window], vehicle: VehicleParameters) -> list[Judged]:
    """Judge the windows of one World."""
    doubt = WorldDoubt(world)
    found = []
    for window in windows:
        rules = RouteRules(world, FrenetPath(window.path_xy_m))
        found.append(judged(window, CriteriaEvaluator(window, rules, doubt, vehicle)))
    return found


def _end_ns(one: _Simulated) -> int:
    return one.stamp_ns + round(float(one.time_s[-1]) * 1e9)


def _placed(
    things: Sequence[VehicleState | RoadUser], frame: LocalFrame
) -> tuple[Array, Array, Array]:
    """Return positions (N, 2) and headings (N,) without jumps in a frame, and speeds (N,)."""
    lat, lon, yaw, speed = np.array(
        [(one.position.lat_deg, one.position.lon_deg, one.yaw_rad, one.speed_mps) for one in things]
    ).T
    xy = np.asarray(local_from_geo(frame, lat, lon))
    return xy, np.unwrap(local_from_geo_yaw(frame, yaw, lat, lon)), speed


def _driven(known: list[VehicleState], at: Stamps, stamps: Stamps, frame: LocalFrame) -> Array:
    """Return states (N, 8) of a drive at stamps, in a World's frame."""
    xy, heading, speed = _placed(known, frame)
    rate, tire, accel = np.array(
        [(s.yaw_rate_radps, s.tire_angle_rad or 0.0, s.accel_mps2) for s in known]
    ).T
    columns = (xy[:, 0], xy[:, 1], heading, speed, np.zeros(len(at)), rate, tire, accel)
    since, wanted = at - stamps[0], stamps - stamps[0]
    return np.column_stack([np.interp(wanted, since, column) for column in columns])


def _driven_std(known: list[VehicleState], at: Stamps, stamps: Stamps) -> Array:
    """Return (N, 2) standard deviations of speed and yaw at stamps, infinite where unknown."""
    told = [(s.speed_std_mps, s.yaw_std_rad) for s in known]
    stds = np.array([[np.inf if one is None else one for one in both] for both in told])
    # The nearest, since infinity times nothing is no number.
    nearest = np.abs(at[None, :] - stamps[:, None]).argmin(axis=1)
    found: Array = stds[nearest]
    return found


def _nearest(users: RoadUsers, state: VehicleState) -> RoadUsers:
    """Return what was seen, of more than `MOST_KEPT` the nearest, in the order in which they
    were told."""
    if len(users.users) <= MOST_KEPT:
        return users
    place = (state.position.lat_deg, state.position.lon_deg)
    apart = np.array([(u.position.lat_deg, u.position.lon_deg) for u in users.users]) - place
    apart[:, 1] *= np.cos(np.radians(place[0]))  # to say who is nearer this is enough
    kept = np.sort(np.argsort(np.hypot(*apart.T), kind="stable")[:MOST_KEPT])
    return msgspec.structs.replace(users, users=tuple(users.users[i] for i in kept))


def _users(seen: list[RoadUsers], stamps: Stamps, frame: LocalFrame) -> Users:
    """Return those seen at stamps (N,), between two sightings no more than a second apart."""
    tracks: dict[str, list[tuple[int, RoadUser]]] = defaultdict(list)
    for message in seen:
        for user in message.users:
            tracks[user.user_id].append((message.stamp_ns, user))
    count = len(stamps)
    poses, speeds = np.full((count, len(tracks), 3), np.nan), np.full((count, len(tracks)), np.nan)
    sizes = np.zeros((len(tracks), 2))
    for place, track in enumerate(tracks.values()):
        at = np.array([stamp for stamp, _ in track], dtype=np.int64)
        sizes[place] = np.median([(user.length_m, user.width_m) for _, user in track], axis=0)
        xy, heading, speed = _placed([user for _, user in track], frame)
        after = np.searchsorted(at, stamps).clip(0, len(at) - 1)
        before = (np.searchsorted(at, stamps, side="right") - 1).clip(0)
        there = (stamps >= at[0]) & (stamps <= at[-1]) & (at[after] - at[before] <= _SEEN_HOLE_NS)
        columns = (xy[:, 0], xy[:, 1], heading, speed)
        x, y, turned, fast = (np.interp(stamps - at[0], at - at[0], c) for c in columns)
        poses[there, place] = np.column_stack([x, y, turned])[there]
        speeds[there, place] = fast[there]
    return Users(poses, speeds, sizes)
