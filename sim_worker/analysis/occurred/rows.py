"""What really occurred in a drive, as rows: kinds, their tags, and what each is measured by."""

from __future__ import annotations

from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts.drive import RoadUserKind
from foretwin.sim_worker.metrics.encroachment import STOPPING_DECEL_MPS2
from foretwin.sim_worker.metrics.time_to_collision import EXPOSED_BELOW_S

OPENLABEL: dict[str, tuple[str, ...]] = {
    "through_straight": ("MotionDrive",),
    "turn_left": ("MotionTurnLeft",),
    "turn_right": ("MotionTurnRight",),
    "u_turn": ("MotionUTurn",),
    "lane_change_left": ("MotionLaneChangeLeft",),
    "lane_change_right": ("MotionLaneChangeRight",),
    "stop": ("MotionStop",),
    "standstill": ("MotionStop",),
    "following": ("MotionDrive",),
    "cut_in": ("MotionCutIn",),
    "cut_out": ("MotionCutOut",),
    "lead_decelerates": ("MotionDecelerate",),
    "stationary_ahead": ("MotionStop",),
    "parked_beside": ("MotionStop",),
    "overtakes_ego": ("MotionOvertake",),
    "ego_overtakes": ("MotionOvertake",),
    "crossing_from_left": ("MotionCross",),
    "crossing_from_right": ("MotionCross",),
    "oncoming_turns_across": ("MotionTurn", "MotionCross"),
    "ego_turns_across_oncoming": ("MotionTowards",),
    "same_direction_turns_across": ("MotionTurn", "MotionCross"),
    "ego_turns_across_same_direction": ("MotionDrive",),
    "turns_into_path": ("MotionTurn",),
    "ego_turns_into_path": ("MotionDrive",),
    "pedestrian_crossing": ("MotionWalk", "MotionCross"),
    "cyclist_crossing": ("MotionDrive", "MotionCross"),
}
"""Tags of ASAM OpenLABEL 1.0's scenario ontology, by kind; docs/occurred.md says what each is."""
USER_TAGS: dict[RoadUserKind, str] = {
    "car": "VehicleCar",
    "van": "VehicleVan",
    "lorry": "VehicleTruck",
    "bus": "VehicleBus",
    "motorcycle": "VehicleMotorcycle",
    "bicycle": "VehicleCycle",
    "pedestrian": "HumanPedestrian",
}
"""Of OpenLABEL; trams and unknown ones have none."""


class Threshold(NamedTuple):
    """What a measure is held against, and whose number that is."""

    value: float
    unit: str
    beyond: Literal["below", "above"]
    source: str


THRESHOLDS: dict[str, Threshold] = {
    "ttc_s": Threshold(
        EXPOSED_BELOW_S,
        "s",
        "below",
        "Minderhoud and Bovy (2001), Extended time-to-collision measures, section 5",
    ),
    "pet_s": Threshold(
        1.5,
        "s",
        "below",
        "chosen: that of the time to collision; of Allen, Shin and Cooper (1978), whose measure "
        "it is, no threshold was read",
    ),
    "drac_mps2": Threshold(
        STOPPING_DECEL_MPS2,
        "m/s²",
        "above",
        "AASHTO (2018), A Policy on Geometric Design, 3.2.2: what most drivers accept",
    ),
}
"""Beyond one of them a scenario tells of a conflict; others may tell of the same one."""


class OccurredScenario(msgspec.Struct, frozen=True, kw_only=True):
    """One scenario that took place in a drive, by what was recorded of it.

    Measures are of this other road user alone; None where it says nothing or was never reached.
    """

    kind: str
    begin_ns: int
    end_ns: int
    junction_id: str = ""
    other_id: str = ""
    other_kind: str = ""
    side: str = ""
    """Of the car, from where somebody comes or where to it goes: left, right, or "" for neither."""
    ego_speed_mps: float = 0.0
    """As it begins."""
    other_speed_mps: float | None = None
    gap_m: float | None = None
    """Least from bumper to bumper along the car's way, where one is ahead of the other."""
    closing_mps: float | None = None
    """As it begins: how much faster the car is along its way."""
    ttc_s: float | None = None
    pet_s: float | None = None
    drac_mps2: float | None = None
    time_headway_s: float | None = None
    beyond: tuple[str, ...] = ()
    """Which of `THRESHOLDS` were passed."""
    careful_prevents: bool | None = None
    """Whether the first performance model of UN Regulation No. 157, a competent and careful human
    driver, would not have touched the other; None for what that regulation does not cover."""
    careful_gap_m: float | None = None
    """Least gap that it would have had; None where the other is never in its way."""
    fuzzy_prevents: bool | None = None
    fuzzy_gap_m: float | None = None
    """The same of its second model, the fuzzy safety model."""
    tags: tuple[str, ...] = ()

    @property
    def is_conflict(self) -> bool:
        """Whether a threshold was passed."""
        return bool(self.beyond)
