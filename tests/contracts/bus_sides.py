"""Two sides of one bus for tests, in memory or over Zenoh, and waiting for a condition."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.bus import Bus, Mailbox, Received, Request, ZenohBus
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import PrepareRequest
from tests.contracts.memory_bus import MemoryBus

DEADLINE_S = 120.0
"""Long: it costs nothing where all goes well, and a busy machine is no fault of the code."""

ROUTER = """
import sys
from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import PrepareRequest
with ZenohBus(BusSetup(endpoint=sys.argv[1]), router=True):
    print("ready", flush=True)
    sys.stdin.read()
"""

MEMBER = """
import sys
from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import PrepareRequest
with ZenohBus(BusSetup(endpoint=sys.argv[1])) as bus:
    bus.declare_alive(sys.argv[2])
    bus.serve("prepare", Mailbox(1), run="r1", process="w0")
    print("ready", flush=True)
    sys.stdin.read()
"""


class Sides(NamedTuple):
    """`near` and `far` reach each other; `lose` lets a token of `far` vanish."""

    near: Bus
    far: Bus
    lose: Callable[[str], None]


@contextmanager
def memory_sides() -> Iterator[Sides]:
    """Both sides are one MemoryBus."""
    bus = MemoryBus()
    yield Sides(bus, bus, bus.lose)
    bus.close()


@contextmanager
def zenoh_sides(*, lossless: bool = False) -> Iterator[Sides]:
    """A router and two clients, each with a session of its own."""
    setup = BusSetup(endpoint=free_endpoint(), lossless=lossless)
    with ExitStack() as stack:
        stack.enter_context(ZenohBus(setup, router=True))
        near = stack.enter_context(ZenohBus(setup))
        far = stack.enter_context(ZenohBus(setup))
        yield Sides(near, far, lambda _: far.close())


@contextmanager
def python(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a fresh interpreter whose program says `ready`; it is ended with the block."""
    process = subprocess.Popen(
        [sys.executable, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )
    with process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


def take(mailbox: Mailbox, deadline_s: float = DEADLINE_S) -> Any:
    """Return the next item; fails where none comes in time."""
    item = mailbox.take(deadline_s)
    assert item is not None, f"nothing came within {deadline_s} s"
    return item


def take_until(mailbox: Mailbox, wanted: Callable[[Any], bool]) -> Any:
    """Return the first item that is wanted; fails where none comes in time."""
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        item = mailbox.take(0.2)
        if item is not None and wanted(item):
            return item
    raise AssertionError(f"nothing wanted came within {DEADLINE_S} s")


def ask_until_served(sides: Sides, mailbox: Mailbox, replies: Mailbox, tag: object) -> Request:
    """Ask until the question reaches the server: declarations take a moment over Zenoh.

    Each question ends before the next is asked, however late its answer is.
    """
    question = PrepareRequest(world_id="abc")
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        sides.near.request(
            "prepare", question, replies, tag=tag, timeout_s=DEADLINE_S, run="r1", process="w0"
        )
        early = None
        while early is None:
            if (item := mailbox.take(0.02)) is not None:
                return item
            early = replies.take()
        assert early.error == "no answer"
    raise AssertionError("the question never reached the server")


def publish_until_received(sender: Bus, mailbox: Mailbox, *, vehicle: str = "ego") -> Received:
    """Publish a speed of -1 until one lands: from then on sender and receiver know each other."""
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        sender.publish("speed", SpeedSample(stamp_ns=0, speed_mps=-1.0), vehicle=vehicle)
        if (item := mailbox.take(0.05)) is not None:
            assert isinstance(item, Received)
            while mailbox.take_last(0.1) is not None:
                pass
            return item
    raise AssertionError("sender and receiver never met")
