"""The scenarios of a World as jobs play them: at named places, or around a car as it drives.

Places are named, as a placement names them, so that a case can be written down and staged again
anywhere; there the case says where all begin. Live, where two paths meet does not change
while a car approaches; only when it gets there does. So a case is cast once for each place, and for
each new state all that come from elsewhere are moved along their ways by the time that the car is
early or late.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import LEAST_START_MPS
from foretwin.sim_worker.road_users.cast import Player
from foretwin.sim_worker.scenarios.beyond_junctions import other_places
from foretwin.sim_worker.scenarios.casting import cast_all
from foretwin.sim_worker.scenarios.meeting import LEAST_TIME_S
from foretwin.sim_worker.scenarios.placement import PassageFinder, places_on_passage
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.roads import Passage, RoadNetwork
from foretwin.sim_worker.scenarios.roles import ALONG, StagedActor, StagedCase
from foretwin.sim_worker.scenarios.staged import player_on
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.sim_worker.vehicle.reference_points import front_from_base_m

_MOST_CASTS = 5000
_LATE = ".arrives_after_s"


class KnownScenarios:
    """The scenarios of one World; keeps what was placed and cast before."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._places: dict[tuple[Scenario, str], tuple[ScenarioPlace, ...]] = {}
        self._named: dict[tuple[Scenario, str], ScenarioPlace | None] = {}
        self._met_m: dict[tuple[Scenario, str], float] = {}
        self._casts: dict[tuple[object, ...], StagedCase | Unplaced] = {}
        self._ways: dict[int, Way | None] = {}
        """Those that cases were cast on: as long as they are kept, no other has their identity."""

    @functools.cached_property
    def _finder(self) -> PassageFinder:
        return PassageFinder(self._network)

    def on(self, path: FrenetPath, from_arc_m: float, vehicle: VehicleParameters) -> PathScenarios:
        """Return the scenarios on a path, for a car at `from_arc_m` of it."""
        return PathScenarios(self, path, vehicle, self._finder.first_on(path, from_arc_m))

    def way(self, passage: Passage) -> Way:
        """Return the way that takes a passage."""
        return self._network.way(passage)

    def places(self, scenario: Scenario, passage: Passage) -> tuple[ScenarioPlace, ...]:
        """Return where a scenario can take place on a passage, none where it does not apply."""
        key = (scenario, passage.name)
        if key not in self._places:
            self._places[key] = places_on_passage(scenario, self._network, passage)
        return self._places[key]

    def met_m(self, scenario: Scenario, passage: Passage) -> float:
        """Return how far along a passage's way the last place is at which a scenario's road users
        come upon it: infinite where that is wherever the car is, minus infinite where nowhere."""
        key = (scenario, passage.name)
        if key not in self._met_m:
            met = (_come_upon_m(scenario, place) for place in self.places(scenario, passage))
            self._met_m[key] = max(met, default=-math.inf)
        return self._met_m[key]

    def named(self, scenario: Scenario, name: str) -> ScenarioPlace | None:
        """Return the place of that name, None where the scenario has none so named."""
        key = (scenario, name)
        if key not in self._named:
            places = (place for place in self._all_places(scenario, name) if place.name == name)
            self._named[key] = next(places, None)
        return self._named[key]

    def _all_places(self, scenario: Scenario, name: str) -> Iterator[ScenarioPlace]:
        if scenario.where.setting != "junction":
            yield from other_places(scenario, self._network)[0]
            return
        for junction in self._network.world.junctions:
            for passage in self._network.passages(junction.summary.id):
                if passage.name == name.split("/")[0]:
                    yield from self.places(scenario, passage)

    def cast(
        self,
        scenario: Scenario,
        cases: Sequence[Mapping[str, float]],
        place: ScenarioPlace | str,
        vehicle: VehicleParameters,
        *,
        ego_way: Way | None = None,
        ego_arc_m: float | None = None,
    ) -> tuple[StagedCase | Unplaced, ...]:
        """Return cases of a scenario at a place, or one so named, begun where the case begins.

        `ego_way` is the line that the ego really drives, in place of the place's own; with
        `ego_arc_m` it starts there, and not where the case says.
        """
        found = self.named(scenario, place) if isinstance(place, str) else place
        if found is None:
            own = self._network.world.intersection.id
            reason = f"the World has no place {place!r} for {scenario.id}"
            return tuple(Unplaced(own, reason, True) for _ in cases)
        if ego_way is not None:
            found = found._replace(ego=ego_way)
        if len(self._casts) > _MOST_CASTS:
            self._casts.clear()
            self._ways.clear()
        common = (scenario, vehicle, found.name, id(ego_way), ego_arc_m)
        keys = [(*common, *values.items()) for values in cases]
        new = {key: dict(c) for key, c in zip(keys, cases, strict=True) if key not in self._casts}
        played = cast_all(
            scenario, tuple(new.values()), found, vehicle=vehicle, ego_arc_m=ego_arc_m
        )
        self._casts.update(zip(new, played, strict=True))
        self._ways[id(ego_way)] = ego_way
        return tuple(self._casts[key] for key in keys)


