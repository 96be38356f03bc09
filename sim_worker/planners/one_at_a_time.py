"""For planners that are written for one car: what one sees, and how many of them make a job."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.planner_interface import (
    KnownPlan,
    PlannerOutput,
    PlannerView,
    SharedGround,
)


class SeenUser(NamedTuple):
    """One other road user; fields as in `foretwin.sim_worker.planner_interface.SeenUsers`."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    length_m: float
    width_m: float
    arc_m: float
    offset_m: float
    walks: bool
    turned_rad: float


class CarView(NamedTuple):
    """What the planner of one car sees; fields as in `planner_interface.PlannerView`."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    vx_mps: float
    vy_mps: float
    yaw_rate_radps: float
    tire_angle_rad: float
    accel_mps2: float
    path: FrenetPath
    arc_m: float
    offset_m: float
    desired_offset_m: float
    target_speed_mps: float
    speed_factor: float
    lead_gap_m: float
    lead_speed_mps: float
    stop_arc_m: float
    users: tuple[SeenUser, ...]
    ground: SharedGround | None
    car_plan: KnownPlan | None
    vehicle: VehicleParameters


class CarPlanner(Protocol):
    """A planner of one car: its answer is acceleration and tyre angle."""

    def plan_one(self, view: CarView) -> tuple[float, float]:
        """Answer one control tick of one car."""


@runtime_checkable
class AnswersOne(Protocol):
    """A planner of one car, recognised by its method."""

    def plan_one(self, view: CarView) -> tuple[float, float]:
        """Answer one control tick of one car."""


class OneAtATime:
    """Calls a planner of one car for each car in turn; where it raises, that car's answer is NaN.

    The planner is one object for all cars: what it remembers between calls is its own affair.
    """

    def __init__(self, planner: CarPlanner) -> None:
        self._planner = planner
        self.remarks: dict[int, str] = {}

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick of all cars."""
        answers = np.full((len(view.arc_m), 2), np.nan)
        for row in range(len(answers)):
            if row in self.remarks:
                continue
            try:
                answers[row] = _two_numbers(self._planner.plan_one(car_view(view, row)))
            except Exception as error:
                # One car's failure is not the others'.
                self.remarks[row] = f"{type(error).__name__}: {error}"
        return PlannerOutput(answers[:, 0], answers[:, 1])


def _two_numbers(answer: Any) -> tuple[float, float]:
    """Return an acceleration and a tyre angle; raises TypeError in words for anything else."""
    try:
        accel, angle = answer
        return float(accel), float(angle)
    except (TypeError, ValueError):
        kind = type(answer).__name__
        raise TypeError(f"plan_one returned {kind}, not an acceleration and an angle") from None


def car_view(view: PlannerView, row: int) -> CarView:
    """Return what the car of one row sees."""
    stop = np.inf if view.stop_arc_m is None else float(view.stop_arc_m[row])
    numbers = [float(getattr(view, name)[row]) for name in _NUMBERS]
    places = (view.time_s, *view.states[row].tolist(), view.path, *numbers, stop)
    rest = (_users(view, row), view.ground, view.car_plan, view.vehicle)
    return CarView._make([*places, *rest])


_NUMBERS = CarView._fields[CarView._fields.index("arc_m") : CarView._fields.index("stop_arc_m")]


def _users(view: PlannerView, row: int) -> tuple[SeenUser, ...]:
    users = view.users
    if users is None:
        return ()
    there = np.isfinite(users.poses[row, :, 0])
    poses, speed, size, arc, offset, walks, turned = (
        column[row][there].tolist() for column in users
    )
    rows = zip(poses, speed, size, arc, offset, map(bool, walks), turned, strict=True)
    return tuple(SeenUser._make([*pose, v, *box, *rest]) for pose, v, box, *rest in rows)
