"""Places away from junctions: motorways, open roads, race tracks, and bays beside a road."""

from __future__ import annotations

from contracts.scenario import Scenario
from sim_worker.planners.path import FrenetPath
from sim_worker.scenarios.places import Place
from sim_worker.scenarios.roads import RoadNetwork

_LEAST_M = {"motorway": 150.0, "road": 60.0, "circuit": 200.0, "parking_bay": 30.0}
_CLASSES = {
    "motorway": ("motorway", "trunk"),
    "circuit": ("raceway",),
}
_TWO_LANES = ("motorway",)


def other_places(
    scenario: Scenario,
    network: RoadNetwork,
    *,
    ego_path: FrenetPath | None = None,
    ego_arc_m: float = 0.0,
) -> tuple[list[Place], str]:
    """Return the places of a scenario that needs no junction, or else why there are none."""
    return [], "not yet"
