"""Which junctions the car has passed: each passage once, and a second passage as a second one."""

from __future__ import annotations

from foretwin.orchestrator.routing.junctions_ahead import PassedJunction, same_passage_m
from foretwin.world_gen.junctions.intersections import Junction

_KEPT_M = 1000.0
"""Passages farther back are forgotten; a route keeps far less of the road driven."""


class Passages:
    """The stretches of the way that were driven through junctions lately.

    A route that changes, or loses its past, moves a junction's first node, its last and so its
    centre. It is the same passage as long as the stretches overlap, or nearly so.
    """

    def __init__(self) -> None:
        self._driven: dict[str, list[tuple[float, float]]] = {}

    def __contains__(self, met: PassedJunction) -> bool:
        return self._has(met.junction, met.from_m, met.to_m)

    def has_near(self, junction: Junction, s_m: float) -> bool:
        """Return whether a position is so near to a passage of a junction that it belongs to it."""
        return self._has(junction, s_m, s_m)

    def add(self, met: PassedJunction, *, driven_to_m: float) -> None:
        """Keep a passage up to where the car is, with what is known of the same one."""
        first_m, last_m = met.from_m, min(met.to_m, driven_to_m)
        others = []
        for from_m, to_m in self._driven.get(met.junction.summary.id, ()):
            if max(from_m - last_m, first_m - to_m) <= same_passage_m(met.junction):
                first_m, last_m = min(first_m, from_m), max(last_m, to_m)
            elif to_m > driven_to_m - _KEPT_M:
                others.append((from_m, to_m))
        self._driven[met.junction.summary.id] = [*others, (first_m, last_m)]

    def _has(self, junction: Junction, first_m: float, last_m: float) -> bool:
        return any(
            max(from_m - last_m, first_m - to_m) <= same_passage_m(junction)
            for from_m, to_m in self._driven.get(junction.summary.id, ())
        )
