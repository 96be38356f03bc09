"""What rooms tell each other about a run besides its futures: Worlds, comparisons, the mirror."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.arrays import Array32
from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.roles import Role
from foretwin.contracts.world import Control


class PrepareRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Load and compile a World before it is needed."""

    world_id: str


class PrepareReply(msgspec.Struct, frozen=True, kw_only=True):
    """The World is compiled and warm."""

    world_id: str
    worker_id: str
    seconds: float


class BuildRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Build the World of one intersection."""

    intersection_id: str
    radius_m: float


class BuildReply(msgspec.Struct, frozen=True, kw_only=True):
    """The World lies in the worlds folder under its id."""

    intersection_id: str
    world_id: str
    seconds: float
    cached: bool


RED_FROM, AMBER_FROM, GREEN_TO = 1e-4, 1e-6, 1e-8
"""Criticalities, two orders of magnitude between the colours. Chosen: red is what is likely and
would kill one in ten thousand, or comes once in a hundred times and would kill one in a hundred."""


class FutureHit(msgspec.Struct, frozen=True, kw_only=True):
    """A collision in a round: of which future, when, and with what: a kind of road user, or
    `static`."""

    future: int
    time_s: float
    what: RoadUserKind | Literal["static"]


class MetRoadUser(msgspec.Struct, frozen=True, kw_only=True):
    """Whom a future of a round meets, hit or not, and when it is nearest."""

    future: int
    time_s: float
    kind: RoadUserKind
    scenario_id: str = ""
    """Of the scenario that it belongs to; empty for one that was seen on the road."""


class RoundView(msgspec.Struct, frozen=True, kw_only=True):
    """One round for those who watch: futures (S, M, 2) and the rest in the drive's frame.

    `likelihood` (S,) in 0..1: 1 is as likely as any. `criticality` (S,) in 0..1 is that times the
    risk that somebody dies; `RED_FROM` and more is what one acts upon. `names` say what
    happens in each, for people. `user_xy_m`
    (K, M, 2) are tracks of road users whom the worst futures meet, `touch_xy_m` (C, 2) where cars
    touch one, with the scenario's id in `touch_names`.
    """

    round_id: int
    stamp_ns: int
    intersection_id: str
    place: str = ""
    """Its name by the streets that meet there; empty where they have none."""
    world_id: str
    xy_m: Array32
    criticality: Array32
    likelihood: Array32
    nominal_index: int
    names: tuple[str, ...]
    collided: int
    min_clearance_m: float | None
    latency_ms: float
    user_xy_m: Array32
    touch_xy_m: Array32
    touch_names: tuple[str, ...]
    late: bool = False
    """It took longer than its period: nothing here is current any more."""
    horizon_s: float = 0.0
    """What the M points of each line span, evenly; 0 where it was not told."""
    hits: tuple[FutureHit, ...] = ()
    """The collisions among the futures."""
    met: tuple[MetRoadUser, ...] = ()
    """Whose tracks `user_xy_m` (K, M, 2) are."""


class HorizonError(msgspec.Struct, frozen=True, kw_only=True):
    """Displacement of one prediction against the real drive, up to one horizon.

    `ade_m` mean and `fde_m` final distance; `lateral_m` and `longitudinal_m` final, signed, along
    the real car's heading; `heading_rad` final, signed.
    """

    ade_m: float
    fde_m: float
    lateral_m: float
    longitudinal_m: float
    heading_rad: float


HORIZONS_S = (1.0, 2.0, 4.0, 8.0)
"""How far ahead predictions, and a model run freely, are compared with the drive. Chosen: doubled
from a moment to a whole manoeuvre."""


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """The nominal future of a round against what the car did, with two baselines.

    `weighted_ade_m` is the mean distance of the mean of all futures, weighed by their likelihoods;
    None where it was not told.
    """

    round_id: int
    stamp_ns: int
    intersection_id: str
    horizon_s: float
    nominal: HorizonError
    constant_velocity: HorizonError
    constant_turn_rate: HorizonError
    weighted_ade_m: float | None = None


class PlanComparison(msgspec.Struct, frozen=True, kw_only=True):
    """The car's own plan against the nominal future at the same instants."""

    round_id: int
    stamp_ns: int
    plan_stamp_ns: int
    horizon_s: float
    difference: HorizonError
    """The plan seen from the nominal future; positive lateral: the plan lies to the left."""
    path_offset_m: float
    """Mean lateral distance of the plan's path from the route's lane centre, positive left."""


