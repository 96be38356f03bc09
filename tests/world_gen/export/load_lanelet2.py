"""Runs in the judges' interpreter, which has lanelet2: load maps and ask for their routes.

Reads from standard input a JSON list of maps, each with `path`, `lat`, `lon`, `connections`
(connection, from-lane, to-lane), `successions` (lane, next lane), `waits` (connection that waits,
connection that goes first), `lights` (connection, its group) and `positions` (World's id of a
lane, x, y of its left border's first point); writes a JSON object of what it found for each.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from typing import Any

import lanelet2
from lanelet2.projection import LocalCartesianProjector, UtmProjector


def main() -> None:
    json.dump({task["path"]: judged(task) for task in json.load(sys.stdin)}, sys.stdout)


def judged(task: dict[str, Any]) -> dict[str, Any]:
    origin = lanelet2.io.Origin(task["lat"], task["lon"])
    utm_errors = lanelet2.io.loadRobust(task["path"], UtmProjector(origin))[1]
    found, errors = lanelet2.io.loadRobust(task["path"], LocalCartesianProjector(origin))
    lanelets = {ll.attributes["foretwin:id"]: ll for ll in found.laneletLayer}
    graphs = {who: graph_for(found, who) for who in ("vehicle", "vehicle:bus", "bicycle")}
    missing, strays = [], []
    for via, start, end in task["connections"]:
        if not any(leads(graph, lanelets, start, via, end) for graph in graphs.values()):
            missing.append(via)
    for start, end in task["successions"]:
        if not any(follows(graph, lanelets, start, end) for graph in graphs.values()):
            missing.append(f"{start} -> {end}")
    known = {(a, b) for a, b in task["successions"]}
    known |= {pair for via, a, b in task["connections"] for pair in ((a, via), (via, b))}
    for name, lanelet in lanelets.items():
        for graph in graphs.values():
            nexts = {ll.attributes["foretwin:id"] for ll in graph.following(lanelet)}
            strays.extend(f"{name} -> {other}" for other in nexts if (name, other) not in known)
    off_m = 0.0
    for name, x, y in task["positions"]:
        point = lanelets[name].leftBound[0]
        off_m = max(off_m, abs(point.x - x), abs(point.y - y))
    faults = [f for graph in graphs.values() for f in graph.checkValidity(False)]
    return {
        "errors": list(errors) + list(utm_errors),
        "lanelets": Counter(ll.attributes["subtype"] for ll in found.laneletLayer),
        "areas": len(found.areaLayer),
        "rules": Counter(r.attributes["subtype"] for r in found.regulatoryElementLayer),
        "missing_routes": missing,
        "stray_routes": strays,
        "other_waits": sorted(waits_of(lanelets) ^ {(a, b) for a, b in task["waits"]}),
        "other_lights": [
            [name, group]
            for name, group in task["lights"]
            if group not in groups_of(lanelets[name])
        ],
        "off_m": off_m,
        "graph_faults": faults,
        "speeds": {
            name: graphs["vehicle"] and rules_for("vehicle").speedLimit(ll).speedLimitKmH
            for name, ll in lanelets.items()
            if "speed_limit" in ll.attributes
        },
    }


def groups_of(lanelet: Any) -> set[str]:
    return {rule.attributes["foretwin:group"] for rule in lanelet.trafficLights()}


def waits_of(lanelets: dict[str, Any]) -> set[tuple[str, str]]:
    """Return who waits for whom, as each of both says of itself."""
    found = set()
    maneuver = lanelet2.core.ManeuverType
    for name, lanelet in lanelets.items():
        for rule in lanelet.rightOfWay():
            if rule.getManeuver(lanelet) != maneuver.Yield:
                continue
            for other in rule.rightOfWayLanelets():
                if rule.getManeuver(other) == maneuver.RightOfWay:
                    found.add((name, other.attributes["foretwin:id"]))
    return found


def rules_for(who: str) -> Any:
    return lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany, who)


def graph_for(found: Any, who: str) -> Any:
    return lanelet2.routing.RoutingGraph(found, rules_for(who))


def follows(graph: Any, lanelets: dict[str, Any], start: str, end: str) -> bool:
    return lanelets[end].id in {ll.id for ll in graph.following(lanelets[start])}


def leads(graph: Any, lanelets: dict[str, Any], start: str, via: str, end: str) -> bool:
    if via not in lanelets:
        return False
    if not (follows(graph, lanelets, start, via) and follows(graph, lanelets, via, end)):
        return False
    return graph.getRoute(lanelets[start], lanelets[end], 0) is not None


if __name__ == "__main__":
    main()
