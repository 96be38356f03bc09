"""Futures: what a worker is asked to simulate, and what it answers.

Trajectories hold S simulations of N instants as `states` (S, N, 8): x_m, y_m, yaw_rad of
base_link in the World's frame, vx_mps, vy_mps in the body frame, yaw_rate_radps,
tire_angle_rad, accel_mps2. `STATE_COLUMNS` names them.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.drive import RoadUserKind, SignalState, VehicleState
from foretwin.contracts.forecast import ProgressForecast
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.signals import LearntSignal

_POSE = ("x_m", "y_m", "yaw_rad")
STATE_COLUMNS = (*_POSE, "vx_mps", "vy_mps", "yaw_rate_radps", "tire_angle_rad", "accel_mps2")


RESULT_STEP_S = 0.1
"""Between two instants of a result, wherever futures are recorded, shown or learnt from."""
SPEED_AHEAD_STEP_S = 0.5
"""Between two speeds that the nominal future aims at."""
CAR_WITHIN_M = 60.0
"""The car is looked for on this much of the path's beginning."""
PATH_BEHIND_M = 10.0
"""How much of its path lies behind the car."""
EngineName = Literal["mujoco", "multibody", "gazebo", "carla"]
"""Whose physics moves the car."""
JOB_SCHEMA_VERSION = 1
"""Of `Job`, which is recorded: raised where its bytes mean something else."""


class PathAhead(msgspec.Struct, frozen=True, kw_only=True):
    """The lane-centre path the navigation plan foresees, in the World's frame.

    `xy_m` (N, 2) begins a few metres behind the car, about 1 m apart; `speed_limit_mps` (N,).
    """

    xy_m: Array
    speed_limit_mps: Array


class Future(msgspec.Struct, frozen=True, kw_only=True):
    """One alternative future: what differs from the nominal one (index 0).

    `numbers` are those of `contracts.numbers` that are not neutral. With `scenario_id`, one of the
    job's scenarios happens in it: `values` are its numbers, named as `Scenario` tells, and
    `place_rank` says which of the places that fit the car's path, modulo their number. With
    `place`, a place's name, it is staged there as the case says, away from any drive: the job's
    path is that place's, and the car starts where the case begins.
    """

    index: int
    name: str
    planner: str = "pure_pursuit_idm"
    numbers: dict[str, float] = {}
    scenario_id: str = ""
    values: dict[str, float] = {}
    place_rank: int = 0
    place: str = ""


class SeenRoadUser(msgspec.Struct, frozen=True, kw_only=True):
    """A road user that the car detected as its state was measured; x, y, yaw of its box centre in
    the World's frame. In every future it goes on along its lane, lawfully, or else straight on."""

    user_id: str = ""
    kind: RoadUserKind
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    length_m: float
    width_m: float


class RecordedRoadUser(msgspec.Struct, frozen=True, kw_only=True):
    """A road user that every future has where it was recorded, whatever the others do.

    It is on the road from its first sample to its last. Between two of them position, yaw (the
    short way round) and speed are linear in time; after a sample of `gone_after` it is away until
    the next one.
    """

    user_id: str
    kind: RoadUserKind
    time_s: Array
    """(N,) of the samples from the job's state, rising."""
    poses: Array
    """(N, 3) x, y, yaw of its box centre in the World's frame."""
    speed_mps: Array
    """(N,) along its yaw."""
    gone_after: Array
    """(N,) bool."""
    size_m: tuple[float, float] | None = None
    """Length and width; None where they were not recorded: those of its kind."""


class CarPlan(msgspec.Struct, frozen=True, kw_only=True):
    """The car's own plan in the World's frame: base_link at `time_s` (N,) from the job's state.

    `xy_m` (N, 2), `yaw_rad` (N,), `speed_mps` (N,).
    """

    time_s: Array
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array