class PathScenarios(NamedTuple):
    """The scenarios of a World on one path; `passage` is the junction that it takes next."""

    known: KnownScenarios
    path: FrenetPath
    vehicle: VehicleParameters
    passage: Passage | None

    def ahead(
        self, scenarios: Sequence[Scenario], *, ego_arc_m: float, ego_speed_mps: float
    ) -> tuple[Scenario, ...]:
        """Return those that can take place on the path ahead of a car at `ego_arc_m` of it."""
        if self.passage is None:
            return ()
        way, car = self.known.way(self.passage), self.path.point_at(np.array([ego_arc_m]))
        front_m = front_from_base_m(self.vehicle)
        soon_m = LEAST_TIME_S * max(ego_speed_mps, LEAST_START_MPS)
        past_m = float(way.path.locate(car).arc_m[0]) + front_m + soon_m
        return tuple(s for s in scenarios if self.known.met_m(s, self.passage) > past_m)

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
        as `values` says; who drives ahead of the car does so wherever it is. Says why where the
        case cannot be played, is behind the car already, or has somebody begin where the World has
        no road.
        """
        if self.passage is None:
            return Unplaced("", "the path leads through no junction of the World ahead", False)
        places = self.known.places(scenario, self.passage)
        junction = self.passage.junction_id
        if not places:
            return Unplaced(junction, "the scenario does not apply on this path", False)
        place = places[place_rank % len(places)]
        # Cast on time: who is early or late is moved along its way below.
        punctual = {name: 0.0 if name.endswith(_LATE) else v for name, v in values.items()}
        (played,) = self.known.cast(scenario, [punctual], place, self.vehicle)
        if isinstance(played, Unplaced):
            return played
        speed = max(ego_speed_mps, LEAST_START_MPS)
        later_s = 0.0
        if math.isfinite(played.impact_time_s) and not _met_anywhere(played):
            met = played.ego_arc_m + played.ego_speed_mps * played.impact_time_s
            meets = place.ego.path.point_at(np.array([met]), played.ego_lateral_m)
            there_s = (float(self.path.locate(meets).arc_m[0]) - ego_arc_m) / speed
            if there_s < LEAST_TIME_S:
                return Unplaced(junction, "the place of the impact is behind the car", True)
            later_s = there_s - played.impact_time_s
        players = []
        for actor in played.actors:
            if actor.relation in ALONG:
                players.append(self._beside(actor, played, place, ego_arc_m))
                continue
            way = place.way_named(actor.way)
            player = _coming(actor, way, later_s + values[f"{actor.name}{_LATE}"])
            if not way.first_m <= player.start_arc_m <= way.last_m:
                reason = f"{actor.name} would begin beyond the roads of the World"
                return Unplaced(junction, reason, True)
            players.append(player)
        return tuple(players)

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


def _come_upon_m(scenario: Scenario, place: ScenarioPlace) -> float:
    """Return how far along the ego's way others first come upon it, infinite where none do."""
    ego, met = shapely.LineString(place.ego.xy_m), [math.inf]
    for part, ways in zip(scenario.actors, place.actor_ways, strict=True):
        if part.relation not in ALONG:
            shared = shapely.intersection(ego, [shapely.LineString(way.xy_m) for way in ways])
            points = shapely.points(shapely.get_coordinates(shared))
            met.extend(shapely.line_locate_point(ego, points).tolist())
    return min(met)


def _met_anywhere(played: StagedCase) -> bool:
    """Return whether the planned impact is with one that drives ahead, and not at a place."""
    ahead = (actor.name for actor in played.actors if actor.relation == "ahead")
    return played.impact_with in ahead


def _coming(actor: StagedActor, way: Way, later_s: float) -> Player:
    start = actor.moving(way.path).arc_after(actor.start_on(way), -later_s)
    return player_on(actor, way.path, float(start))
