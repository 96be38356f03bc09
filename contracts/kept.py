"""Publishers that keep what they sent, and subscribers that ask for what they missed.

Zenoh's advanced pub/sub: a publisher keeps its last samples and tells their number; a subscriber
that finds one missing, or comes late itself, asks for them. Plain subscribers hear such a publisher
as any other, and such a subscriber hears plain publishers.
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


def keeping_publisher(zenoh: Any, session: Any, key: str, *, samples: int, **qos: Any) -> Any:
    """Return a publisher that keeps its last `samples`; `zenoh` is the module."""
    return zenoh.ext.declare_advanced_publisher(
        session,
        key,
        cache=zenoh.ext.CacheConfig(samples),
        sample_miss_detection=zenoh.ext.MissDetectionConfig(
            heartbeat=HEARTBEAT_S, sporadic_heartbeat=None
        ),
        publisher_detection=True,
        **qos,
    )


def recovering_subscriber(
    zenoh: Any, session: Any, key: str, land: Callable[[Any], None], *, samples: int
) -> Any:
    """Return a subscriber that asks for what it missed, and for the last `samples` before it.

    What was before it can come twice and out of order; `zenoh` is the module.
    """
    subscriber = zenoh.ext.declare_advanced_subscriber(
        session, key, land, recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    )

    def land_kept(reply: Any) -> None:
        if reply.ok is not None:
            land(reply.ok)

    # Not by the subscriber's own history (1.10): where a live sample comes before the first kept
    # one, it takes all that is kept for old, 7 times of 15 for a car that drives.
    session.get(
        f"{key}/@adv/**?_max={samples}",
        land_kept,
        consolidation=zenoh.ConsolidationMode.NONE,
        accept_replies=zenoh.ReplyKeyExpr.ANY,
    )
    return subscriber
