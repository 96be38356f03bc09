"""What is known of a channel of the bus: its type, rate, quality of service, and who may say it."""

from __future__ import annotations

from typing import Literal, NamedTuple

import msgspec

from foretwin.contracts.bounds import MOST_BYTES, MOST_SAMPLE_BYTES

Priority = Literal["real_time", "interactive_high", "data_high", "data", "background"]


class Qos(NamedTuple):
    """Zenoh's priority, whether a full queue drops or blocks, and whether batching is skipped.

    Live, who sends keeps the last `kept_s` seconds at the usual rate, for who asks for what it
    missed.
    """

    priority: Priority
    block: bool
    express: bool
    kept_s: float = 0.0


LIVE = Qos("interactive_high", block=False, express=False)
RECORDED = LIVE._replace(kept_s=20.0)
"""Longer than a recorder that hangs takes to be killed (4 s) and to be there again (2 s), with room
for a car that sends twice as often as usual."""
RESULT = Qos("data_high", block=False, express=False)
WATCH = Qos("data", block=False, express=False)
REQUEST = Qos("interactive_high", block=True, express=True)
LOCK_STEP = Qos("interactive_high", block=False, express=True)
"""Of what one side waits for: a batch that waited for more would hold both up."""


BusRole = Literal["car", "orchestrator", "worker", "viewer", "recorder", "planner", "operator"]
"""Who somebody is on the bus. Workers are also mirror, tuning and builder; the car is who speaks
for a vehicle, the planner a driving stack under test, the operator who steers a running drive."""


class Writer(NamedTuple):
    """Who may publish, or ask: a role, or of it the one process of that name alone."""

    role: BusRole
    process: str | None = None


class Channel(NamedTuple):
    """What a channel says, how often and what for; `reply` is the answer to a question.

    `rate_hz` is the usual rate, None where it is on demand. Key, quality of service and who may say
    it are those of the group in which it stands; who answers a question is whom its key names.
    """

    kind: type[msgspec.Struct]
    rate_hz: float | None
    purpose: str
    reply: type[msgspec.Struct] | None = None
    key: str = ""
    qos: Qos = LIVE
    writers: tuple[Writer, ...] = ()

    @property
    def server(self) -> BusRole | None:
        """Who answers, where it is a question."""
        if self.reply is None:
            return None
        if "/vehicle/" in self.key:
            return "car"
        return "worker" if "{process}" in self.key else "orchestrator"

    @property
    def most_bytes(self) -> int:
        """How large a message may be."""
        return MOST_SAMPLE_BYTES if self.qos in (LIVE, RECORDED) else MOST_BYTES
