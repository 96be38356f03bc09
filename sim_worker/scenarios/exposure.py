"""How often what futures play happens: stated priors, each with where it comes from.

Scenarios have the classes of ISO 26262-3:2018, annex B: E1 less than once a year for most drivers,
E2 a few times a year, E3 once a month or more, E4 in almost every drive (as EAST-ADL 2.2 quotes
them, east-adl.info, ExposureClassKind). The standard gives no class to these scenarios; which one
has which is our judgement, for a driver who meets somebody that does not give way, brake or look,
not for a crash. What is assumed says so; docs/progress.md has all of it as a table.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import numpy as np

from foretwin.contracts.future_numbers import changed_numbers
from foretwin.contracts.futures import Future
from foretwin.contracts.numbers import FUTURE_NUMBERS

Exposure = Literal["E1", "E2", "E3", "E4"]

JUNCTIONS_A_YEAR = 10_000.0
"""Passed by a car in a year: 12,320 km (Kraftfahrt-Bundesamt, Verkehr in Kilometern 2023). Assumed:
about half of them in towns, with some two junctions in each kilometre."""
_TIMES_A_YEAR: dict[Exposure, float] = {"E1": 0.5, "E2": 4.0, "E3": 30.0, "E4": 600.0}
"""What stands for a class. Assumed, within the class's bounds; 600 is two drives a day in most
weeks."""

_CLASSES: dict[str, Exposure] = {
    "lead_stopping": "E3",
    "race_track_lap": "E4",
    "reversing_parking": "E4",
    "brake_fault": "E1",
    "gnss_offset": "E1",
    "latency": "E1",
    "lost_detections": "E1",
    "steering_fault": "E1",
}
OTHER_SCENARIOS: Exposure = "E2"
"""Of scenarios that the table does not name, a user's own among them: somebody fails to give way,
which most drivers see a few times a year."""

SLIPPERY, SLIPPERY_BELOW = 0.005, 0.5
WET, WET_BELOW = 0.05, 0.85
"""Parts of all driving on snow or ice, and on wet roads, and the friction below which a road is
one, as a part of a dry road's. Assumed: the middle of E2 (below 1 % of the time) and of E3 (1 to
10 %). Tables of adhesion have asphalt at 0.70 to 0.80 dry, 0.45 to 0.55 wet, packed snow at 0.25 to
0.35 and ice at 0.05 to 0.15 (bohnenkamp.by, tyres): wet is 0.6 to 0.7 of dry, snow half and less.
"""
SHIFT_STD_M = 0.25
"""How far drivers wander across their lane. Assumed: Verster, Roth 2011,
doi.org/10.2147/IJGM.S19639, define what is measured; its size is from memory, 0.18 to 0.20 m for
one driver, with the difference between drivers on top."""
HEEDLESS, HEEDLESS_PLANNER = 0.03, "constant_speed"
"""Of drivers, those who visibly handle a telephone: 3.1 % at any moment of daylight (NHTSA,
National Occupant Protection Use Survey 2022, DOT HS 813 531). Assumed: so many look at nobody."""


def _times_to_part(times_a_year: float) -> float:
    return min(times_a_year / JUNCTIONS_A_YEAR, 1.0)


EXPOSURES: Mapping[Exposure, float] = MappingProxyType(
    {name: _times_to_part(times) for name, times in _TIMES_A_YEAR.items()}
)
"""Of all passages of a junction, the part in which a scenario of each class happens."""


def exposure_of(scenario_id: str) -> Exposure:
    """Return the class of a scenario."""
    return _CLASSES.get(scenario_id, OTHER_SCENARIOS)


def prior(future: Future, *, happens: bool, mixed_planners: bool) -> float:
    """Return how likely it is that what distinguishes a future comes to pass, its speed aside.

    `happens` says that its scenario takes place in it, `mixed_planners` that futures beside it have
    other planners.
    """
    found = 1.0
    if future.scenario_id and happens:
        found *= EXPOSURES[exposure_of(future.scenario_id)]
        numbers = dict(future.numbers)  # what the scenario draws belongs to it
    else:
        numbers = changed_numbers(future)
    if mixed_planners and future.planner == HEEDLESS_PLANNER:
        found *= HEEDLESS
    faulty = False
    for name, value in numbers.items():
        row = FUTURE_NUMBERS[name]
        if value == row.neutral:
            continue
        if name == "friction_factor":
            found *= SLIPPERY if value < SLIPPERY_BELOW else WET if value < WET_BELOW else 1.0
        elif name == "lateral_shift_m":
            found *= float(np.exp(-0.5 * (value / SHIFT_STD_M) ** 2))
        else:
            faulty |= row.part == "fault"
    return found * (EXPOSURES["E1"] if faulty else 1.0)
