"""Publishers that keep what they sent, and subscribers that ask for what they missed.

Zenoh's advanced pub/sub: a publisher keeps its last samples and tells their number; a subscriber
that finds one missing, sees a publisher come (back), or comes late itself, asks for them. Plain
subscribers hear such a publisher as any other, and such a subscriber hears plain publishers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from foretwin.contracts.keys import Channel

LEAST_KEPT = 64
"""Of a channel that speaks now and then."""
HEARTBEAT_S = 1.0
"""So often a publisher tells its latest number: a last sample that was lost is missed then."""


def most_kept(channel: Channel) -> int:
    """Return how many samples a publisher keeps of a channel, 0 where none."""
    if not channel.qos.kept_s:
        return 0
    return max(LEAST_KEPT, math.ceil((channel.rate_hz or 0.0) * channel.qos.kept_s))


def keeping_publisher(ext: Any, session: Any, key: str, *, samples: int, **qos: Any) -> Any:
    """Return a publisher on a Zenoh session that keeps its last `samples`; `ext` is zenoh.ext."""
    return ext.declare_advanced_publisher(
        session,
        key,
        cache=ext.CacheConfig(samples),
        sample_miss_detection=ext.MissDetectionConfig(
            heartbeat=HEARTBEAT_S, sporadic_heartbeat=None
        ),
        publisher_detection=True,
        **qos,
    )


def recovering_subscriber(
    ext: Any, session: Any, key: str, land: Callable[[Any], None], *, samples: int
) -> Any:
    """Return a subscriber that asks for what it missed, and for the last `samples` before it.

    What one publisher sent comes once and in order; `ext` is zenoh.ext.
    """
    return ext.declare_advanced_subscriber(
        session,
        key,
        land,
        history=ext.HistoryConfig(detect_late_publishers=True, max_samples=samples),
        recovery=ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
    )
