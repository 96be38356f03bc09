"""Samples that come out of order, put back in order: the motion is computed anew from there."""

from __future__ import annotations

import bisect
from collections import Counter, deque
from typing import Any, NamedTuple

from foretwin.telemetry.estimator.motion_track import MotionTrack

WINDOW_NS = 300_000_000
"""A sample that comes later than this behind the newest is too late to count."""
_CHECKPOINT_NS, _CALM_CHECKPOINT_NS = 20_000_000, 100_000_000
"""How far apart copies of the track lie, and where no sample came late for `_CALM_NS`: a copy costs
more than to take three samples again."""
_CALM_NS = 5_000_000_000
_MOST_WAITING = 2048
_ORDER = ("speed", "imu", "heading", "steering", "gnss")


def rank_in_instant(channel: str) -> int:
    """Return where of an instant's samples those of a channel are taken.

    Speed first, by which a yaw rate tells a bend; the position last of what says how the car moves,
    for a state leaves with it.
    """
    return _ORDER.index(channel) if channel in _ORDER else len(_ORDER)


class Sample(NamedTuple):
    """One sample in its place: continuous stamp, rank of its channel, number of arrival, which no
    other has, so that no two compare beyond it."""

    stamp_ns: int
    rank: int
    number: int
    channel: str
    message: Any


class _Checkpoint(NamedTuple):
    stamp_ns: int
    track: MotionTrack


class Reordering:
    """Keeps the last samples and a track every now and then, to begin anew from any.

    In order a sample costs what it costs the track; one that is late makes those after it be taken
    once more, at the next state. `late` and `doubled` count what was left out, by channel.
    """

    def __init__(self, track: MotionTrack) -> None:
        self.late: Counter[str] = Counter()
        self.doubled: Counter[str] = Counter()
        self.newest: Sample | None = None
        """The sample with the newest stamp so far."""
        self._head = track
        self._samples: list[Sample] = []
        self._taken = 0
        """How many of `_samples` the head has taken."""
        self._checkpoints: deque[_Checkpoint] = deque()
        """The first lies before all samples that may yet come."""
        self._seen: set[tuple[str, int]] = set()
        self._number = 0
        self._late_ns: int | None = None
        """The newest stamp as a sample came before others that were taken already."""

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what can be computed again: from the first checkpoint all samples are."""
        if not self._checkpoints:
            return self.__dict__
        first = self._checkpoints[0]
        place = self._place_after(first.stamp_ns)
        again = {"_checkpoints": deque([first]), "_head": first.track, "_taken": place}
        return self.__dict__ | again

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._head = self._head.copy()

    @property
    def waiting(self) -> int:
        """How many samples are kept for those that may yet come before them."""
        return len(self._samples)

    def add(self, channel: str, message: Any) -> bool:
        """Put a sample in its place; returns whether it counts."""
        stamp_ns: int = message.stamp_ns
        if len(self._samples) > _MOST_WAITING:
            self.track()
        if self.newest is not None and stamp_ns < max(
            self.newest.stamp_ns - WINDOW_NS, self._checkpoints[0].stamp_ns + 1
        ):
            self.late[channel] += 1
            return False
        if (channel, stamp_ns) in self._seen:
            self.doubled[channel] += 1
            return False
        if not self._checkpoints:
            self._keep(stamp_ns - WINDOW_NS - 1)
        self._seen.add((channel, stamp_ns))
        self._number += 1
        sample = Sample(stamp_ns, rank_in_instant(channel), self._number, channel, message)
        place = len(self._samples)
        if place and sample < self._samples[-1]:
            place = bisect.bisect(self._samples, sample)
        self._samples.insert(place, sample)
        if place < self._taken or stamp_ns <= self._checkpoints[-1].stamp_ns:
            self._go_back(place)
        # A line of the map is no news of the car, only of where its newest state lies.
        if channel != "map" and (self.newest is None or sample > self.newest):
            self.newest = sample
        return True

    def _go_back(self, place: int) -> None:
        """Begin anew before the sample at `place`."""
        stamp_ns = self._samples[place].stamp_ns
        self._late_ns = self._samples[-1].stamp_ns
        while len(self._checkpoints) > 1 and self._checkpoints[-1].stamp_ns >= stamp_ns:
            self._checkpoints.pop()
        checkpoint = self._checkpoints[-1]
        self._head = checkpoint.track.copy()
        self._taken = self._place_after(checkpoint.stamp_ns)

    def track(self) -> MotionTrack:
        """Return the track with all samples taken; it stays this object's own."""
        while self._taken < len(self._samples):
            sample = self._samples[self._taken]
            if self._taken:
                before_ns = self._samples[self._taken - 1].stamp_ns
                due_ns = self._checkpoints[-1].stamp_ns + self._apart_ns(before_ns)
                if due_ns <= before_ns < sample.stamp_ns:
                    self._keep(before_ns)
            self._head.take(sample.channel, sample.message)
            self._taken += 1
        self._forget()
        return self._head

    def _place_after(self, stamp_ns: int) -> int:
        """Return how many samples are of this stamp or before."""
        return bisect.bisect(self._samples, stamp_ns, key=lambda sample: sample.stamp_ns)

    def _apart_ns(self, stamp_ns: int) -> int:
        """Return how far apart copies shall lie."""
        calm = self._late_ns is None or stamp_ns - self._late_ns > _CALM_NS
        return _CALM_CHECKPOINT_NS if calm else _CHECKPOINT_NS

    def _keep(self, stamp_ns: int) -> None:
        self._checkpoints.append(_Checkpoint(stamp_ns, self._head.copy()))

    def _forget(self) -> None:
        """Drop what no sample can reach any more."""
        if self.newest is None:
            return
        horizon_ns = self.newest.stamp_ns - WINDOW_NS
        while len(self._checkpoints) > 1 and self._checkpoints[1].stamp_ns < horizon_ns:
            self._checkpoints.popleft()
        if len(self._samples) > _MOST_WAITING:
            self._checkpoints.clear()
            self._keep(self._samples[-1].stamp_ns)
        first_ns = self._checkpoints[0].stamp_ns
        if self._samples and self._samples[0].stamp_ns > first_ns:
            return
        gone = self._place_after(first_ns)
        for sample in self._samples[:gone]:
            self._seen.discard((sample.channel, sample.stamp_ns))
        del self._samples[:gone]
        self._taken -= gone
