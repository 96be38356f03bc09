"""The link between a live car and a run: a proxy, or where packets shall be lost a device whose
other end lies in a network of its own."""

from __future__ import annotations

import contextlib
import fcntl
import heapq
import itertools
import os
import random
import select
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from foretwin.contracts.ports import LOOPBACK, free_port
from tests.contracts.cut_link import CutLink

DELAY_S = 0.2
LOSS = 0.05
_TUNSETIFF, _IFF_TUN_NO_PI = 0x400454CA, 0x1001
_MTU = 1500


class Link(Protocol):
    """What may befall it; each holds until `mend`."""

    endpoint: str
    """Where the car connects."""
    router: str
    """Where the router listens."""
    prefix: tuple[str, ...]
    """What the car's command line begins with."""

    def befall(self, what: str) -> bool:
        """Cut it, delay it or lose packets; returns whether this link can."""

    def mend(self) -> None:
        """Let all pass again."""


class ProxyLink:
    """A TCP proxy: cuts and delays, and never loses a packet."""

    prefix: tuple[str, ...] = ()

    def __init__(self, proxy: CutLink, router: str) -> None:
        self._proxy, self.router, self.endpoint = proxy, router, proxy.endpoint

    def befall(self, what: str) -> bool:
        """See Link."""
        if what == "cut":
            self._proxy.cut()
        elif what == "delay":
            self._proxy.delay_s = DELAY_S
        return what in ("cut", "delay")

    def mend(self) -> None:
        """See Link."""
        self._proxy.delay_s = 0.0
        self._proxy.mend()


class PacketLink:
    """Two tun devices, one of them in a network of its own, and who carries packets between.

    The other one is in our network, or in that of the process `near`.
    """

    def __init__(self, network: int, name: str, *, seed: int, near: int | None = None) -> None:
        subnet = f"10.{213 + network % 30}.{network % 250}"
        self.router = self.endpoint = f"tcp/{subnet}.1:{free_port()}"
        self.prefix = ("nsenter", "-t", str(network), "-n")
        self._chance = random.Random(seed)
        self.loss, self.delay_s = 0.0, 0.0
        self._over = threading.Event()
        self._ends = [_tun(f"{name}a"), _tun(f"{name}b")]
        self.host = f"{subnet}.1"
        _end(f"{name}a", f"{subnet}.1/30", near)
        _end(f"{name}b", f"{subnet}.2/30", network)
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def befall(self, what: str) -> bool:
        """See Link."""
        self.loss = {"cut": 1.0, "loss": LOSS}.get(what, self.loss)
        self.delay_s = DELAY_S if what == "delay" else self.delay_s
        return True

    def mend(self) -> None:
        """See Link."""
        self.loss = self.delay_s = 0.0

    def close(self) -> None:
        """Take the devices away."""
        self._over.set()
        self._thread.join()
        for end in self._ends:
            os.close(end)

    def _carry(self) -> None:
        waiting: list[tuple[float, int, int, bytes]] = []
        numbers = itertools.count()
        while not self._over.is_set():
            due_s = max(0.0, waiting[0][0] - time.monotonic()) if waiting else 0.1
            for end in select.select(self._ends, [], [], min(due_s, 0.1))[0]:
                with contextlib.suppress(OSError):
                    packet = os.read(end, _MTU + 100)
                    if self._chance.random() >= self.loss:
                        far = self._ends[1 - self._ends.index(end)]
                        at_s = time.monotonic() + self.delay_s
                        heapq.heappush(waiting, (at_s, next(numbers), far, packet))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, far, packet = heapq.heappop(waiting)
                with contextlib.suppress(OSError):
                    os.write(far, packet)


def _tun(name: str) -> int:
    end = os.open("/dev/net/tun", os.O_RDWR | os.O_CLOEXEC)
    fcntl.ioctl(end, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TUN_NO_PI))
    return end


def _end(name: str, address: str, network: int | None) -> None:
    """Move a device into a network, and give it an address there."""
    prefix: tuple[str, ...] = ()
    if network is not None:
        prefix = ("nsenter", "-t", str(network), "-n")
        _ip("link", "set", name, "netns", str(network))
        _ip("link", "set", "lo", "up", prefix=prefix)
    _ip("addr", "add", address, "dev", name, prefix=prefix)
    _ip("link", "set", name, "up", prefix=prefix)


def _ip(*words: str, prefix: tuple[str, ...] = ()) -> None:
    subprocess.run([*prefix, "ip", *words], check=True, capture_output=True)


@contextmanager
def link_for(seed: int, *, packets: bool) -> Iterator[Link]:
    """Give a link; one that can lose `packets` where this user may make devices, else a proxy."""
    with contextlib.ExitStack() as stack:
        link: Link | None = None
        if packets:
            with contextlib.suppress(OSError, subprocess.CalledProcessError):
                link = stack.enter_context(_packet_link(seed))
        if link is None:
            router = f"tcp/{LOOPBACK}:{free_port()}"
            link = ProxyLink(stack.enter_context(CutLink(router)), router)
        yield link


@contextmanager
def own_network() -> Iterator[int]:
    """Give a process in a network of its own; raises OSError where this user may have none."""
    holder = subprocess.Popen(
        ["unshare", "-n", "sh", "-c", "echo there; exec sleep 7200"], stdout=subprocess.PIPE
    )
    try:
        assert holder.stdout is not None
        if holder.stdout.readline() != b"there\n":
            raise OSError("no network of its own here")
        yield holder.pid
    finally:
        holder.kill()
        holder.communicate()


@contextmanager
def _packet_link(seed: int) -> Iterator[PacketLink]:
    with own_network() as network:
        link = PacketLink(network, f"ft{os.getpid() % 100_000}", seed=seed)
        try:
            yield link
        finally:
            link.close()
