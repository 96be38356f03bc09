"""Scenarios around a car as it drives: cases cast beforehand, timed to where the car is now.

Where two paths meet does not change while a car approaches; only when it gets there does. So a
case is cast once for each place, and for each new state all that come from elsewhere are moved
along their ways by the time that the car is early or late.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import LEAST_START_MPS
from foretwin.sim_worker.road_users.cast import Player
from foretwin.sim_worker.scenarios.casting import cast
from foretwin.sim_worker.scenarios.meeting import LEAST_TIME_S
from foretwin.sim_worker.scenarios.placement import passage_on_path, places_on_passage
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.roads import Passage, RoadNetwork
from foretwin.sim_worker.scenarios.roles import ALONG, StagedActor, StagedCase
from foretwin.sim_worker.scenarios.staged import player_on
from foretwin.sim_worker.scenarios.ways import Way

_LATE = ".arrives_after_s"


class LiveScenarios:
    """The scenarios of one World; keeps what was placed and cast before."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._places: dict[tuple[Scenario, str], tuple[ScenarioPlace, ...]] = {}
        self._casts: dict[tuple[object, ...], StagedCase | Unplaced] = {}

    def on(self, path: FrenetPath, from_arc_m: float, vehicle: VehicleParameters) -> PathScenarios:
        """Return the scenarios on a path, for a car at `from_arc_m` of it."""
        found = passage_on_path(self._network, path, from_arc_m)
        return PathScenarios(self, path, vehicle, found)

    def places(self, scenario: Scenario, passage: Passage) -> tuple[ScenarioPlace, ...]:
        """Return where a scenario can take place on a passage, none where it does not apply."""
        key = (scenario, passage.name)
        if key not in self._places:
            self._places[key] = places_on_passage(scenario, self._network, passage)
        return self._places[key]

    def cast(
        self,
        scenario: Scenario,
        values: Mapping[str, float],
        place: ScenarioPlace,
        vehicle: VehicleParameters,
    ) -> StagedCase | Unplaced:
        """Return a case at a place with nobody early or late, as if it began there."""
        punctual = {name: 0.0 if name.endswith(_LATE) else v for name, v in values.items()}
        key = (scenario, place.name, vehicle, *punctual.items())
        if key not in self._casts:
            self._casts[key] = cast(scenario, punctual, place, vehicle=vehicle)
        return self._casts[key]


class PathScenarios(NamedTuple):
    """The scenarios of a World on one path; `passage` is the junction that it takes next."""

    known: LiveScenarios
    path: FrenetPath
    vehicle: VehicleParameters
    passage: Passage | None

    def players(
        self,
        scenario: Scenario,
        values: Mapping[str, float],
        *,
        place_rank: int,
        ego_arc_m: float,
        ego_speed_mps: float,
    ) -> tuple[Player, ...] | Unplaced:
        """Return the road users of a case around a car at `ego_arc_m` of the path.

        Those who come from elsewhere are where they meet a car that keeps its speed, early or late
        as `values` says. Says why where the case cannot be played, or is behind the car already.
        """
        if self.passage is None:
            return Unplaced("", "the path leads through no junction of the World ahead", False)
        places = self.known.places(scenario, self.passage)
        junction = self.passage.junction_id
        if not places:
            return Unplaced(junction, "the scenario does not apply on this path", False)
        place = places[place_rank % len(places)]
        played = self.known.cast(scenario, values, place, self.vehicle)
        if isinstance(played, Unplaced):
            return played
        speed = max(ego_speed_mps, LEAST_START_MPS)
        later_s = 0.0
        if math.isfinite(played.impact_time_s):
            met = played.ego_arc_m + played.ego_speed_mps * played.impact_time_s
            meets = place.ego.path.point_at(np.array([met]), played.ego_lateral_m)
            there_s = (float(self.path.locate(meets).arc_m[0]) - ego_arc_m) / speed
            if there_s < LEAST_TIME_S:
                return Unplaced(junction, "the place of the impact is behind the car", True)
            later_s = there_s - played.impact_time_s
        return tuple(
            self._beside(actor, played, place, ego_arc_m)
            if actor.relation in ALONG
            else _coming(
                actor, place.way_named(actor.way), later_s + values[f"{actor.name}{_LATE}"]
            )
            for actor in played.actors
        )

    def _beside(
        self, actor: StagedActor, played: StagedCase, place: ScenarioPlace, ego_arc_m: float
    ) -> Player:
        """Return who moves along the ego's path; what is parked stays where it stands."""
        arc = actor.start_on(place.ego)
        if actor.relation == "parked":
            stands = place.ego.path.point_at(np.array([arc]))
            arc = float(self.path.locate(stands).arc_m[0])
        else:
            arc += ego_arc_m - played.ego_arc_m
        return player_on(actor, self.path, arc)


def _coming(actor: StagedActor, way: Way, later_s: float) -> Player:
    return player_on(actor, way.path, actor.start_on(way) - actor.speed_mps * later_s)
