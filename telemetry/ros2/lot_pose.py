"""Where a car behind ROS 2 is on its lot, before a drive, by listening to it.

`python -m foretwin.telemetry.ros2.lot_pose` is a process of its own, since who starts a drive has
no bus. What is asked comes as JSON on stdin, the answer goes to stdout.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import msgspec

from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.bus import BusUnreachable
from foretwin.contracts.foreign_bus import ForeignBus, ZenohForeignBus
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.telemetry.first_pose import FirstPose
from foretwin.telemetry.ros2.introduction import Introduction
from foretwin.telemetry.ros2.inwards import Inwards
from foretwin.telemetry.ros2.mapping import Mapping, parse_mapping

_ANTENNA_NS = 1_500_000_000
"""So long transforms are waited for that may say where the antenna sits."""


class LotPoseAsked(msgspec.Struct, frozen=True, kw_only=True):
    """Which car, of which scale, and how long to wait for it."""

    mapping: str
    """The text of the mapping file, which names an endpoint."""
    mapping_name: str
    vehicle: VehicleParameters
    scale: float
    wait_s: float


class LotPose(msgspec.Struct, frozen=True, kw_only=True):
    """The car's first settled pose on its lot; None with what it lacked in the end."""

    pose: AnchorPose | None
    lacks: str = ""


def hear_lot_pose(
    mapping: Mapping,
    asked: LotPoseAsked,
    *,
    foreign: ForeignBus,
    mono_ns: Callable[[], int] = time.monotonic_ns,
) -> LotPose:
    """Listen to a car until its pose is settled or the time is over; blocks."""
    inwards, mailbox = Inwards(mapping), Mailbox(2048)
    introduction = Introduction(mapping, inwards, vehicle_id="ego")
    for key, history, bulky in inwards.key_expressions():
        if not bulky:
            foreign.subscribe(key, mailbox, history=history)
    watch, begin_ns = None, mono_ns()
    while mono_ns() - begin_ns < asked.wait_s * 1e9:
        arrived: Any = mailbox.take(0.05)
        while arrived is not None:
            samples = inwards.take(arrived)
            now_ns = arrived.received_mono_ns
            info = introduction.info() if watch is None else None
            if info is not None and (not inwards.awaits_antenna or now_ns - begin_ns > _ANTENNA_NS):
                watch = FirstPose(info, asked.vehicle, scale=asked.scale)
            for channel, message in samples:
                if watch is None:
                    break
                if (pose := watch.take(channel, message, received_ns=now_ns)) is not None:
                    return LotPose(pose=pose)
            arrived = mailbox.take()
    return LotPose(pose=None, lacks="nothing was heard of it" if watch is None else watch.lacks)


def main() -> None:
    """Answer the question on stdin."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # who asks tells of it
    asked = msgspec.json.decode(sys.stdin.buffer.read(), type=LotPoseAsked)
    mapping = parse_mapping(asked.mapping, name=asked.mapping_name)
    try:
        with ZenohForeignBus(BusSetup(endpoint=mapping.endpoint or "")) as foreign:
            found = hear_lot_pose(mapping, asked, foreign=foreign)
    except BusUnreachable as nobody:
        found = LotPose(pose=None, lacks=str(nobody))
    sys.stdout.buffer.write(msgspec.json.encode(found))


if __name__ == "__main__":
    main()