class PlannerTiming(msgspec.Struct, frozen=True, kw_only=True):
    """When a driving stack of somebody else is asked and its answers count, in simulated time."""

    rate_hz: float = 10.0
    """So often it is asked, but not while it is still at its last answer."""
    latency_s: float = 0.0
    """So long after its question an answer counts, unless the stack says how long it took; of a
    future's first question at once, as if it had driven before."""


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """Simulate `futures` from `state` for `horizon_s`, live or staged.

    The result is a function of this, of the World and of the car's parameters alone.
    """

    round_id: int
    job_index: int
    world_id: str
    state: VehicleState
    path: PathAhead
    futures: tuple[Future, ...]
    horizon_s: float
    step_s: float
    """Between the instants of the result."""
    seed: int
    cruise_speed_mps: float
    """The speed that the nominal future aims at where nothing is in the way."""
    scenarios: tuple[Scenario, ...] = ()
    """Definitions that futures name."""
    starts: Array | None = None
    """(S, 8) where futures do not begin with the car's state, in the World's frame."""
    road_users: tuple[SeenRoadUser, ...] = ()
    replayed: tuple[RecordedRoadUser, ...] = ()
    """The first road users of every future, in this order."""
    signals: tuple[SignalState, ...] = ()
    """Live colours, the newest of each group."""
    learnt_signals: tuple[LearntSignal, ...] = ()
    """Cycles that groups were heard to repeat; they go before the colours."""
    drive_time_s: float = 0.0
    """Of the state: signal plans run by it."""
    lights_by_plan: bool = False
    """Whether lights of which nothing is heard follow the World's plans; else nobody stops."""
    car_plan: CarPlan | None = None
    metrics: tuple[str, ...] = ()
    """What to measure besides the outcome, by the names of the table of metrics."""
    accidents: bool = False
    """Whether collisions with road users are run on as two bodies in motion."""
    accident_motion: bool = True
    """Whether trajectories show that motion; else the ego stands from the collision on."""
    vehicle: str = ""
    """Digest of the car's parameters; without one, whoever plays it knows them."""
    vehicle_version: int = 0
    """Which of a run's sets of parameters that is; 0 is the vehicle file's."""
    control_hz: float = 20.0
    """How often planners decide."""
    engine: EngineName = "mujoco"
    anchor: str | None = None
    """Name of what ties the simulation to reality; None for nothing."""
    model: dict[str, float] = {}
    """Numbers of a learnt model of the car; none without one."""
    progress: ProgressForecast | msgspec.UnsetType = msgspec.UNSET
    """How far the car itself is expected to get; a job without it has the bytes that it had before
    there was one."""
    speed_ahead_mps: Array | msgspec.UnsetType = msgspec.UNSET
    """(K,) the speed that the nominal future aims at, `SPEED_AHEAD_STEP_S` apart from its start;
    then it stays. A job without it aims at `cruise_speed_mps`, and has the bytes that it had before
    there was one."""
    bend_accel_mps2: float | msgspec.UnsetType = msgspec.UNSET
    """What the driver takes across the way in bends. A job without it has an ordinary driver's, and
    the bytes that it had before there was one."""
    planner_timing: PlannerTiming | msgspec.UnsetType = msgspec.UNSET
    """Of a driving stack that a sweep starts; a job without one has the bytes that it had before
    there was one."""
    schema_version: int = JOB_SCHEMA_VERSION


class Trajectory(msgspec.Struct, frozen=True, kw_only=True):
    """S simulations of N instants; `time_s` (N,) from the seeding state, `states` (S, N, 8)."""

    stamp_ns: int
    time_s: Array
    states: Array32


COLLISION_WITH = ("", "road_user", "static")
"""Nothing; a road user; a building or island."""


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """What became of each of S futures; times and distances are NaN where `valid` is false.

    `collided` (S,) bool, `collision_time_s` (S,), `collision_with` (S,) places in
    `COLLISION_WITH`; `min_clearance_m` (S,) to any road user; `progress_m` (S,) along the path.
    """

    collided: Array
    collision_time_s: Array
    collision_with: Array
    min_clearance_m: Array
    progress_m: Array
    valid: Array
    """(S,) bool: false where the simulation diverged or the planner failed."""
    failures: tuple[str, ...] = ()
    """Why a future is not valid, in words; empty where it is. One for each future, or none."""
    remarks: tuple[str, ...] = ()
    """What a planner says of a future that it did drive, such as that a fallback had to act."""
    lost: tuple[int, ...] | msgspec.UnsetType = msgspec.UNSET
    """Places of those not valid that say nothing of the planner, whose process hung or died; not
    told where there are none."""


class RoadUserTracks(msgspec.Struct, frozen=True, kw_only=True):
    """The other road users of S futures, at most R in each.

    `poses` (S, N, R, 3) x, y, yaw of box centres and `speed_mps` (S, N, R), NaN where there is
    none; `size_m` (S, R, 2) length and width; `kinds` (S, R) places in `kind_names`.
    """

    poses: Array32
    speed_mps: Array32
    size_m: Array32
    kinds: Array
    kind_names: tuple[str, ...]


class Accident(msgspec.Struct, frozen=True, kw_only=True):
    """A collision of the car with a road user, from the two bodies' own motion after it.

    `point_m` (2,) in the World's frame; `angle_rad` is the partner's heading against the ego's;
    `closing_mps` along the line through the touching faces.
    """

    future: int
    """Place in the result."""
    road_user: int
    time_s: float
    point_m: Array
    angle_rad: float
    closing_mps: float
    ego_delta_v_mps: float
    user_delta_v_mps: float


class PlannedImpacts(msgspec.Struct, frozen=True, kw_only=True):
    """What was to happen in S staged futures if nobody intervened; NaN and empty where nothing.

    `time_s` (S,); `met` by the names of road users; `off_m` (S,) how far the ego's point that was
    to be hit is from where that was planned, where it met the one planned.
    """

    time_s: Array
    met: tuple[str, ...]
    off_m: Array


class FuturesResult(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to a Job: S of its futures were played, those of `future_indices`.

    `metrics` are (S,) by name, NaN where one does not apply.
    """

    round_id: int
    job_index: int
    worker_id: str
    world_id: str
    future_indices: tuple[int, ...]
    trajectory: Trajectory
    road_users: RoadUserTracks
    outcome: Outcome
    metrics: dict[str, Array]
    accidents: tuple[Accident, ...]
    left_out: tuple[str, ...]
    """Why a future's scenario does not happen in it; empty where it does, or where it has none."""
    sim_seconds: float
    cpu_seconds: float
    wall_seconds: float
    vehicle_version: int = 0
    """The parameters that simulated it; see Job."""
    planned: PlannedImpacts | None = None
    """None where no future is staged."""
    unplaced: tuple[tuple[int, str], ...] = ()
    """Indices of futures that were not played since they cannot be staged, and why."""
