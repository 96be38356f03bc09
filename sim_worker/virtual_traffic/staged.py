"""A scenario of the catalogue as going traffic: who crosses the car's way does so as the car comes.

Those who drive come from out of sight and hold themselves ready until shortly before (as
SynchronizeAction of ASAM OpenSCENARIO); those on foot wait at the roadside and step out in time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind, SignalColour
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import BEND_DECEL_MPS2, HEEDLESS_BRISKNESS
from foretwin.sim_worker.road_users.paces import square_bound
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.live import KnownScenarios
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.roles import ALONG, StagedActor, StagedCase
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from foretwin.sim_worker.virtual_traffic.source import STEP_S, VirtualUser

_LEAST_AHEAD_M = 25.0
"""Nothing begins for a place that is nearer."""
_WAITS_BACK_S = 3.0
"""So long before the place of meeting who walks waits beside the road."""
_COMES_BACK_S = 14.0
"""At most so long before it who drives begins."""
_COMMITS_S = 2.0
"""Before the meeting: from then on nobody is timed to the car any more."""
_SHARES = 0.4, 1.4
"""Of its own speed, what who drives may be slower and faster to be there in time."""
_DECEL_MPS2, _WALK_ACCEL_MPS2 = 3.0, 1.5
_SLOWEST_MPS = 1.0
"""A car that stands is taken to drive so fast: it is far away in time."""
_WALKS_ON_M, _GONE_M, _PASSED_M = 15.0, 60.0, 20.0
"""Beyond the meeting who walked stops; once the car is past it by so much, they go where they are
so far away."""
_TRY_EVERY = 10
_MOST_CASES = 16


@dataclass(slots=True)
class _Performer:
    """An actor on its way; `meets_m` is where on it the car is met, NaN for who stands."""

    name: str
    kind: RoadUserKind
    line_m: Array
    path: FrenetPath
    lateral_m: float
    own_mps: float
    meets_m: float
    arc_m: float
    speed_mps: float = 0.0
    gone_off: bool = False

    def step(self, eta_s: float) -> None:
        """Move on; the car is at the place of meeting in `eta_s`."""
        if math.isnan(self.meets_m):
            return
        left_m, traits = self.meets_m - self.arc_m, KINDS[self.kind]
        if traits.keeps_lane:
            accel = min(traits.accel_mps2, 2.0)
            want = self.own_mps
            if eta_s > _COMMITS_S and left_m > 0.0:
                least, most = (share * self.own_mps for share in _SHARES)
                want = min(max(left_m / eta_s, least), most)
            bound = square_bound(self.path, decel_mps2=BEND_DECEL_MPS2)
            allowed = HEEDLESS_BRISKNESS * self.path.at_nodes(bound, np.array([self.arc_m]))
            want = min(want, float(np.sqrt(allowed[0])))
        else:
            accel = _WALK_ACCEL_MPS2
            needs_s = left_m / self.own_mps + self.own_mps / (2.0 * accel)
            self.gone_off = self.gone_off or eta_s <= needs_s
            want = self.own_mps if self.gone_off and left_m > -_WALKS_ON_M else 0.0
        before = self.speed_mps
        self.speed_mps += min(max(want - before, -_DECEL_MPS2 * STEP_S), accel * STEP_S)
        self.arc_m += 0.5 * (before + self.speed_mps) * STEP_S

    def user(self) -> VirtualUser:
        """Return it as it is now."""
        pose = self.path.pose_at(np.array([self.arc_m]), self.lateral_m)
        (x, y), yaw, traits = pose.xy_m[0].tolist(), float(pose.yaw_rad[0]), KINDS[self.kind]
        size = traits.length_m, traits.width_m
        return VirtualUser(self.name, self.kind, x, y, yaw, self.speed_mps, *size)


class ScenarioTraffic:
    """Plays a scenario at each junction on the car's way that it is for; see TrafficSource."""

    def __init__(self, vehicle: VehicleParameters, scenario: Scenario, *, seed: int) -> None:
        """Raises UserError for a scenario whose actors go along with the car."""
        check_going(scenario)
        self._vehicle, self._scenario = vehicle, scenario
        self._cases = draw_cases(scenario, seed=seed)[:_MOST_CASES]
        self._known: KnownScenarios | None = None
        self.frame: LocalFrame | None = None
        self._world_id = ""
        self._path: FrenetPath | None = None
        self._played: set[tuple[str, str]] = set()
        self._performers: list[_Performer] = []
        self._meets_xy = np.zeros(2)
        self._steps = self._staged = 0

    def use_world(self, world: World) -> None:
        """Go on in another World, in its frame."""
        if self.frame is not None:
            self._meets_xy = target_from_source_m(world.frame, self.frame, self._meets_xy[None])[0]
            for one in self._performers:
                one.line_m = target_from_source_m(world.frame, self.frame, one.line_m)
                one.path = FrenetPath(one.line_m).eased
        self._known, self._path = KnownScenarios(RoadNetwork(world)), None
        self.frame, self._world_id = world.frame, world.id

    def use_path(self, xy_m: Array) -> None:
        """Take where the car will drive."""
        self._path = FrenetPath(xy_m)

    def step(
        self, car: Array, *, time_s: float, colours: Mapping[str, SignalColour]
    ) -> tuple[VirtualUser, ...]:
        """Move on; see TrafficSource."""
        path = self._path
        if path is not None:
            arc_m, speed = float(path.locate(car[None, :2]).arc_m[0]), float(car[3])
            if not self._performers and self._steps % _TRY_EVERY == 0:
                self._stage(path, arc_m, speed)
            ahead_m = float(path.locate(self._meets_xy[None]).arc_m[0]) - arc_m
            eta_s = ahead_m / max(speed, _SLOWEST_MPS)
            for one in self._performers:
                one.step(eta_s)
            if ahead_m < -_PASSED_M:
                self._performers = [p for p in self._performers if _away_m(p, car) < _GONE_M]
        self._steps += 1
        return tuple(one.user() for one in self._performers)

    def _stage(self, path: FrenetPath, arc_m: float, speed_mps: float) -> None:
        """Let the scenario begin at the next junction, once, if it is for it."""
        known = self._known
        assert known is not None
        passage = known.on(path, arc_m, self._vehicle).passage
        if passage is None or (self._world_id, passage.name) in self._played:
            return
        for place in known.places(self._scenario, passage):
            for played in known.cast(self._scenario, self._cases, place, self._vehicle):
                if not isinstance(played, StagedCase) or not math.isfinite(played.meets_s):
                    continue
                met = np.array([played.ego_arc_m + played.ego_speed_mps * played.meets_s])
                meets = place.ego.path.point_at(met, played.ego_lateral_m)
                ahead_m = float(path.locate(meets).arc_m[0]) - arc_m
                if ahead_m < _LEAST_AHEAD_M:
                    return
                self._played.add((self._world_id, passage.name))
                self._staged += 1
                self._meets_xy = meets[0]
                eta_s = ahead_m / max(speed_mps, _SLOWEST_MPS)
                self._performers = [self._begun(one, played, eta_s) for one in played.actors]
                return

    def _begun(self, actor: StagedActor, played: StagedCase, eta_s: float) -> _Performer:
        way = played.place.way_named(actor.way)
        start_m, moving = actor.start_on(way), actor.moving(way.path)
        name = f"virtual-{self._staged}-{actor.name}"
        path = way.path.eased
        if actor.relation in ALONG:
            return _Performer(
                name, actor.kind, way.xy_m, path, actor.lateral_m, 0.0, math.nan, start_m
            )
        meets_m = float(moving.arc_after(start_m, played.meets_s))
        walks = not actor.traits.keeps_lane
        back_s = _WAITS_BACK_S if walks else min(eta_s, _COMES_BACK_S)
        arc_m = float(moving.arc_after(meets_m, -back_s))
        speed = 0.0
        if not walks:
            bound = square_bound(path, decel_mps2=BEND_DECEL_MPS2)
            there = float(path.at_nodes(bound, np.array([arc_m]))[0])
            speed = min(actor.speed_mps, math.sqrt(HEEDLESS_BRISKNESS * there))
        return _Performer(
            name, actor.kind, way.xy_m, path, actor.lateral_m, actor.speed_mps, meets_m, arc_m,
            speed,
        )  # fmt: skip


def check_going(scenario: Scenario) -> None:
    """Raise UserError where a scenario cannot be played as traffic that goes on."""
    for part in scenario.actors:
        if scenario.where.setting != "junction" or (
            part.relation in ALONG and part.relation != "parked"
        ):
            raise UserError(
                f"virtual_traffic: scenario {scenario.id}: {part.name} is {part.relation} of the "
                "car; played as going traffic can be those of junctions whose actors cross the "
                "car's way, such as cpta, or are parked"
            )


def _away_m(one: _Performer, car: Array) -> float:
    return float(np.hypot(*(one.path.point_at(np.array([one.arc_m]))[0] - car[:2])))
