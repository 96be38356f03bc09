"""Jobs and results of the simulation: futures, comparisons, and the mirror of the real car.

Trajectories hold S simulations of N instants as `states` (S, N, 8): x_m, y_m, yaw_rad of
base_link in the World's frame, vx_mps, vy_mps in the body frame, yaw_rate_radps,
tire_angle_rad, accel_mps2. `STATE_COLUMNS` names them.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from contracts.arrays import Array, Array32
from contracts.drive import VehicleState

STATE_COLUMNS = (
    "x_m", "y_m", "yaw_rad", "vx_mps", "vy_mps", "yaw_rate_radps", "tire_angle_rad", "accel_mps2",
)  # fmt: skip

ActorKind = Literal["lead", "crossing", "oncoming"]


class PathAhead(msgspec.Struct, frozen=True, kw_only=True):
    """The lane-centre path the navigation plan foresees, in the World's frame.

    `xy_m` (N, 2) begins a few metres behind the car, about 1 m apart; `speed_limit_mps` (N,).
    """

    xy_m: Array
    speed_limit_mps: Array


class ActorSpec(msgspec.Struct, frozen=True, kw_only=True):
    """Another road user of a future, placed by the worker on the ego's path or across it.

    `lead` drives ahead on the ego's path, `gap_m` in front; `crossing` and `oncoming` take a path
    of the World that meets the ego's and are there `time_offset_s` after an ego that keeps its
    speed would be.
    """

    kind: ActorKind
    speed_mps: float
    gap_m: float = 0.0
    time_offset_s: float = 0.0
    path_rank: int = 0
    """Which of the World's crossing paths, in its order, modulo their number."""


class Variant(msgspec.Struct, frozen=True, kw_only=True):
    """One alternative future: what differs from the nominal one (index 0)."""

    index: int
    name: str
    planner: str = "pure_pursuit_idm"
    target_speed_factor: float = 1.0
    """Of the speed that the nominal future aims at."""
    target_speed_offset_mps: float = 0.0
    lateral_shift_m: float = 0.0
    friction_factor: float = 1.0
    extra_steering_delay_s: float = 0.0
    actor: ActorSpec | None = None


class FuturesJob(msgspec.Struct, frozen=True, kw_only=True):
    """Simulate `variants` from `state` for `horizon_s`; the result is a function of this alone."""

    round_id: int
    job_index: int
    world_id: str
    state: VehicleState
    path: PathAhead
    variants: tuple[Variant, ...]
    horizon_s: float
    step_s: float
    """Between the instants of the result."""
    seed: int
    cruise_speed_mps: float
    """The speed that the nominal future aims at where nothing is in the way."""


class Trajectory(msgspec.Struct, frozen=True, kw_only=True):
    """S simulations of N instants; `time_s` (N,) from the seeding state, `states` (S, N, 8)."""

    stamp_ns: int
    time_s: Array
    states: Array32


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """What became of each of S futures; times and distances are NaN where `valid` is false.

    `collided` (S,) bool, `collision_time_s` (S,), `collision_with` (S,): 0 nothing, 1 road user,
    2 building or island; `min_clearance_m` (S,) to the road user; `progress_m` (S,) along the path.
    """

    collided: Array
    collision_time_s: Array
    collision_with: Array
    min_clearance_m: Array
    progress_m: Array
    valid: Array
    """(S,) bool: false where the simulation diverged."""


class FuturesResult(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to a FuturesJob; `actors` (S, N, 3) x, y, yaw of box centres, NaN where none."""

    round_id: int
    job_index: int
    worker_id: str
    world_id: str
    variant_indices: tuple[int, ...]
    trajectory: Trajectory
    actors: Array32
    outcome: Outcome
    sim_seconds: float
    cpu_seconds: float
    wall_seconds: float


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


class RoundView(msgspec.Struct, frozen=True, kw_only=True):
    """One round for those who watch: futures (S, M, 2) and the rest in the drive's frame.

    `criticality` (S,) in 0..1: 1 collides, 0 keeps 10 m or more from everything.
    """

    round_id: int
    stamp_ns: int
    intersection_id: str
    world_id: str
    xy_m: Array32
    criticality: Array32
    nominal_index: int
    names: tuple[str, ...]
    collided: int
    min_clearance_m: float | None
    latency_ms: float


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


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """The nominal future of a round against what the car did, with two baselines."""

    round_id: int
    stamp_ns: int
    intersection_id: str
    horizon_s: float
    nominal: HorizonError
    constant_velocity: HorizonError
    constant_turn_rate: HorizonError


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


class MirrorSample(msgspec.Struct, frozen=True, kw_only=True):
    """The real car and its twin, shadow and ghost at one instant, and the gap between them.

    Gaps are twin minus real: along and across the real heading. `independent` is false where the
    twin was driven by commands estimated from the very motion it is compared with.
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
    state: Literal["starting", "idle", "busy", "dead"]
    rtf: float | None = None


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """The state of the drive in one line."""

    stamp_ns: int
    drive_time_s: float
    mission_state: str
    next_intersection: str | None
    arrival_in_s: float | None
    futures_per_s: float
    dropped: int


class RunEnd(msgspec.Struct, frozen=True, kw_only=True):
    """The orchestrator is done: write what you hold and leave."""

    stamp_ns: int
