"""Where scenarios could take place: on the junctions and roads of any World."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import IntersectionSummary
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import headings_rad
from foretwin.sim_worker.scenarios.beyond_junctions import other_places, place_in
from foretwin.sim_worker.scenarios.places import ScenarioPlace
from foretwin.sim_worker.scenarios.relations import ways_of
from foretwin.sim_worker.scenarios.roads import Passage, RoadNetwork
from foretwin.sim_worker.scenarios.roles import ALONG
from foretwin.sim_worker.scenarios.ways import unlike_its_turn

_ON_CONNECTION_M = 3.0
"""Who drives no farther on average from a connection's middle takes it."""
_HEADS_ALIKE_RAD = math.radians(35.0)
_SAMPLES = 9
_NEAR_PATH_M = 60.0
_BEHIND_PATH_M = 15.0


Candidates = tuple[str, Iterator[ScenarioPlace], str]
"""A junction, its places for a scenario, and why there is none if so."""


def candidates(scenario: Scenario, network: RoadNetwork) -> Iterator[Candidates]:
    """Yield where relations and roads let a scenario take place: on the World's own junction, in a
    region on all. Whether it can be played there is asked by `futures.playable`."""
    own = network.world.intersection
    if scenario.where.setting != "junction":
        yield (own.id, *other_places(scenario, network))
        return
    for junction in network.world.junctions:
        if own.kind == "region" or junction.summary.id == own.id:
            yield (junction.summary.id, *_at_junction(scenario, network, junction.summary))


def _at_junction(
    scenario: Scenario, network: RoadNetwork, junction: IntersectionSummary
) -> tuple[Iterator[ScenarioPlace], str]:
    if refused := _refused(scenario, junction):
        return iter(()), refused
    passages = [p for p in network.passages(junction.id) if p.turn == scenario.ego.turn]
    passages.sort(key=lambda p: unlike_its_turn(p.turn, p.exit_heading_rad - p.entry_heading_rad))
    if any(part.relation == "parked" for part in scenario.actors):
        passages.sort(key=network.lanes_to_kerb)
    if not passages:
        return iter(()), f"no way through it for an ego that {_TURNS[scenario.ego.turn]}"
    found = (place for passage in passages for place in _places_of(scenario, network, passage))
    return found, _no_way_reason(scenario)


_TURNS = {"straight": "goes straight on", "across": "turns across", "near": "turns near"}


def _refused(scenario: Scenario, summary: IntersectionSummary) -> str:
    where = scenario.where
    if where.kinds and summary.kind not in where.kinds:
        return f"its kind is {summary.kind}"
    if where.controls and summary.control not in where.controls:
        return f"its control is {summary.control}"
    return ""


def _no_way_reason(scenario: Scenario) -> str:
    parts = [a for a in scenario.actors if a.relation not in ALONG]
    what = " and ".join(
        f"{part.relation.replace('_', ' ')} {part.turn}".replace(" straight", " straight on")
        for part in parts
    )
    return f"nobody can come {what} and meet the ego's path"


def _places_of(
    scenario: Scenario, network: RoadNetwork, passage: Passage
) -> Iterator[ScenarioPlace]:
    """Yield a place for each way of the first other road user, with all ways of the rest."""
    ego = network.way(passage)
    ways = [
        () if part.relation in ALONG else tuple(ways_of(part, network, passage, ego))
        for part in scenario.actors
    ]
    needs = [i for i, part in enumerate(scenario.actors) if part.relation not in ALONG]
    if not all(ways[i] for i in needs):
        return
    for way in ways[needs[0]] if needs else (None,):
        chosen = ways.copy()
        if way is not None:
            chosen[needs[0]] = (way,)
        name = passage.name if way is None else f"{passage.name}/{way.name}"
        yield place_in(network, scenario, name, ego, chosen)._replace(
            junction_id=passage.junction_id,
            edges_m=network.edges_beside(passage.connections[0].from_lane_id),
            road_classes=network.classes_of(passage),
        )


def places_on_passage(
    scenario: Scenario, network: RoadNetwork, passage: Passage
) -> tuple[ScenarioPlace, ...]:
    """Return the places of a scenario for an ego that takes a passage; none where it is not for."""
    if scenario.where.setting != "junction":
        return ()
    summary = next(
        j.summary for j in network.world.junctions if j.summary.id == passage.junction_id
    )
    if _refused(scenario, summary):
        return ()
    any_turn = all(part.relation in (*ALONG, "crosses_entry") for part in scenario.actors)
    if passage.turn != scenario.ego.turn and not any_turn:
        return ()
    return tuple(_places_of(scenario, network, passage))


class PassageFinder:
    """Says which passage of a World's junctions a path takes; keeps what it lays beside paths."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        junctions = network.world.junctions
        self._passages = [p for j in junctions for p in network.passages(j.summary.id)]
        ends = [p.connections[0].centerline[-1] for p in self._passages]
        self._ends = shapely.points(np.reshape(ends, (-1, 2)))
        self._lines: dict[int, Array] = {}

    def first_on(self, path: FrenetPath, ego_arc_m: float) -> Passage | None:
        """Return the first passage ahead of a position that the path takes."""
        length = path.length_m
        arcs = np.arange(max(0.0, ego_arc_m - _BEHIND_PATH_M), max(length, ego_arc_m + 1.0), 2.0)
        ahead = shapely.LineString(path.point_at(arcs))
        near = np.flatnonzero(shapely.distance(ahead, self._ends) < _NEAR_PATH_M).tolist()
        found = (_match(self._passages[n], self._line(n), path, ego_arc_m) for n in near)
        best: dict[str, tuple[float, float, Passage]] = {}
        for match in sorted(filter(None, found), key=lambda match: (match[0], match[2].name)):
            best.setdefault(match[2].junction_id, match)
        return min(best.values(), key=lambda match: match[1])[2] if best else None

    def _line(self, number: int) -> Array:
        """Return the line of what a passage's way has between entering and leaving the junction."""
        if number not in self._lines:
            way = self._network.way(self._passages[number])
            places = np.linspace(way.entry_m, way.exit_m, _SAMPLES)
            self._lines[number] = way.path.point_at(places)
        return self._lines[number]


def _match(
    passage: Passage, line: Array, path: FrenetPath, ego_arc_m: float
) -> tuple[float, float, Passage] | None:
    """Return how far a path lies from a passage, and where it enters; None if too far.

    The headings count as metres over half the junction, so that of ways that part late the right
    one wins.
    """
    place = path.locate(line)
    entry, exit_ = float(place.arc_m[0]), float(place.arc_m[-1])
    if exit_ <= max(entry, ego_arc_m + 1.0) or exit_ > path.length_m + 1.0:
        return None
    off = float(np.abs(place.offset_m).mean())
    if off > _ON_CONNECTION_M:
        return None
    turned = np.abs(wrap_angle(headings_rad(line) - path.yaw_at(place.arc_m)))
    if float(turned.mean()) > _HEADS_ALIKE_RAD:
        return None
    score = off + 5.0 * float(turned.mean()) + 2.0 * float(turned[-1])
    return score, entry, passage
