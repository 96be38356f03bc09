"""A planner that gives way: unprotected turns, roundabouts, priority to the right."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import DECIDE_EVERY_S
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.giving_way import wait_arcs, walker_gap_m
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.vehicle.reference_points import front_from_base_m


class GapAcceptance:
    """Drives as `PurePursuitIdm` does, and waits where it has to give way until a gap is enough.

    It also stops for those who walk over its path, and before ground that it could not leave.
    Driving a job, it decides every 0.2 s, no faster than people do; without memory, at every tick.
    """

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        return self.begin(len(view.arc_m)).plan(view)

    def begin(self, count: int) -> GivingWayDriver:
        """Return what drives the cars of one job."""
        return GivingWayDriver(count)


class GivingWayDriver:
    """Remembers where to wait, and for which pedestrians, from one decision to the next."""

    remarks: Mapping[int, str] = {}

    def __init__(self, count: int) -> None:
        self._driver = PurePursuitIdm()
        self._next_s = -np.inf
        self._wait_arc_m: Array = np.full(count, np.inf)
        self._walker_arc_m: Array = np.full(count, np.inf)

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        front = view.arc_m + front_from_base_m(view.vehicle)
        if view.time_s > self._next_s - 1e-6:
            self._next_s = view.time_s + DECIDE_EVERY_S
            self._wait_arc_m = wait_arcs(view)
            self._walker_arc_m = walker_gap_m(view) + front
        return self._driver.plan(self._as_seen(view, front))

    def _as_seen(self, view: PlannerView, front_arc_m: Array) -> PlannerView:
        """Return the view with lines where the car has to wait, and those who walk as ahead."""
        if view.ground is not None:
            stop = np.where(self._wait_arc_m > front_arc_m, self._wait_arc_m, np.inf)
            if view.stop_arc_m is not None:
                stop = np.minimum(view.stop_arc_m, stop)
            view = view._replace(stop_arc_m=stop)
        walker = np.maximum(self._walker_arc_m - front_arc_m, 0.1)
        nearer = walker < view.lead_gap_m
        if not nearer.any():
            return view
        return view._replace(
            lead_gap_m=np.where(nearer, walker, view.lead_gap_m),
            lead_speed_mps=np.where(nearer, 0.0, view.lead_speed_mps),
        )
