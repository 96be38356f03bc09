"""What the parts of a drive hand on: what the mission wants done, and what the car last said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import PlannedTrajectory, RoadUsers, SignalState, VehicleState
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.signals import LearntSignal
from foretwin.contracts.world import Control


@dataclass(frozen=True, slots=True)
class BuildWorld:
    """Have the World of a junction built, and loaded by the workers where it will be needed.

    A World that may be needed, since another turn leads to it, is built alone: the workers hold
    few at a time.
    """

    junction_id: str
    load: bool


@dataclass(frozen=True, slots=True)
class UseWorld:
    """From now on this World counts; None is open ground."""

    world_id: str | None


@dataclass(frozen=True, slots=True)
class Notice:
    """What the engineer is to read."""

    level: Literal["info", "warning", "error"]
    text: str


Instruction = BuildWorld | UseWorld | Notice


@dataclass(frozen=True, slots=True)
class RoundIntent:
    """A round that should run now: in which World, along which path, at which speed.

    For `off_lanes_m` the path is driven in the World along none of its lanes. `next_junction` is
    how the next one is controlled, and how far its centre is.
    """

    junction_id: str
    world_id: str
    path: PathAhead
    cruise_speed_mps: float
    speed_ahead_mps: Array
    """(K,) what the nominal future aims at from instant to instant; see `Job`."""
    bend_accel_mps2: float
    """What the driver takes across the way in its bends."""
    off_lanes_m: float = 0.0
    next_junction: tuple[Control, float] | None = None


@dataclass(frozen=True, slots=True)
class NotReady:
    """A round should run now, but cannot; `world_late` says that its World should be there."""

    reason: str
    world_late: bool


class LatestState(NamedTuple):
    """The newest state, and when the sample that gave it was received."""

    state: VehicleState
    receipt_mono_ns: int


class LatestReports(NamedTuple):
    """The newest of what a car says besides its own motion; each with its own stamp."""

    plan: PlannedTrajectory | None
    road_users: RoadUsers | None
    signals: tuple[SignalState, ...]
    learnt_signals: tuple[LearntSignal, ...] = ()
