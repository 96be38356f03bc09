"""A planner that gives way: unprotected turns, roundabouts, priority to the right."""

from __future__ import annotations

import numpy as np

from sim_worker.planners.base import PlannerOutput, PlannerView
from sim_worker.planners.giving_way import wait_arcs, walker_gap_m
from sim_worker.planners.pure_pursuit_idm import PurePursuitIdm


class GapAcceptance:
    """Drives as `PurePursuitIdm` does, and waits where it has to give way until a gap is enough.

    It also stops for those who walk over its path, and before ground that it could not leave.
    """

    def __init__(self) -> None:
        self._driver = PurePursuitIdm()

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        return self._driver.plan(gives_way(view))


def gives_way(view: PlannerView) -> PlannerView:
    """Return the view with lines where the car has to wait, and those who walk as being ahead."""
    if view.ground is not None:
        wait = wait_arcs(view)
        stop = wait if view.stop_arc_m is None else np.minimum(view.stop_arc_m, wait)
        view = view._replace(stop_arc_m=stop)
    walker = walker_gap_m(view)
    nearer = walker < view.lead_gap_m
    if not nearer.any():
        return view
    return view._replace(
        lead_gap_m=np.where(nearer, walker, view.lead_gap_m),
        lead_speed_mps=np.where(nearer, 0.0, view.lead_speed_mps),
    )
