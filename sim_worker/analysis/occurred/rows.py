"""What really occurred in a drive, as rows: kinds, their tags, and what each is measured by."""

from __future__ import annotations

from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts.drive import RoadUserKind
from foretwin.sim_worker.metrics.encroachment import STOPPING_DECEL_MPS2
from foretwin.sim_worker.metrics.time_to_collision import EXPOSED_BELOW_S

EgoKind = Literal[
    "through_straight",
    "turn_left",
    "turn_right",
    "u_turn",
    "lane_change_left",
    "lane_change_right",
    "stop",
    "standstill",
    "following",
]
AlongKind = Literal[
    "cut_in",
    "cut_out",
    "lead_decelerates",
    "stationary_ahead",
    "parked_beside",
    "overtakes_ego",
    "ego_overtakes",
]
AcrossKind = Literal[
    "crossing_from_left",
    "crossing_from_right",
    "oncoming_turns_across",
    "ego_turns_across_oncoming",
    "same_direction_turns_across",
    "ego_turns_across_same_direction",
    "turns_into_path",
    "ego_turns_into_path",
    "pedestrian_crossing",
    "cyclist_crossing",
]


class KindMeaning(NamedTuple):
    """What a kind says; where it stands in ISO 34502's structure, as others tell of that standard,
    "" where it has no class there; and its tags of ASAM OpenLABEL 1.0's scenario ontology."""

    meaning: str
    iso_34502: str
    openlabel: tuple[str, ...]


_LANE_KEEP, _CHANGE = "main roadway, subject keeps lane, ", "main roadway, subject changes lane"
MEANINGS: dict[str, KindMeaning] = {
    "through_straight": KindMeaning(
        "the car goes straight on through a junction", "", ("MotionDrive",)
    ),
    "turn_left": KindMeaning("the car turns left", "", ("MotionTurnLeft",)),
    "turn_right": KindMeaning("the car turns right", "", ("MotionTurnRight",)),
    "u_turn": KindMeaning("the car turns back", "", ("MotionUTurn",)),
    "lane_change_left": KindMeaning(
        "the car changes to the lane on its left", _CHANGE, ("MotionLaneChangeLeft",)
    ),
    "lane_change_right": KindMeaning(
        "the car changes to the lane on its right", _CHANGE, ("MotionLaneChangeRight",)
    ),
    "stop": KindMeaning("the car brakes to a standstill", "", ("MotionStop",)),
    "standstill": KindMeaning("the car stands", "", ("MotionStop",)),
    "following": KindMeaning("the car drives behind another", "", ("MotionDrive",)),
    "cut_in": KindMeaning(
        "another comes into the car's lane ahead of it", _LANE_KEEP + "cut-in", ("MotionCutIn",)
    ),
    "cut_out": KindMeaning(
        "the one ahead leaves the car's lane", _LANE_KEEP + "cut-out", ("MotionCutOut",)
    ),
    "lead_decelerates": KindMeaning(
        "the one ahead brakes", _LANE_KEEP + "deceleration", ("MotionDecelerate",)
    ),
    "stationary_ahead": KindMeaning("somebody stands in the car's way", "", ("MotionStop",)),
    "parked_beside": KindMeaning(
        "the car passes close by a vehicle that stands", "", ("MotionStop",)
    ),
    "overtakes_ego": KindMeaning(
        "another passes the car, driving the same way", "", ("MotionOvertake",)
    ),
    "ego_overtakes": KindMeaning(
        "the car passes another that drives the same way", "", ("MotionOvertake",)
    ),
    "crossing_from_left": KindMeaning(
        "a vehicle crosses the car's way from its left", "", ("MotionCross",)
    ),
    "crossing_from_right": KindMeaning(
        "a vehicle crosses the car's way from its right", "", ("MotionCross",)
    ),
    "oncoming_turns_across": KindMeaning(
        "an oncoming vehicle turns across the car's way", "", ("MotionTurn", "MotionCross")
    ),
    "ego_turns_across_oncoming": KindMeaning(
        "the car turns across an oncoming vehicle's way", "", ("MotionTowards",)
    ),
    "same_direction_turns_across": KindMeaning(
        "a vehicle that drives beside the car turns across its way",
        "",
        ("MotionTurn", "MotionCross"),
    ),
    "ego_turns_across_same_direction": KindMeaning(
        "the car turns across the way of one that goes on beside it", "", ("MotionDrive",)
    ),
    "turns_into_path": KindMeaning(
        "a vehicle turns from another road into the car's way ahead", "", ("MotionTurn",)
    ),
    "ego_turns_into_path": KindMeaning("the car turns into another's way", "", ("MotionDrive",)),
    "pedestrian_crossing": KindMeaning(
        "somebody on foot crosses the car's way", "", ("MotionWalk", "MotionCross")
    ),
    "cyclist_crossing": KindMeaning(
        "a cyclist crosses the car's way", "", ("MotionDrive", "MotionCross")
    ),
}
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
