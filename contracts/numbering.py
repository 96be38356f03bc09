"""What is missing by the senders' numbering, whatever order, doubling or restart brings.

Each sender numbers what it sends on a channel from 0 on, and its id tells its numbers from those
of others. Who begins anew has another id; where none is told, the sender's clock tells lives apart.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterable

import msgspec

MOST_GAP = 30_000
"""Five minutes at 100 Hz: who is farther ahead goes on with another numbering."""
MOST_HOLES = 256
"""Of one numbering; what comes late into an older one is not taken any more."""
MOST_STREAMS = 256
"""Of all channels; of the one that was silent for longest only the counts are kept."""
_LIVES = 4
"""Numberings of one sender on one channel."""
_BEGINS_BELOW = 64
"""Who is heard by this number at the latest began at 0: what came before it is missing."""


class Numbering(msgspec.Struct):
    """One sender's count on one channel: what comes next, and what has not come yet."""

    channel: str
    first: int
    next: int
    newest_sent_ns: int = 0
    """By the clock of a sender that does not tell who it is."""
    holes: list[tuple[int, int]] = []
    """What has not come: first number, and the one after the last."""
    given_up: int = 0
    """Numbers of holes that were too many to be kept."""

    @property
    def missing(self) -> int:
        """How many numbers have not come."""
        return self.given_up + sum(end - begin for begin, end in self.holes)

    def is_next(self, seq: int) -> bool:
        """Whether a number goes on with this count."""
        return 0 <= seq - self.next <= MOST_GAP

    def go_on(self, seq: int, sent_ns: int) -> None:
        """Take a number that is not behind."""
        if seq > self.next:
            self.reach(seq)
        self.next = seq + 1
        self.newest_sent_ns = max(self.newest_sent_ns, sent_ns)

    def fill(self, seq: int, sent_ns: int) -> bool:
        """Take a number that was missing, or before the first; returns whether it was.

        What was sent after the newest is neither: its sender numbers anew.
        """
        if seq >= self.next or sent_ns > self.newest_sent_ns:
            return False
        if 0 < self.first - seq <= MOST_GAP:
            self.holes.insert(0, (seq, self.first))
            self.first = seq
        for place, (begin, end) in enumerate(self.holes):
            if begin <= seq < end:
                left = ((begin, seq), (seq + 1, end))
                self.holes[place : place + 1] = [one for one in left if one[0] < one[1]]
                self._forget_old_holes()
                return True
        return False

    def reach(self, count: int) -> None:
        """Count as missing what has not come below a number."""
        if count > self.next:
            self.holes.append((self.next, count))
            self.next = count
        self._forget_old_holes()

    def _forget_old_holes(self) -> None:
        while len(self.holes) > MOST_HOLES:
            begin, end = self.holes.pop(0)
            self.given_up += end - begin

    def give_back(self, seqs: Iterable[int]) -> None:
        """Count as missing what has come, in ascending order."""
        for seq in seqs:
            if self.holes and self.holes[-1][1] == seq:
                self.holes[-1] = (self.holes[-1][0], seq + 1)
            else:
                self.holes.append((seq, seq + 1))
        self.holes.sort()


@functools.lru_cache(maxsize=1024)
def _names(channel: str, sender: int | str) -> tuple[str, ...]:
    """Return what the numberings of one sender on one channel are called."""
    return tuple(f"{channel} {sender}.{life}" for life in range(_LIVES))


class Numberings(msgspec.Struct):
    """The numberings of all senders on all channels."""

    streams: dict[str, Numbering] = {}
    """The one heard last at the end."""
    past: dict[str, tuple[int, int]] = {}
    """By channel, numbers and missing ones of numberings that are not kept any more."""
    doubled: int = 0
    """Messages that had come before."""

    def take(
        self, channel: str, seq: int, *, sender: int | str = 0, sent_ns: int = 0
    ) -> str | None:
        """Take one message's number; returns the name of its numbering, None where it had come.

        `sender` is 0 where none is told: then its clock, `sent_ns`, says whether a number that is
        behind is late or of one that numbers anew.
        """
        if sender:
            sent_ns = 0
        lives = self._lives(channel, sender)
        if len(lives) == 1:  # nearly all there are: the next one of its only numbering
            ((name, one),) = lives.items()
            if seq == one.next:
                self.streams[name] = self.streams.pop(name)
                one.go_on(seq, sent_ns)
                return name
        for name, one in lives.items():
            if one.fill(seq, sent_ns):
                return name
        fits = {name: one for name, one in lives.items() if one.is_next(seq)}
        if fits:
            name = min(fits, key=lambda life: seq - fits[life].next)
        elif any(
            0 <= one.next - 1 - seq <= MOST_GAP and sent_ns <= one.newest_sent_ns
            for one in lives.values()
        ):
            self.doubled += 1
            return None
        else:
            name = self._begin(channel, sender, seq)
        stream = self.streams[name] = self.streams.pop(name)
        stream.go_on(seq, sent_ns)
        return name

    def take_up(self, channel: str, seq: int) -> bool:
        """Take a number whose sender is not told: of who was heard last first; returns whether it
        had not come."""
        for one in reversed([one for one in self.streams.values() if one.channel == channel]):
            if one.fill(seq, one.newest_sent_ns):
                return True
            if one.is_next(seq):
                one.go_on(seq, one.newest_sent_ns)
                return True
        return False

    def reach(self, channel: str, count: int, *, sender: int | str = 0) -> None:
        """Count as missing what has not come of the first `count` messages of a sender."""
        lives = [*self._lives(channel, sender)]
        name = lives[-1] if lives else self._begin(channel, sender, 0)
        self.streams[name].reach(count)

    def _lives(self, channel: str, sender: int | str) -> dict[str, Numbering]:
        streams = self.streams
        return {name: streams[name] for name in _names(channel, sender) if name in streams}

    def _begin(self, channel: str, sender: int | str, seq: int) -> str:
        """Begin a numbering in the place of a sender's oldest one; returns its name."""
        anew = channel in self.past or any(one.channel == channel for one in self.streams.values())
        first = 0 if anew and 0 <= seq <= _BEGINS_BELOW else seq
        names = _names(channel, sender)
        name = next((one for one in names if one not in self.streams), None)
        if name is None:
            name = next(one for one in self.streams if one in names)
            self._forget(name)
        elif len(self.streams) >= MOST_STREAMS:
            self._forget(next(iter(self.streams)))
        self.streams[name] = Numbering(channel, first, first)
        return name

    def _forget(self, name: str) -> None:
        one = self.streams.pop(name)
        published, missing = self.past.get(one.channel, (0, 0))
        self.past[one.channel] = (published + one.next - one.first, missing + one.missing)

    @property
    def missing(self) -> Counter[str]:
        """How many messages have not come, by channel."""
        found = Counter({channel: missing for channel, (_, missing) in self.past.items()})
        for one in self.streams.values():
            found[one.channel] += one.missing
        return found

    @property
    def published(self) -> Counter[str]:
        """How many messages there must have been, by channel, since each sender was first heard."""
        found = Counter({channel: published for channel, (published, _) in self.past.items()})
        for one in self.streams.values():
            found[one.channel] += one.next - one.first
        return found
