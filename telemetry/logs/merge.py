"""Bringing samples of several sensors, or files, into the order of their stamps."""

from __future__ import annotations

import heapq
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

import msgspec

from foretwin.telemetry.logs.log import FILE_CUT_SHORT, PART_MISSING, Log, Sample

LATE_NS = 30_000_000_000
"""What a recorder catches up on, in a part of its own, is older than the end of the part before by
at most this."""

WINDOW_NS = 2_000_000_000
"""How late a sample may lie in its file and still be put in order."""


def stamp_ns_of(sample: Sample) -> int:
    """Return a sample's stamp."""
    return sample[1].stamp_ns  # type: ignore[attr-defined, no-any-return]


def merged(*streams: Iterable[Sample]) -> Iterator[Sample]:
    """Merge streams that each rise in time; at equal stamps the earlier stream comes first.

    A stream whose clock runs backwards still ends up complete, with the fault in its own order.
    """
    return heapq.merge(*streams, key=stamp_ns_of)


def reordered(samples: Iterable[Sample], *, window_ns: int) -> Iterator[Sample]:
    """Sort a stream whose samples come at most `window_ns` late; later ones stay out of order."""
    waiting: list[tuple[int, int, Sample]] = []
    newest_ns = None
    for count, sample in enumerate(samples):
        stamp_ns = stamp_ns_of(sample)
        heapq.heappush(waiting, (stamp_ns, count, sample))
        newest_ns = stamp_ns if newest_ns is None else max(newest_ns, stamp_ns)
        while waiting and waiting[0][0] < newest_ns - window_ns:
            yield heapq.heappop(waiting)[2]
    while waiting:
        yield heapq.heappop(waiting)[2]


def together(first: Log, second: Log, *, stamp_ns: Callable[[int], int]) -> Log:
    """Return two recordings of one drive as one, on the first's clock.

    `stamp_ns` turns the second's stamps into the first's. Of the second what the first does not
    have is taken, as long as the first lasts: two receivers on one channel would be one that leaps.
    """
    taken = frozenset(second.info.sends) - frozenset(first.info.sends)
    start_ns, end_ns = first.info.start_stamp_ns, first.info.end_stamp_ns

    def moved(skipped: Counter[str]) -> Iterator[Sample]:
        for channel, message in second.read(skipped):
            if channel not in taken:
                continue
            at_ns = stamp_ns(message.stamp_ns)  # type: ignore[attr-defined]
            if at_ns >= start_ns and (end_ns is None or at_ns <= end_ns):
                yield channel, msgspec.structs.replace(message, stamp_ns=at_ns)

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        return merged(first.read(skipped), moved(skipped))

    sends = (*first.info.sends, *(name for name in second.info.sends if name in taken))
    return Log(info=msgspec.structs.replace(first.info, sends=sends), read=read)


def in_parts(logs: Sequence[Log], *, unreadable: int = 0, missing: int = 0) -> Log:
    """Return the parts of one recording as one drive.

    `unreadable` parts count as cut short, those that are not there as `missing`.
    """
    ends = [log.info.end_stamp_ns for log in logs]
    sends = tuple(dict.fromkeys(name for log in logs for name in log.info.sends))
    info = msgspec.structs.replace(
        logs[0].info,
        end_stamp_ns=None if None in ends else max(end for end in ends if end is not None),
        sends=sends,
    )

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if unreadable:
            skipped[FILE_CUT_SHORT] += unreadable
        if missing:
            skipped[PART_MISSING] += missing
        parts = (log.read(skipped) for log in logs)
        return reordered(itertools.chain.from_iterable(parts), window_ns=LATE_NS)

    return Log(info=info, read=read)
