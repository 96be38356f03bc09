"""Whether states are as good as they say: standstills, headings, errors, and shares within them.

Of the place a state tells one deviation, the root of the mean of the variances on both axes, and
so what it calls 95 % is a circle: of an honest filter that knows both axes alike 95 of 100 errors
are within it, of one that knows the one twice as well as the other 93.6, ten times as well 91.8,
never less than 91.7.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from tests.trust.states import States
from tests.trust.truth import Truth

STANDING_MPS, MOVING_MPS, DRIVING_MPS = 0.1, 0.5, 2.0
"""A state says that the car stands below the first; by the truth it moves above the second, and
has a course above the third."""
LONGEST_STANDSTILL_S = 0.3
WORST_YAW_DEG = 20.0
_PLANE_95, _LINE_95 = 2.4477, 1.95996
"""95 % of a normal distribution in the plane and on a line, in standard deviations."""
_START_S = 5.0
"""Left out: no filter knows speed and heading with its first fixes."""
_SLIP_S = 1.0
"""So long after a slip of the reference the position says nothing against it, and so long after
it was torn nothing does."""
_BEFORE_S = 0.3
"""The reference's smoothed track bends so long before it slips or is torn."""


class Consistency(NamedTuple):
    """Figures of one drive; shares are those within what states call 95 %, of places in a circle.

    `false_standstills_s` and `yaw_losses_s` are when they begin, in seconds since the first fix;
    those in `torn_s` would have counted, but the reference is no car's motion there.
    """

    false_standstills_s: tuple[float, ...]
    yaw_losses_s: tuple[float, ...]
    speed_rms_mps: float
    position_rms_m: float
    position_p95_m: float
    yaw_p95_deg: float
    position_within: float
    yaw_within: float
    speed_within: float
    seconds: float
    us_per_sample: float
    torn_s: tuple[float, ...] = ()


def consistency_of(states: States, truth: Truth) -> Consistency:
    """Compare the states of a log with the truth of the same drive."""
    base = truth.track.stamp_ns
    inside = (states.stamp_ns >= base[0] + _START_S * 1e9) & (states.stamp_ns <= base[-1])
    stamps = states.stamp_ns[inside]
    time_s = (stamps - base[0]) * 1e-9
    off = states.xy_m[inside] - truth.at(stamps, "xy_m")
    away = np.hypot(*off.T)
    true_speed = truth.at(stamps, "speed_mps")
    speed = states.speed_mps[inside]
    faster = np.abs(speed) - true_speed  # a course knows no reverse
    turned = np.abs(wrap_angle(states.yaw_rad[inside] - truth.at(stamps, "yaw_rad")))
    moving = np.minimum(true_speed, _lasting(true_speed, time_s)) > MOVING_MPS
    driving = true_speed > DRIVING_MPS
    calm = ~_soon_after(stamps, truth.slips)
    whole = ~_soon_after(stamps, truth.torn)
    stands = (np.abs(speed) < STANDING_MPS) & moving
    lost = (np.degrees(turned) > WORST_YAW_DEG) & driving
    standstills = _runs(time_s, stands & whole, longer_than_s=LONGEST_STANDSTILL_S)
    losses = _runs(time_s, lost & whole, longer_than_s=0.0)
    all_losses = _runs(time_s, lost, longer_than_s=0.0)
    driving = driving & whole
    return Consistency(
        standstills,
        losses,
        _rms(faster[whole]),
        _rms(away[calm]),
        float(np.percentile(away[calm], 95)),
        float(np.degrees(np.percentile(turned[driving], 95))) if driving.any() else np.nan,
        float(np.mean((away < _PLANE_95 * states.position_std_m[inside])[calm])),
        _share((turned < _LINE_95 * states.yaw_std_rad[inside])[driving]),
        float(np.mean((np.abs(faster) < _LINE_95 * states.speed_std_mps[inside])[whole])),
        float(time_s[-1] - time_s[0]),
        states.us_per_sample,
        tuple(sorted(set(all_losses) - set(losses))),
    )


def _lasting(speed_mps: Array, time_s: Array) -> Array:
    """Return the median over a second and a half: small slips of a standing car's are no motion."""
    reach = max(1, round(0.75 / float(np.median(np.diff(time_s)))))
    padded = np.pad(speed_mps, reach, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1)


def _soon_after(
    stamps: npt.NDArray[np.int64], slips: npt.NDArray[np.int64]
) -> npt.NDArray[np.bool_]:
    if not len(slips):
        return np.zeros(len(stamps), dtype=bool)
    latest = np.searchsorted(slips, stamps, side="right") - 1
    since = stamps - slips[np.maximum(latest, 0)]
    soon: npt.NDArray[np.bool_] = (latest >= 0) & (since < _SLIP_S * 1e9)
    following = slips[np.minimum(latest + 1, len(slips) - 1)] - stamps
    return soon | (np.abs(following) < _BEFORE_S * 1e9)


def _runs(
    time_s: Array, flags: npt.NDArray[np.bool_], *, longer_than_s: float
) -> tuple[float, ...]:
    """Return when runs of `flags` begin that last until the next state for longer than that."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    begins, ends = edges[::2], np.minimum(edges[1::2], len(time_s) - 1)
    return tuple(
        float(time_s[begin])
        for begin, end in zip(begins, ends, strict=True)
        if time_s[end] - time_s[begin] > longer_than_s
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _share(values: npt.NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else np.nan
