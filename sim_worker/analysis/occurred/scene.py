"""A drive on even times: where the car was, and the courses of those whom it detected.

Detections are noisy, have holes, change their ids and tell of nobody at times. Courses are smoothed
both ways in time: they are for looking back.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices, Stamps
from foretwin.contracts.drive import RoadUserKind
from foretwin.sim_worker.driver_model import STANDING_MPS
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

STEP_S = 0.1
_HOLE_S = 1.0
"""The car is not known between states that are farther apart."""
_JOINED_S, _JOINED_M = 2.5, 2.5
"""A course goes on under another id or after a hole, where it is found so near to where it would
be; for each second of the hole the same again."""
_SMOOTH_S, _SLOW_SMOOTH_S = 1.5, 2.5
"""Parabolas over so long give velocity, longer ones say who stands."""
_LEAST_S, _LEAST_SEEN = 1.2, 6
"""Who is detected for less is nobody."""
_LEAST_SHARE = 0.35
_SHAKES_M = 1.2
"""Detections that leave their own smooth course by more (RMS) are clutter."""
_SPREAD_M = 0.9
"""Whose detections lie within that (RMS) never moves."""
_MOST_MPS = 70.0
_HEADS_MPS = 1.0


class DrivenMotion(NamedTuple):
    """The car at N even times, `STEP_S` apart: base_link in a plane frame.

    `yaw_rad` is without jumps; all but stamps are NaN where the drive has a hole.
    """

    stamp_ns: Stamps
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array
    accel_mps2: Array
    yaw_rate_radps: Array


class Detected(NamedTuple):
    """One id's detections as they came: box centres (N, 2) in the plane frame; yaw may be NaN."""

    user_id: str
    kind: RoadUserKind
    size_m: tuple[float, float] | None
    stamp_ns: Stamps
    xy_m: Array
    yaw_rad: Array


class OtherCourse(NamedTuple):
    """One road user from row `first` of the drive's times on, K rows.

    `velocity_mps` (K, 2); `yaw_rad` where it heads, held while it stands; `standing` (K,) bool;
    `size_m` length and width, those of its kind where they were not detected.
    """

    user_id: str
    kind: RoadUserKind
    size_m: tuple[float, float]
    first: int
    xy_m: Array
    velocity_mps: Array
    yaw_rad: Array
    speed_mps: Array
    standing: Flags

    @property
    def rows(self) -> Indices:
        """The rows of the drive at which it was there."""
        return np.arange(self.first, self.first + len(self.xy_m))


def even_motion(
    stamp_ns: Stamps, xy_m: Array, yaw_rad: Array, speed_mps: Array, accel_mps2: Array, rate: Array
) -> DrivenMotion:
    """Return the car's states (N,) in the order of their stamps at even times; yaw rate last.

    Raises ValueError for less than two states.
    """
    if len(stamp_ns) < 2:
        raise ValueError(f"a drive of {len(stamp_ns)} states; two at least are right")
    step_ns = round(STEP_S * 1e9)
    even = np.arange(stamp_ns[0], stamp_ns[-1] + 1, step_ns, dtype=np.int64)
    since_s, at_s = (stamp_ns - stamp_ns[0]) * 1e-9, (even - stamp_ns[0]) * 1e-9
    after = np.clip(np.searchsorted(since_s, at_s), 1, len(since_s) - 1)
    hole = since_s[after] - since_s[after - 1] > _HOLE_S
    columns = [*xy_m.T, np.unwrap(yaw_rad), speed_mps, accel_mps2, rate]
    x, y, *others = (
        np.where(hole, np.nan, np.interp(at_s, since_s, np.asarray(column))) for column in columns
    )
    return DrivenMotion(even, np.stack([x, y], axis=1), *others)


def courses_of(detected: Iterable[Detected], ego: DrivenMotion) -> tuple[OtherCourse, ...]:
    """Return who was there, in the order in which they came.

    Pieces of one course are joined over holes and other ids, what is too short or shakes is left
    out. A course has the id of its first piece.
    """
    pieces = [piece for one in detected for piece in _pieces(one)]
    chains = _joined(sorted(pieces, key=lambda piece: int(piece.stamp_ns[0])))
    found = (_course(chain, ego) for chain in chains)
    return tuple(sorted((c for c in found if c is not None), key=lambda c: (c.first, c.user_id)))


def _pieces(one: Detected) -> Iterable[Detected]:
    """Yield what an id was between holes, and places that it cannot have reached."""
    known = np.isfinite(one.xy_m).all(axis=1)
    stamp, xy, yaw = one.stamp_ns[known], one.xy_m[known], one.yaw_rad[known]
    if not len(stamp):
        return
    passed_s = np.diff(stamp) * 1e-9
    leap = np.hypot(*np.diff(xy, axis=0).T) > _MOST_MPS * passed_s + 2.0 * _JOINED_M
    cuts = np.flatnonzero((passed_s > _JOINED_S) | leap) + 1
    for rows in np.split(np.arange(len(stamp)), cuts):
        yield one._replace(stamp_ns=stamp[rows], xy_m=xy[rows], yaw_rad=yaw[rows])


def _joined(pieces: Sequence[Detected]) -> list[list[Detected]]:
    chains: list[list[Detected]] = []
    for piece in pieces:
        fits = [(_miss(chain, piece), n) for n, chain in enumerate(chains)]
        miss, best = min(fits, default=(np.inf, -1))
        if miss <= 1.0:
            chains[best].append(piece)
        else:
            chains.append([piece])
    return chains


