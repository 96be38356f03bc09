"""How far what is judged may lie from where it seems to: positions, the antenna's place, the map.

A measured value fails for sure where it lies beyond its limit by more than its expanded
uncertainty: guarded rejection, JCGM 106:2012, 8.3.3, with the factors of the GUM (JCGM 100:2008).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import StopLine, World
from foretwin.sim_worker.analysis.agreement.window import Window
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.road_edges import edge_doubt, is_exact
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.world_gen.driven.matching import MAP_ERROR_M

COVERAGE = 2.0
"""Standard deviations that hold 95 of 100: GUM, 6.3.3."""
STOP_LINE_M = 7.91
"""How far a stop line that no sign in the map places lies from the painted one, in 95 of 100. Of 57
approaches of HD maps: "stop line beyond" of `python -m tests.world_gen.truth`, all of them."""
_ANTENNAS = 5
_SHARE = 0.95
"""Of a car's length, in which its antenna is taken to be."""
_STD_STEP_M = 0.1


class PlaceDoubt(NamedTuple):
    """What is not known of where a car is: standard deviations beside its way, and how far
    base_link may lie ahead of where it is taken to be, (K,), 0 first."""

    position_std_m: float
    across_std_m: float
    ahead_m: Array


def place_doubt(window: Window, vehicle: VehicleParameters) -> PlaceDoubt:
    """Return what a window's source leaves open; infinite where it states no error.

    Errors of positions are rounded up to `_STD_STEP_M`, so that windows share their ground.
    """
    std_m = math.inf if window.position_std_m is None else window.position_std_m
    rounded = math.ceil(std_m / _STD_STEP_M) * _STD_STEP_M if math.isfinite(std_m) else std_m
    if window.antenna_known:
        return PlaceDoubt(rounded, 0.0, np.zeros(1))
    # Anywhere on the roof: evenly distributed, of which the standard deviation is 1 / √12.
    reach_m = _SHARE * vehicle.length_m.value / 2.0
    ahead = np.linspace(-reach_m, reach_m, _ANTENNAS) - box_centre_from_base_m(vehicle)
    return PlaceDoubt(
        rounded, vehicle.width_m.value / math.sqrt(12.0), np.concatenate([[0.0], ahead])
    )


class WorldDoubt:
    """A World's ground as drawn and as far as it may go on, for all windows in it."""

    def __init__(self, world: World) -> None:
        self.exact = is_exact(world)
        self.drawn = DrivableGround(world)
        self._world, self._edges = world, edge_doubt(world)
        self._grounds: dict[tuple[float, float], DrivableGround] = {}
        self._tagged_lines = {line.id for line in world.stop_lines if _is_at_sign(line)}

    def ground_at_most(self, place: PlaceDoubt) -> DrivableGround:
        """Return the ground beyond which a car is for sure off the road."""
        key = place.position_std_m, place.across_std_m
        if key not in self._grounds:
            square = np.square(self._edges.place_std_m) + key[0] ** 2 + key[1] ** 2
            wider = np.sqrt(np.square(self._edges.edge_m) + COVERAGE**2 * square)
            self._grounds[key] = DrivableGround(self._world, wider_m=wider)
        return self._grounds[key]

    def line_ahead_m(self, line_id: str, place: PlaceDoubt) -> tuple[float, ...]:
        """Return how far a front may be ahead of where it seems to be at a stop line: as it seems,
        least, most."""
        map_m = 0.0 if self.exact else COVERAGE * MAP_ERROR_M
        drawn_m = 0.0 if self.exact or line_id in self._tagged_lines else STOP_LINE_M
        either_m = math.hypot(map_m, drawn_m, COVERAGE * place.position_std_m)
        ahead = place.ahead_m[1:] if len(place.ahead_m) > 1 else place.ahead_m
        return 0.0, float(ahead.min()) - either_m, float(ahead.max()) + either_m


def _is_at_sign(line: StopLine) -> bool:
    return line.connection_id is not None
