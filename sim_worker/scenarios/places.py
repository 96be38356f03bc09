"""What a placement says: where a scenario takes place, or why it does not."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.contracts.world import DrivingSide
from foretwin.sim_worker.scenarios.walls import Walls
from foretwin.sim_worker.scenarios.ways import Way, near_sign


class ScenarioPlace(NamedTuple):
    """Where a scenario can take place: the ego's way, and by which ways the others may come.

    `actor_ways` has one entry for each actor of the scenario: the ways it may take, the likeliest
    first; none for those who move along the ego's own path.
    """

    scenario_id: str
    junction_id: str
    name: str
    """The connections that the ego takes and, after a `/`, those of the first other road user."""
    driving_side: DrivingSide
    ego: Way
    actor_ways: tuple[tuple[Way, ...], ...]
    reverse: bool = False
    """The ego drives its way backwards."""
    walls: Walls | None = None
    """Where those who come on foot or by bicycle cannot come from."""
    road_classes: tuple[str, ...] = ()
    """Of the roads by which the ego comes and leaves, as the map has them."""
    edges_m: tuple[float, float] = (10.0, -10.0)
    """How far left and, negative, right of the ego's way the road reaches where it comes from."""

    def way_named(self, name: str) -> Way:
        """Return the way of that name, the ego's for those who move along it."""
        ways = (way for options in self.actor_ways for way in options if way.name == name)
        return next(ways, self.ego)

    @property
    def near_sign(self) -> float:
        """Return +1 where the near side is the right one, else -1."""
        return near_sign(self.driving_side)


class Unplaced(NamedTuple):
    """Why a scenario does not take place at a junction.

    `applies` is false where the junction is none that the scenario is for.
    """

    junction_id: str
    reason: str
    applies: bool