class PlaneState(msgspec.Struct, frozen=True):
    """x, y, yaw, speed of base_link in the drive's frame."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float


class TwinCorrection(msgspec.Struct, frozen=True, kw_only=True):
    """What draws a twin towards its vehicle, in the twin's own axes, positive ahead and left."""

    along_mps2: float
    across_mps2: float
    yaw_radps2: float


class MirroredVehicle(msgspec.Struct, frozen=True, kw_only=True):
    """Another vehicle beside the car: where it was measured, and where it stands in its role."""

    vehicle_id: str
    role: Role
    real: PlaneState
    shown: PlaneState
    length_m: float
    width_m: float
    height_m: float
    rear_overhang_m: float
    correction: TwinCorrection | None = None
    """Of a twin that follows."""


class MirrorSample(msgspec.Struct, frozen=True, kw_only=True):
    """The real car and its twin, shadow and ghost at one instant, and the gap between them.

    Gaps are free twin minus real: along and across the real heading. The free twin runs on commands
    alone, alone in its World, and starts anew every few seconds, whatever the role: no correction
    and no other vehicle hides what the model does. `independent` is false where it was driven by
    commands estimated from the very motion it is compared with.
    """

    stamp_ns: int
    world_id: str | None
    real: PlaneState
    twin: PlaneState
    shadow: PlaneState
    ghost: PlaneState
    gap_m: float
    gap_along_m: float
    gap_across_m: float
    gap_yaw_rad: float
    gap_speed_mps: float
    since_reset_s: float
    independent: bool
    role: Role = "all"
    """Which of the three are there; of the others, `twin` is the free one, the rest as measured."""
    free: PlaneState | None = None
    """The free twin, where `twin` is another one: corrected, or among other vehicles."""
    correction: TwinCorrection | None = None
    """Of a twin that follows."""
    others: tuple[MirroredVehicle, ...] = ()
    touches: tuple[tuple[str, str], ...] = ()
    """Who touched whom since the last sample, by vehicle ids; `world` is what stands."""
    twin_yaw_rate_radps: float = 0.0


class WorldNotice(msgspec.Struct, frozen=True, kw_only=True):
    """A World is ready; its file lies in the run's worlds folder."""

    world_id: str
    intersection_id: str
    file: str


class ActiveWorld(msgspec.Struct, frozen=True, kw_only=True):
    """The World that the mirror and the rounds use from `stamp_ns` on; None is open ground."""

    stamp_ns: int
    world_id: str | None


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """Something worth telling the engineer."""

    stamp_ns: int
    level: Literal["info", "warning", "error"]
    source: str
    text: str


class WorkerStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What the orchestrator knows of one worker; `rtf` is simulated over CPU seconds."""

    stamp_ns: int
    worker_id: str
    state: Literal["starting", "idle", "busy", "sick", "dead"]
    """A `sick` one refuses jobs; it is tried again after a pause."""
    rtf: float | None = None
    memory_mb: float | None = None
    link_ms: float | None = None
    """Of a worker on another machine, there and back."""
    clock_offset_ms: float | None = None
    """Its clock less ours."""


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """The state of the drive in one line."""

    stamp_ns: int
    drive_time_s: float
    mission_state: str
    next_intersection: str | None
    arrival_in_s: float | None
    """None without a junction ahead, and while the car stands before it, waiting."""
    futures_per_s: float
    dropped: int
    too_slow: str = ""
    """What is run of what was asked for where the machine is too slow for all; empty where not."""
    memory_mb: float | None = None
    """Of all processes of the run together."""
    arrival_early_s: float | None = None
    """One of ten arrives before; None where that is not known."""
    junction_id: str | None = None
    """Of the next intersection, whose World is known by it; `junction_m` is along the road."""
    junction_control: Control | None = None
    junction_m: float | None = None
    arrival_late_s: float | None = None
    """Nine of ten have arrived; None with `arrival_early_s` known: one of ten may stand before."""

    @property
    def arrival_text(self) -> str:
        """When the car will be at the junction ahead, for people."""
        if self.arrival_in_s is None:
            return "waiting"
        text = f"in {self.arrival_in_s:.0f} s"
        if self.arrival_early_s is None:
            return text
        if self.arrival_late_s is None:
            return f"{text} ({self.arrival_early_s:.0f} s or later)"
        return f"{text} ({self.arrival_early_s:.0f} to {self.arrival_late_s:.0f} s)"


class RunEnd(msgspec.Struct, frozen=True, kw_only=True):
    """The orchestrator is done: write what you hold and leave."""

    stamp_ns: int
