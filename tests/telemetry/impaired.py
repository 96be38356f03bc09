"""A bad network and a foreign clock between a car and who listens: pure, by seed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np


class Arrival(NamedTuple):
    """A sample as it comes in, and when by the receiver's clock."""

    channel: str
    message: Any
    received_ns: int


class Network(NamedTuple):
    """What it does to each sample by itself; uniform jitter beyond `delay_s`, so orders change."""

    loss: float = 0.2
    doubled: float = 0.02
    delay_s: float = 0.01
    jitter_s: float = 0.05


class ForeignClock(NamedTuple):
    """The vehicle's clock against the receiver's: `ahead_s` at the first sample, then faster."""

    ahead_s: float = 0.0
    fast_ppm: float = 0.0


PERFECT = Network(loss=0.0, doubled=0.0, delay_s=0.0, jitter_s=0.0)
BAD = Network()
SAME_CLOCK = ForeignClock()


def impaired(
    samples: Iterable[tuple[str, Any]],
    network: Network,
    *,
    clock: ForeignClock = SAME_CLOCK,
    seed: int = 0,
) -> list[Arrival]:
    """Return what arrives of `samples`, in the order of its arrival."""
    random = np.random.default_rng(seed)
    arrivals: list[Arrival] = []
    first_ns: int | None = None
    for channel, message in samples:
        first_ns = message.stamp_ns if first_ns is None else first_ns
        true_ns = (message.stamp_ns - first_ns) / (1.0 + clock.fast_ppm * 1e-6)
        sent_ns = first_ns + round(true_ns - clock.ahead_s * 1e9)
        if random.random() < network.loss:
            continue
        for _ in range(2 if random.random() < network.doubled else 1):
            delay_s = network.delay_s + network.jitter_s * random.random()
            arrivals.append(Arrival(channel, message, sent_ns + round(delay_s * 1e9)))
    return sorted(arrivals, key=lambda arrival: arrival.received_ns)
