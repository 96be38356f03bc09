"""Leaders against what the car can still do: threat numbers, last moments, safe distances.

All take the road users ahead on the ego's course, `following.leaders`, and what the car can do on
dry asphalt. Who crosses the course is none of them: see encroachment.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.metrics.compiled_touch import STRAIGHT_FOR_S
from foretwin.sim_worker.metrics.following import (
    Leaders,
    aside_to_pass,
    closing_mps,
    extreme,
    leaders,
    required_deceleration,
    required_lateral_acceleration,
)
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

MAX_LATERAL_MPS2 = MAX_DECEL_MPS2
"""What steering reaches: as much as braking, on tyres that hold alike to all sides."""
RSS_RESPONSE_S = 1.0
RSS_MAX_ACCEL_MPS2, RSS_LEAST_BRAKE_MPS2, RSS_MOST_BRAKE_MPS2 = 3.5, 4.0, 8.0
"""The paper leaves these open. Those of CARLA's RssCheck, which runs Intel's ad-rss-lib."""


def brake_threat_number(view: RolloutView) -> Measure:
    """Greatest share of the brakes (S,) that a leader asks for; from 1 on they do not suffice.

    Required over greatest deceleration: Åsljung, Nilsson, Fredriksson (2017), Using Extreme Value
    Theory for Vehicle Level Safety Validation, equation 9.
    """
    found = required_deceleration(view)
    return view.measure(found.values / MAX_DECEL_MPS2, found.valid)


def steer_threat_number(view: RolloutView) -> Measure:
    """Greatest share of the lateral acceleration (S,) that getting past a leader asks for.

    Hosseini et al. (2016), Adaptive Forward Collision Warning Algorithm for Automotive
    Applications, equation 1.
    """
    found = required_lateral_acceleration(view)
    return view.measure(found.values / MAX_LATERAL_MPS2, found.valid)


def time_to_brake(view: RolloutView) -> Measure:
    """Least time (S,) until full brakes come too late for a leader, infinite where none is neared.

    Negative where it has passed. Both keep their speeds until then, the leader also after it:
    Hillenbrand, Spieker, Kroschel (2006), A Multilevel Collision Mitigation Approach, TTB; the gap
    left is what the closing speed takes to brake away, gap / Δv - Δv / 2a.
    """
    ahead = view.keep(leaders)
    return extreme(view, ahead, _time_to_brake(ahead), np.minimum, np.inf)


def time_to_steer(view: RolloutView) -> Measure:
    """Least time (S,) until full steering comes too late to pass a leader by its easier side.

    As `time_to_brake`; TTS of the same authors: the time to collision less that in which the car
    gets aside, √(2 y / a).
    """
    ahead = view.keep(leaders)
    return extreme(view, ahead, _time_to_steer(ahead), np.minimum, np.inf)


def time_to_react(view: RolloutView) -> Measure:
    """Least time (S,) until neither full brakes nor full steering helps any more.

    The later of the two at each instant: TTR of Hillenbrand, Spieker, Kroschel (2006); Tamke, Dang,
    Breuel (2011), A flexible method for criticality assessment in driver assistance systems.
    """
    ahead = view.keep(leaders)
    latest = np.maximum(_time_to_brake(ahead), _time_to_steer(ahead))
    return extreme(view, ahead, latest, np.minimum, np.inf)


def rss_distance(view: RolloutView) -> Measure:
    """Greatest distance (S,) that responsibility-sensitive safety asks for behind a leader, or 0.

    Shalev-Shwartz, Shammah, Shashua (2017), On a Formal Model of Safe and Scalable Self-driving
    Cars, definition 1 and lemma 2.
    """
    ahead = view.keep(leaders)
    return extreme(view, ahead, _rss_distance(ahead), np.maximum, 0.0)


def rss_margin(view: RolloutView) -> Measure:
    """Least gap beyond `rss_distance` (S,), taken at the same instant; infinite without a leader.

    Negative where the ego is too near to be safe.
    """
    ahead = view.keep(leaders)
    return extreme(view, ahead, ahead.gap_m - _rss_distance(ahead), np.minimum, np.inf)


def _until_touch(ahead: Leaders) -> tuple[Array, Array]:
    """Return closing speeds (K,), and times to collision along the course, infinite if none."""
    closing = closing_mps(ahead)
    nears = closing > 0.0
    until = np.where(nears, ahead.gap_m, np.inf) / np.where(nears, closing, 1.0)
    return closing, np.where(until <= STRAIGHT_FOR_S, until, np.inf)


def _time_to_brake(ahead: Leaders) -> Array:
    closing, until = _until_touch(ahead)
    return until - closing / (2.0 * MAX_DECEL_MPS2)


def _time_to_steer(ahead: Leaders) -> Array:
    _, until = _until_touch(ahead)
    near = np.isfinite(until)
    aside = aside_to_pass(ahead, np.where(near, until, 0.0))
    return np.where(near & (aside > 0.0), until - np.sqrt(2.0 * aside / MAX_LATERAL_MPS2), np.inf)


def _rss_distance(ahead: Leaders) -> Array:
    reached = ahead.ego_mps + RSS_RESPONSE_S * RSS_MAX_ACCEL_MPS2
    needed = 0.5 * (ahead.ego_mps + reached) * RSS_RESPONSE_S
    needed = needed + np.square(reached) / (2.0 * RSS_LEAST_BRAKE_MPS2)
    needed = needed - np.square(np.maximum(ahead.other_mps, 0.0)) / (2.0 * RSS_MOST_BRAKE_MPS2)
    return np.maximum(needed, 0.0)
