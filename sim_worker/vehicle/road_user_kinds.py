"""Sizes, masses and limits of the kinds of road users."""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.road_user_heights import HEIGHT_M

_SUMO = "Eclipse SUMO 1.28, defaults of vClass"
_TARGETS = "Euro NCAP articulated target"


class KindTraits(NamedTuple):
    """What is typical of a kind of road user, with whoever rides it.

    `length_m`, `width_m` and `height_m` of its box; `accel_mps2` and `decel_mps2` are those of
    ordinary driving, `hard_decel_mps2` of an emergency; `speed_mps` is what it does not exceed.
    `keeps_lane` is false for those who walk.
    """

    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    accel_mps2: float
    decel_mps2: float
    hard_decel_mps2: float
    speed_mps: float
    source: str
    keeps_lane: bool = True

    def limit_mps(self, posted_mps: float) -> float:
        """Return the limit of which it wants a share; not finite where none is known.

        A cyclist does not drive at a share of a limit that is set for cars.
        """
        return min(posted_mps, self.speed_mps) if math.isfinite(posted_mps) else posted_mps


_SIZES_AND_LIMITS: dict[RoadUserKind, tuple[float, ...]] = {
    "car": (4.5, 1.8, 1500.0, 2.6, 4.5, 9.0, 55.6),
    "van": (6.0, 2.04, 2800.0, 2.6, 4.5, 9.0, 44.4),
    "lorry": (7.1, 2.4, 9000.0, 1.3, 4.0, 7.0, 36.1),
    "bus": (12.0, 2.5, 12000.0, 1.2, 4.0, 7.0, 27.8),
    "tram": (22.0, 2.4, 37900.0, 1.0, 3.0, 7.0, 22.2),
    "motorcycle": (2.2, 0.9, 280.0, 6.0, 4.5, 9.0, 55.6),
    "bicycle": (1.89, 0.5, 95.0, 1.2, 3.0, 7.0, 8.3),
    "pedestrian": (0.5, 0.5, 75.0, 1.5, 2.0, 5.0, 3.0),
    "unknown": (4.5, 1.8, 1500.0, 2.6, 4.5, 9.0, 55.6),
}
"""In the order of `KindTraits`, but for heights."""
_SOURCES = {
    "car": f"{_SUMO} passenger; 4.5 m long, as compact cars are",
    "van": "Volkswagen Crafter, medium wheelbase, rounded and half laden; "
    f"limits of {_SUMO} delivery",
    "lorry": f"{_SUMO} truck, laden with as much again",
    "bus": f"{_SUMO} bus",
    "tram": f"{_SUMO} tram",
    "motorcycle": f"{_SUMO} motorcycle with a rider of 80 kg, who brakes as car drivers do",
    "bicycle": f"{_TARGETS}, bicyclist (rounded); {_SUMO} bicycle with 80 kg of rider and 15 of "
    "bicycle",
    "pedestrian": f"{_TARGETS}, adult (rounded, with its stride); {_SUMO} pedestrian; running at "
    "3 m/s",
    "unknown": "taken for a car: the most frequent",
}
KINDS: dict[RoadUserKind, KindTraits] = {
    kind: KindTraits._make(
        [*numbers[:2], HEIGHT_M[kind], *numbers[2:], _SOURCES[kind], kind != "pedestrian"]
    )
    for kind, numbers in _SIZES_AND_LIMITS.items()
}
