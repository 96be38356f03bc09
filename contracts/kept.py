"""Publishers that keep what they sent, and subscribers that ask for what they missed.

Zenoh's advanced pub/sub: a publisher keeps its last samples and tells their number; a subscriber
that finds one missing, or comes late itself, asks for them. Plain subscribers hear such a publisher
as any other, and such a subscriber hears plain publishers.
"""

from __future__ import annotations

import math
from collections import deque
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


def recovering_subscriber(zenoh: Any, session: Any, key: str, land: Callable[[Any], None]) -> Any:
    """Return a subscriber that asks for what it finds missing; `zenoh` is the module.

    Its question may reach a publisher whose link is just coming back, and find nothing: it does not
    ask again. Nor is its own way to ask for the past used (1.10): where a live sample comes before
    the first kept one, it takes all that is kept for old, 7 times of 15 for a car that drives.
    Both is what `ask_for_kept` is for.
    """
    recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
    return zenoh.ext.declare_advanced_subscriber(session, key, land, recovery=recovery)


def ask_for_kept(
    zenoh: Any, session: Any, key: str, land: Callable[[Any], None], *, samples: int
) -> None:
    """Let the last `samples` that each publisher of a key keeps land, in any order, and some that
    have come before; `zenoh` is the module."""

    def land_kept(reply: Any) -> None:
        if reply.ok is not None:
            land(reply.ok)

    session.get(
        f"{key}/@adv/**?_max={samples}",
        land_kept,
        consolidation=zenoh.ConsolidationMode.NONE,
        accept_replies=zenoh.ReplyKeyExpr.ANY,
    )


class SentLately:
    """What a session sent last of the channels that are kept, for one that takes its place: the
    publishers that keep it go with their session."""

    def __init__(self) -> None:
        self._of_key: dict[str, deque[bytes]] = {}

    def add(self, channel: Channel, key: str, data: bytes) -> None:
        """Take what is sent."""
        samples = self._of_key.get(key)
        if samples is None:
            samples = self._of_key[key] = deque(maxlen=most_kept(channel))
        samples.append(data)

    def answers(self, session: Any) -> list[Any]:
        """Return what answers in another session who asks for what was kept until now."""
        return [
            session.declare_queryable(f"{key}/@adv/before", _answering(key, tuple(samples)))
            for key, samples in self._of_key.items()
            if samples
        ]


def _answering(key: str, samples: tuple[bytes, ...]) -> Callable[[Any], None]:
    def land(query: Any) -> None:
        with query:
            for data in samples:
                query.reply(key, data)

    return land
