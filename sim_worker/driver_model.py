"""How drivers drive, in numbers: what planners, road users and their judges share.

IDM is the intelligent driver model: Treiber, Hennecke, Helbing (2000), Congested traffic states in
empirical observations and microscopic simulations, Phys. Rev. E 62, equations 2 and 3, table I.
What is chosen says so, and next to which published number it lies.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array

Numbers = Array | float

LATERAL_ACCEL_MPS2 = 2.5
"""In bends. Chosen: half of the 4.89 m/s² up to which nuPlan calls human driving comfortable."""
COMFORT_DECEL_MPS2 = 2.0
"""IDM's b. Chosen: the paper has 1.67 m/s²; AASHTO's stopping sight distances suppose 3.4 m/s²."""
HEEDLESS_BRISKNESS = 1.6
"""By so much the accelerations of who heeds nobody exceed an ordinary driver's in bends. Chosen:
4.0 m/s² across are half of what holds a car on a dry road."""
BEND_DECEL_MPS2 = 0.9
"""Before bends, of other drivers who take LATERAL_ACCEL_MPS2 in them. Chosen by hand, with what
stands at OTHERS_TIME_GAP_S."""
CURVE_TIME_S = 0.5
"""So far ahead a bend's speed counts: it is to be driven by then. Chosen."""
MAX_DECEL_MPS2 = 8.0
"""In emergencies. Chosen: what tyres give on dry asphalt, less a margin; friction limits it too."""
EMERGENCY_DECEL_MPS2 = 7.5
"""Other road users never brake harder. Chosen: 0.76 g, a full application of the brakes of a car on
dry asphalt by an ordinary driver."""
MAX_ACCEL_MPS2 = 1.5
"""IDM's a, in town. Chosen: the paper has 0.73 m/s² for motorways; ISO 15622 lets adaptive cruise
control take 2.0 m/s²."""
ACCEL_EXPONENT = 4.0
"""IDM's δ, as in the paper."""
STANDSTILL_GAP_M = 2.0
"""IDM's s0, as in the paper, from bumper to bumper."""
CALM_TIME_GAP_S = 1.5
"""IDM's T of the car under test. Chosen: near the paper's 1.6 s."""
BRISK_TIME_GAP_S = 1.2
"""IDM's T of a lattice's candidates that follow. Chosen: dense town traffic keeps less than the
paper's 1.6 s."""
OTHERS_TIME_GAP_S = 0.5, 0.26
"""IDM's T of other drivers: median, and standard deviation of its logarithm. Fitted on Mcity's cars
with satellite receivers (MIT licence): begun by `python -m tests.sim_worker.realism --fit mcity`,
ended by choosing the nearest of those tried by hand, none with less than half a second."""
OTHERS_ACCEL_MPS2 = 2.0, 0.2
"""IDM's a of other drivers of cars; of other kinds as their acceleration is to a car's. Fitted as
above: nine starts from a standstill there come to 1.3 to 2.9 m/s, 2.2 in the median, in a second
more."""
OTHERS_DECEL_MPS2 = 2.4, 0.13
"""IDM's b of other drivers of cars; of other kinds as above. Fitted as above."""
OTHERS_LATERAL_MPS2 = 2.3, 0.2
"""What other drivers take in bends; they brake before and accelerate behind these in proportion.
Fitted as above."""
OTHERS_LIMIT_SHARE = 0.65, 0.25
"""Of the speed limit, what other drivers want on a free road, or else the speed that they have.
Fitted as above."""
OTHERS_CLOSEST, CAUGHT_UP = 0.4, 1.5
"""Who is first seen to follow closer than it was drawn to keeps that share of the gap, no less than
this; and who has caught up with another wants to be so much faster than it was drawn to. Chosen on
Mcity's cars."""
OTHERS_REACTION_S = 0.9, 0.4
"""So late other drivers see what changes ahead of them. Chosen: Green (2000), How long does it take
to stop?, Transportation Human Factors 2, has 0.7 s for who expects it and 1.25 s for who does not.
Too few cars follow each other at Mcity to fit it."""
OTHERS_LAG_S = 1.0, 0.3
"""What other drivers leave of time between who was there first and themselves: median as LAG_S,
spread chosen. Two crossings of two cars each were recorded: nothing to fit it on."""
HASTE = (0.3, 2.0)
"""Least and most by which a driver's haste multiplies accelerations from a standstill. Chosen."""
LINE_GAP_M = 1.0
"""Between a front and the line, or the ground of others, before which it stops. Chosen."""
LINE_DECEL_MPS2 = 4.0
"""Who would have to brake harder for a line goes on, as behind a light that has just changed.
Chosen: above the 3.5 m/s² that amber times suppose (RiLSA 2010)."""
SIGHT_M = 60.0
"""How far drivers look for others. Chosen: 4 s at 50 km/h."""
LAG_S, LEAD_S = 1.0, 0.5
"""Nobody enters ground that somebody else reaches less than the lag after it is left, or leaves
less than the lead before it is entered. Chosen."""
STANDING_MPS = 0.5
"""Who is slower stands, in the eyes of others. Chosen: half of a slow walk."""
DECIDE_EVERY_S = 0.2
"""How often drivers decide, under test or law-abiding in traffic. Chosen: about as people do."""
HOLD_SPEED_MPS, HOLD_MPS2 = 0.3, -2.0
"""Who is slower and means to stop holds the brake like this. Chosen: enough on any road's grade."""
WORTH_M = 0.5
"""Of way ahead: who stands does not set off for less, and so does not creep at a red light. Chosen:
the least of those tried; with 3 m gaps at Karlsruhe are a tenth less like those recorded."""
ALONG_COS = 0.5
"""Whose heading is within 60° of a way drives along it. Chosen."""
MAX_CLOSING_MPS = 100.0
"""Faster than any two road users approach each other. Chosen: two cars at 180 km/h each."""
UNKNOWN_LIMIT_MPS = 8.3
"""Aimed at where no speed limit is known. Chosen: 30 km/h, as beside houses."""
LEAST_START_MPS = 2.0
"""With this speed a car that stands is taken to set off. Chosen."""


