"""Road users played back as they were recorded: where each is at any time of a job."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.futures import RecordedRoadUser

_AT_SAMPLE_S = 1e-9
"""So near to a sample's time is at it."""


class ReplayMoment(NamedTuple):
    """T road users at one time, or at those of S futures, all (1 or S, T).

    `node` is the sample before, counted from each one's first, `share` the way to the next, and
    `speed_mps` NaN where `gone`.
    """

    node: Indices
    share: Array
    speed_mps: Array
    gone: Flags


class Replay:
    """T recorded road users as arrays; their samples (N, 3) of poses are in `tracks`, with yaws
    without jumps.

    Raises ValueError for one whose samples do not fit together, do not rise in time, or are not
    finite.
    """

    def __init__(self, users: Sequence[RecordedRoadUser]) -> None:
        for user in users:
            _check(user)
        self.tracks: tuple[Array, ...] = tuple(_unwrapped(user.poses) for user in users)
        counts = np.array([len(track) for track in self.tracks], dtype=np.intp)
        self._begin = np.cumsum(counts) - counts
        self._last_start = np.maximum(counts - 2, 0)
        self._time_s = np.concatenate([user.time_s for user in users])
        self._speed = np.concatenate([user.speed_mps for user in users])
        self._gone_after = np.concatenate([user.gone_after for user in users]).astype(bool)
        self._gone_after[self._begin + counts - 1] = True
        self._first_s = self._time_s[self._begin]
        self._end_s = self._time_s[self._begin + counts - 1]
        # One search for all: everybody's times are moved behind those of the one before.
        span_s = float(self._end_s.max() - self._first_s.min()) + 1.0
        self._moved_s = np.arange(len(users)) * span_s
        self._sorted_s = self._time_s + np.repeat(self._moved_s, counts)

    def __len__(self) -> int:
        return len(self.tracks)

    def at(self, time_s: float | Array) -> ReplayMoment:
        """Return where everybody is at a time, or at times (S, 1), from the job's state."""
        now = np.asarray(time_s, dtype=np.float64).reshape(-1, 1)
        inside = np.minimum(np.maximum(now, self._first_s), self._end_s)
        node = np.searchsorted(self._sorted_s, inside + self._moved_s, side="right") - 1
        node = np.minimum(np.maximum(node - self._begin, 0), self._last_start)
        before = self._begin + node
        after = np.minimum(before + 1, len(self._time_s) - 1)
        since, step = inside - self._time_s[before], self._time_s[after] - self._time_s[before]
        # Who has one sample alone has no next one: what comes after is somebody else's.
        share = np.minimum(np.maximum(since / np.where(step > 0.0, step, np.inf), 0.0), 1.0)
        between = (since > _AT_SAMPLE_S) & (since < step - _AT_SAMPLE_S)
        gone = np.abs(now - inside) > _AT_SAMPLE_S
        gone |= self._gone_after[before] & between
        speed = self._speed[before] + share * (self._speed[after] - self._speed[before])
        return ReplayMoment(node, share, np.where(gone, np.nan, speed), gone)


def _unwrapped(poses: Array) -> Array:
    found = np.array(poses, dtype=np.float64)
    found[:, 2] = np.unwrap(found[:, 2])
    return found


def _check(user: RecordedRoadUser) -> None:
    count, who = len(user.time_s), f"recorded road user {user.user_id!r}"
    shapes = (user.poses.shape, user.speed_mps.shape, user.gone_after.shape)
    if count == 0 or shapes != ((count, 3), (count,), (count,)):
        raise ValueError(f"{who}: {count} times do not go with poses, speeds, flags of {shapes}")
    finite = (np.isfinite(v).all() for v in (user.time_s, user.poses, user.speed_mps))
    if not all(finite):
        raise ValueError(f"{who}: a sample is not finite")
    if (np.diff(user.time_s) <= 0.0).any():
        raise ValueError(f"{who}: times do not rise")