def _miss(chain: Sequence[Detected], piece: Detected) -> float:
    """Return how far a piece begins from where a chain would be, 1 as far as may be."""
    last = chain[-1]
    hole_s = float(piece.stamp_ns[0] - last.stamp_ns[-1]) * 1e-9
    if not 0.0 < hole_s <= _JOINED_S or len(last.stamp_ns) < 3 or _class(last) != _class(piece):
        return np.inf
    recent = last.stamp_ns >= last.stamp_ns[-1] - 1_000_000_000
    time_s = (last.stamp_ns[recent] - last.stamp_ns[-1]) * 1e-9
    if len(time_s) < 3:
        return np.inf
    line = np.polynomial.polynomial.polyfit(time_s, last.xy_m[recent], 1)
    expected = line[0] + line[1] * hole_s
    return float(np.hypot(*(piece.xy_m[0] - expected))) / (_JOINED_M * (1.0 + hole_s / 2.0))


def _class(one: Detected) -> str:
    return one.kind if one.kind in ("pedestrian", "bicycle") else "vehicle"


def _course(chain: Sequence[Detected], ego: DrivenMotion) -> OtherCourse | None:
    stamp = np.concatenate([piece.stamp_ns for piece in chain])
    xy = np.concatenate([piece.xy_m for piece in chain])
    told = np.concatenate([piece.yaw_rad for piece in chain])
    during = (stamp >= ego.stamp_ns[0]) & (stamp <= ego.stamp_ns[-1])
    stamp, xy, told = stamp[during], xy[during], told[during]
    if len(stamp) < _LEAST_SEEN:
        return None
    first = int(np.searchsorted(ego.stamp_ns, stamp[0]))
    last = int(np.searchsorted(ego.stamp_ns, stamp[-1], side="right"))
    at = ego.stamp_ns[first:last]
    if len(at) * STEP_S < _LEAST_S:
        return None
    typical_s = max(float(np.median(np.diff(stamp))) * 1e-9, STEP_S)
    if len(stamp) * typical_s < _LEAST_SHARE * len(at) * STEP_S:
        return None
    time_s, at_s = (stamp - at[0]) * 1e-9, (at - at[0]) * 1e-9
    even = np.stack([np.interp(at_s, time_s, column) for column in xy.T], axis=1)
    smooth, velocity = (_smoothed(even, _SMOOTH_S, order) for order in (0, 1))
    shaken = xy - np.stack([np.interp(time_s, at_s, column) for column in smooth.T], axis=1)
    speed = np.hypot(*velocity.T)
    if np.sqrt(np.mean(np.sum(shaken**2, axis=1))) > _SHAKES_M or speed.max() > _MOST_MPS:
        return None
    slow = np.hypot(*_smoothed(even, _SLOW_SMOOTH_S, 1).T)
    spread = np.sqrt(np.mean(np.sum((xy - np.median(xy, axis=0)) ** 2, axis=1)))
    stands = np.full(len(at), True) if spread < _SPREAD_M else slow < STANDING_MPS
    kind, size = chain[0].kind, next((p.size_m for p in chain if p.size_m is not None), None)
    box = (KINDS[kind].length_m, KINDS[kind].width_m) if size is None else size
    return OtherCourse(
        user_id=chain[0].user_id,
        kind=kind,
        size_m=box,
        first=first,
        xy_m=smooth,
        velocity_mps=velocity,
        yaw_rad=_heading(velocity, np.minimum(speed, slow), told),
        speed_mps=speed,
        standing=stands,
    )


def _smoothed(values: Array, over_s: float, order: int) -> Array:
    """Return values (N, ...), or a derivative, by parabolas (Savitzky and Golay 1964) as SciPy lays
    them; scipy.signal takes half a second to import. At the ends derivatives are those of the
    nearest whole window's middle: what a parabola adds there is noise."""
    window = min(round(over_s / STEP_S) | 1, (len(values) - 1) | 1)
    window = window if window <= len(values) else window - 2
    half = window // 2
    around = np.arange(-half, half + 1)
    fit = np.linalg.pinv(np.vander(around, 3, increasing=True).astype(np.float64))
    windows = np.lib.stride_tricks.sliding_window_view(values, window, axis=0)
    parabolas = windows @ fit.T
    at = np.concatenate([around[:half], np.zeros(len(parabolas)), around[half + 1 :]])
    which = np.clip(np.arange(len(values)) - half, 0, len(parabolas) - 1)
    slopes = np.array([np.ones(len(at)), at, at**2] if order == 0 else [0.0 * at, at**0, 0.0 * at])
    smoothed: Array = np.einsum("n...k,kn->n...", parabolas[which], slopes)
    return smoothed / STEP_S**order


def _heading(velocity: Array, speed: Array, told: Array) -> Array:
    """Return where somebody heads (K,), without jumps; who never moves as it was told."""
    moves = speed > _HEADS_MPS
    if not moves.any():
        known = told[np.isfinite(told)]
        mean = np.arctan2(np.sin(known).mean(), np.cos(known).mean()) if len(known) else 0.0
        return np.full(len(speed), float(mean))
    course = np.arctan2(velocity[moves, 1], velocity[moves, 0])
    held = np.maximum(np.cumsum(moves) - 1, 0)
    return np.asarray(np.unwrap(course[held]))