def dynamic_gap_m(
    speed_mps: Array, lead_mps: Array, time_gap_s: Numbers, accel_mps2: Numbers, decel_mps2: Numbers
) -> Array:
    """Return what IDM wants ahead beyond the gap at a standstill: v T + v Δv / (2 √(a b)), or 0.

    All of one shape; speeds of who follows and of who leads.
    """
    closing = speed_mps * (speed_mps - lead_mps) / (2.0 * np.sqrt(accel_mps2 * decel_mps2))
    return np.maximum(speed_mps * time_gap_s + closing, 0.0)


def improved_idm_mps2(
    speed_mps: Array, desired_mps: Array, share: Array, accel_mps2: Array, decel_mps2: Array
) -> Array:
    """Return what other drivers choose, by the improved intelligent driver model (Treiber and
    Kesting 2013, Traffic Flow Dynamics, eq. 11.21 to 11.24), in m/s².

    All of one shape; `share` is the gap wanted over the gap there is. Unlike IDM's, who follows
    just below its desired speed keeps the gap that it wants, and not a multiple of it.
    """
    ratio = speed_mps / np.maximum(desired_mps, 0.1)
    # Twice a square, which costs a tenth of a power.
    free = accel_mps2 * (1.0 - np.square(ratio) ** (ACCEL_EXPONENT / 2.0))
    above = ratio > 1.0
    if above.any():
        slower = ACCEL_EXPONENT * accel_mps2 / decel_mps2
        free = np.where(above, decel_mps2 * (np.maximum(ratio, 1.0) ** -slower - 1.0), free)
    power = 2.0 * accel_mps2 / np.maximum(free, 1e-3 * accel_mps2)
    near = np.minimum(free, 0.0) + accel_mps2 * (1.0 - np.square(share))
    far = free * np.where(above, 1.0, 1.0 - np.minimum(share, 1.0) ** power)
    return np.where(share < 1.0, far, near)
