"""Bringing samples of several sensors into the order of their stamps."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator

from foretwin.telemetry.logs.log import Sample


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
