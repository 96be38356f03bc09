"""How a driver goes on: first as now, then as usual. One law, for futures and for arrivals.

The present acceleration fades by 1/e in `FADING_S`, and as it fades the speed is drawn towards the
one that is wanted. Bends ahead are braked for as the planners brake for them. The
form is the linear prediction with damped trend of Gardner and McKenzie (1985), "Forecasting trends
in time series".

The numbers were chosen together on the drives through Chemnitz, Boulder and Karlsruhe (KITTI 00 and
05), for the countdown with limits that are right and wrong by half, and for futures with the learnt
half of their speeds; they are measured on others (docs/trust.md). What the law
is asked decides how fast the usual speed comes: a future may wait on its way, while the seconds to
a junction are those of a car that does not.
"""

from __future__ import annotations

import math

from foretwin.geometry.compiled import REAL, kernel
from foretwin.sim_worker.driver_model import CURVE_TIME_S, MAX_DECEL_MPS2, STANDING_MPS

FADING_S = 3.0
"""In which a present acceleration fades by 1/e."""
USUAL_S = 24.0
"""Time constant towards the usual speed, of a car that may be held up as others were."""
UNHINDERED_S = 3.0
"""The same of one that is not."""
DRIVEN_S = 5.0
"""Time constant towards what was driven there before."""
USUAL_SHARE = 0.75
"""Of the speed limit: what is driven in towns, before the driver has shown a share of their own."""
LEARN_FASTER_S, LEARN_SLOWER_S = 20.0, 240.0
"""In which a share of the limit is learnt that is higher, or lower, than the usual: who drives less
was held up more often than not, or the limit is not what the map has."""
PULLING_AWAY_MPS2 = 0.15
"""A car that stands and accelerates less does not pull away."""


def stands(speed_mps: float, acceleration_mps2: float) -> bool:
    """Return whether a car stands and does not pull away."""
    return speed_mps < STANDING_MPS and acceleration_mps2 < PULLING_AWAY_MPS2


@kernel(REAL, REAL, REAL, REAL, REAL, REAL, REAL)
def going_on_mps2(
    speed_mps: float,
    present_mps2: float,
    present: float,
    wanted_mps: float,
    within_s: float,
    bend_mps: float,
) -> float:
    """Return the acceleration at a moment ahead, of which `present` is left of what is now.

    `wanted_mps` is come to within about `within_s`, infinite where nothing is wanted; `bend_mps`
    is to be driven in `CURVE_TIME_S`.
    """
    accel = present_mps2 * present
    if wanted_mps != math.inf:
        accel += (1.0 - present) * (wanted_mps - speed_mps) / within_s
    bend_mps2 = (bend_mps - speed_mps) / CURVE_TIME_S
    return max(min(accel, bend_mps2), -MAX_DECEL_MPS2)
