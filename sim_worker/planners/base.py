"""What a planner under test sees and answers, vectorised over S simulations."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from sim_worker.planners.path import FrenetPath


class PlannerView(NamedTuple):
    """Everything a planner may know at one control tick; arrays have S rows.

    `states` (S, 8) as `contracts.simulation.STATE_COLUMNS`; `arc_m` and `offset_m` (S,) place
    base_link on `path`; `desired_offset_m` (S,) is the lateral offset to keep; `speed_factor` (S,)
    is how much faster than the nominal future this one likes everything, curves included;
    `lead_gap_m` (S,) from bumper to bumper, infinite without a lead, and `lead_speed_mps` (S,).
    """

    time_s: float
    states: Array
    path: FrenetPath
    arc_m: Array
    offset_m: Array
    desired_offset_m: Array
    target_speed_mps: Array
    speed_factor: Array
    lead_gap_m: Array
    lead_speed_mps: Array
    vehicle: VehicleParameters


class PlannerOutput(NamedTuple):
    """Commands of one control tick: acceleration (S,), angle at the tyres (S,), positive left."""

    accel_mps2: Array
    tire_angle_rad: Array


class Planner(Protocol):
    """A planner holds no state between ticks: its answer is a function of the view alone."""

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
