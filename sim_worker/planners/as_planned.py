"""Drives the plan that the real car published, in time and space."""

from __future__ import annotations

from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.trajectory_tracking import Trajectories, check_trajectories, track


class AsPlanned:
    """Tracks the received plan whatever happens; past its end, drives on as `PurePursuitIdm`."""

    def __init__(self) -> None:
        self._after = PurePursuitIdm()

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick; raises ValueError where no plan, or none to drive, came in."""
        plan = view.car_plan
        if plan is None:
            raise ValueError("the car has sent no plan to drive")
        if view.time_s == 0.0:
            check_trajectories(Trajectories._make(values[None] for values in plan))
        if view.time_s > plan.time_s[-1]:
            return self._after.plan(view)
        return track(view, Trajectories._make(v[None] for v in plan), time_s=view.time_s)
