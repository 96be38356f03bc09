"""What a planner under test sees and answers, vectorised over S simulations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol, runtime_checkable

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import LATERAL_ACCEL_MPS2


class SeenUsers(NamedTuple):
    """Other road users as perceived: up to R for each of S cars, NaN where there is none.

    `poses` (S, R, 3) x, y, yaw of box centres in the World's frame, `speed_mps` (S, R) along their
    yaw, `size_m` (S, R, 2) length and width, `arc_m` and `offset_m` (S, R) of box centres on the
    ego's path, `walks` (S, R) true for those who keep to no lane, `turned_rad` (S, R) their yaw
    against the path's heading there. Who drives a future with faults perceives late, displaced,
    or nothing.
    """

    poses: Array
    speed_mps: Array
    size_m: Array
    arc_m: Array
    offset_m: Array
    walks: Flags
    turned_rad: Array


class SharedGround(NamedTuple):
    """Ground on the ego's path that other movements of the junction cross or join; C pieces.

    Between `enter_arc_m` and `leave_arc_m` (C,) the ego is on it; `point_m` (C, 2) is its middle;
    `waits` (C,) where the ego has to give way there, wherever no light says otherwise;
    `their_yaw_rad` (C,) which way the others cross it, where that is known.
    """

    enter_arc_m: Array
    leave_arc_m: Array
    point_m: Array
    waits: Flags
    their_yaw_rad: Array | None = None


class KnownPlan(NamedTuple):
    """The real car's own plan: `time_s` (K,) from the start, `xy_m` (K, 2), `yaw_rad`, `speed_mps`
    (K,) of base_link in the World's frame."""

    time_s: Array
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array


class PlannerView(NamedTuple):
    """Everything a planner may know at one control tick; arrays have S rows.

    `states` (S, 8) as `foretwin.contracts.futures.STATE_COLUMNS`; `arc_m` and `offset_m` (S,) place
    base_link on `path`; `desired_offset_m` (S,) is the lateral offset to keep; `speed_factor` (S,)
    is how much faster than the nominal future this one likes everything, curves included;
    `lead_gap_m` (S,) from bumper to bumper, infinite without a lead, and `lead_speed_mps` (S,);
    `stop_arc_m` (S,) where the front has to stand for a light, infinite without one; `users` and
    `ground` are None where there are none; `car_plan` where none was received; `heading` (2, S) is
    the cosine and sine of the states' yaw, where these are known already; `climb_mps2` (S,) is what
    the slope takes of the acceleration that is commanded, None where the World is flat;
    `target_accel_mps2` (S,) is how the target speed changes, None where it stays; `bend_accel_mps2`
    is what the nominal future takes across the way in bends.
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
    stop_arc_m: Array | None = None
    users: SeenUsers | None = None
    ground: SharedGround | None = None
    car_plan: KnownPlan | None = None
    heading: Array | None = None
    climb_mps2: Array | None = None
    target_accel_mps2: Array | None = None
    bend_accel_mps2: float = LATERAL_ACCEL_MPS2


class PlannerOutput(NamedTuple):
    """Commands of one control tick: acceleration (S,) in the direction of travel, angle at the
    tyres (S,), positive left."""

    accel_mps2: Array
    tire_angle_rad: Array


class Planner(Protocol):
    """A planner holds no state between ticks: its answer is a function of the view alone.

    One whose class says `drives_backwards = True` has its cars driven in reverse; one that says
    `looks_at_users = False` is shown no `users`, whose rows would be cut out in vain.
    """

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""


class JobDriver(Planner, Protocol):
    """Drives one job's cars from its first tick to its last, and may remember in between."""

    @property
    def remarks(self) -> Mapping[int, str]:
        """What there is to say of rows: why one's answers are NaN, or what else happened to it."""


@runtime_checkable
class RemembersWithinJob(Protocol):
    """A planner that remembers from tick to tick: `begin` is called as each job begins."""

    def begin(self, count: int) -> JobDriver:
        """Return what drives the `count` cars of one job."""


class Briefing(NamedTuple):
    """What a job's S futures are called and where they take place, for who is told of more than a
    view: a driving stack of somebody else.

    `user_ids` and `user_kinds` (S, R) are those of `SeenUsers`, in its order; `colours_at` gives
    the colours of the World's lights by the ids of their groups, at a time of the job; `lanes_at`
    the ids of the lanes or connections on which points (K, 2) with headings (K,) are, else "".
    Every 1 / `rate_hz` of simulated time a stack is asked, and its answers count `latency_s` later.
    """

    world_id: str
    stamp_ns: int
    future_ids: tuple[str, ...]
    seeds: tuple[int, ...]
    user_ids: tuple[tuple[str, ...], ...]
    user_kinds: tuple[tuple[str, ...], ...]
    colours_at: Callable[[float], Mapping[str, str]]
    lanes_at: Callable[[Array, Array], tuple[str, ...]]
    rate_hz: float
    latency_s: float

    def of_rows(self, rows: Indices) -> Briefing:
        """Return the briefing of some of the futures."""
        some = rows.tolist()
        return self._replace(
            future_ids=tuple(self.future_ids[row] for row in some),
            seeds=tuple(self.seeds[row] for row in some),
            user_ids=tuple(self.user_ids[row] for row in some),
            user_kinds=tuple(self.user_kinds[row] for row in some),
        )


@runtime_checkable
class TakesBriefing(Protocol):
    """A planner that is told more of a job as it begins than how many cars there are."""

    def begin_briefed(self, briefing: Briefing) -> JobDriver:
        """Return what drives the cars of one job."""


class PlayAgain(Exception):  # noqa: N818
    """A planner has lost what it knew of a job, through no fault of its answers: the job has to be
    played from its start."""


def rows_of(view: PlannerView, rows: Indices) -> PlannerView:
    """Return what a planner sees at one tick that drives only some of the cars."""
    return ViewOfSome(rows).of(view)


class ViewOfSome:
    """What a planner sees that drives only some of the cars, tick by tick."""

    def __init__(self, rows: Indices) -> None:
        self._rows = rows
        self._steady: dict[str, tuple[Array, Array]] = {}

    def of(self, view: PlannerView) -> PlannerView:
        """Return it of what there is to be seen at a tick."""
        rows, users = self._rows, view.users
        if users is not None:
            users = SeenUsers._make(field[rows] for field in users)
        of_some = {
            name: values[rows] for name in _BY_CAR if (values := getattr(view, name)) is not None
        }
        for name in _STEADY:
            whole = getattr(view, name)
            known = self._steady.get(name)
            if known is None or known[0] is not whole:
                known = self._steady[name] = whole, whole[rows]
            of_some[name] = known[1]
        if view.heading is not None:
            of_some["heading"] = view.heading[:, rows]
        return view._replace(users=users, **of_some)


_BY_CAR = (
    *("states", "arc_m", "offset_m", "lead_gap_m", "lead_speed_mps", "stop_arc_m", "climb_mps2"),
    "target_accel_mps2",
)
_STEADY = "desired_offset_m", "target_speed_mps", "speed_factor"
"""Mostly the same arrays at each tick, written once: planners tell by that what has not changed."""
