"""Scenarios away from any drive: cases at named places, whose egos start where they are cast.

Where a live car is wherever it is, here the case says where everybody begins. Places are named, as
a placement names them, so that a case can be written down and staged again anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.road_users.cast import Player
from foretwin.sim_worker.scenarios.beyond_junctions import other_places
from foretwin.sim_worker.scenarios.casting import cast_all
from foretwin.sim_worker.scenarios.placement import places_on_passage
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.roles import StagedActor, StagedCase
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.sim_worker.vehicle.seeding import kinematic_tire_angle, rear_slip_velocity

_Case = tuple[object, ...]


class StagedScenarios:
    """The scenarios of one World by the names of their places; keeps what was cast before."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._places: dict[tuple[str, str], ScenarioPlace | None] = {}
        self._casts: dict[_Case, StagedCase | Unplaced] = {}
        self._ways: dict[int, Way | None] = {}
        """Those that cases were cast on: as long as they are kept, no other has their identity."""

    def place(self, scenario: Scenario, name: str) -> ScenarioPlace | None:
        """Return the place of that name, None where the scenario has none so named."""
        key = (scenario.id, name)
        if key not in self._places:
            self._places[key] = _named(scenario, self._network, name)
        return self._places[key]

    def cast(
        self,
        scenario: Scenario,
        cases: Sequence[Mapping[str, float]],
        place_name: str,
        vehicle: VehicleParameters,
        *,
        ego_way: Way | None = None,
        ego_arc_m: float | None = None,
    ) -> tuple[StagedCase | Unplaced, ...]:
        """Return cases of a scenario at a place, each begun where the case has the ego begin.

        `ego_way` is the line that the ego really drives, in place of the place's own; with
        `ego_arc_m` it starts there, and not where the case says.
        """
        place = self.place(scenario, place_name)
        if place is None:
            own = self._network.world.intersection.id
            reason = f"the World has no place {place_name!r} for {scenario.id}"
            return tuple(Unplaced(own, reason, True) for _ in cases)
        if ego_way is not None:
            place = place._replace(ego=ego_way)
        times = (scenario.lead_time_s, scenario.horizon_s)
        common = (id(ego_way), ego_arc_m, scenario.id, *times, place.name, vehicle.name)
        keys = [(*common, *values.items()) for values in cases]
        new = {key: dict(c) for key, c in zip(keys, cases, strict=True) if key not in self._casts}
        played = cast_all(
            scenario, tuple(new.values()), place, vehicle=vehicle, ego_arc_m=ego_arc_m
        )
        self._casts.update(zip(new, played, strict=True))
        self._ways[id(ego_way)] = ego_way
        return tuple(self._casts[key] for key in keys)


def _named(scenario: Scenario, network: RoadNetwork, name: str) -> ScenarioPlace | None:
    if scenario.where.setting != "junction":
        found, _ = other_places(scenario, network)
        return next((place for place in found if place.name == name), None)
    for junction in network.world.junctions:
        for passage in network.passages(junction.summary.id):
            if passage.name != name.split("/")[0]:
                continue
            for place in places_on_passage(scenario, network, passage):
                if place.name == name:
                    return place
    return None


def staged_players(played: StagedCase, path: FrenetPath) -> tuple[Player, ...]:
    """Return the road users of a case; `path` is the ego's way, shared by all that go along it."""
    ego = played.place.ego
    players = []
    for actor in played.actors:
        way = played.place.way_named(actor.way)
        players.append(player_on(actor, path if way is ego else way.path, actor.start_on(way)))
    return tuple(players)


def player_on(actor: StagedActor, path: FrenetPath, start_arc_m: float) -> Player:
    """Return an actor of a case as one that starts at `start_arc_m` of a path."""
    return Player(
        name=actor.name,
        kind=actor.kind,
        path=path,
        start_arc_m=start_arc_m,
        speed_mps=actor.speed_mps,
        conduct=actor.conduct,
        lateral_m=actor.lateral_m,
        acts_after_s=actor.acts_after_s,
        decel_mps2=actor.decel_mps2,
        hidden_by=actor.hidden_by,
    )


def staged_start(played: StagedCase, vehicle: VehicleParameters) -> Array:
    """Return (8,) the ego's state as a case begins: in steady motion along its path.

    Backwards it moves against its heading.
    """
    path, arc = played.place.ego.path, np.array([played.ego_arc_m])
    pose = path.pose_at(arc, played.ego_lateral_m)
    yaw, speed = float(pose.yaw_rad[0]), played.ego_speed_mps
    yaw_rate = float(path.at_nodes(path.curvature_pm, arc)[0]) * speed
    if played.place.reverse:
        yaw, speed, yaw_rate = yaw + np.pi, -speed, yaw_rate
    slip = rear_slip_velocity(vehicle, speed, yaw_rate)
    angle = kinematic_tire_angle(vehicle, speed, yaw_rate)
    return np.array([*pose.xy_m[0], yaw, speed, slip, yaw_rate, angle, 0.0])
