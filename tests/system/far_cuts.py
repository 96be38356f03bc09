"""How soon a worker on another machine is heard again after its link was cut.

`python -m tests.system.far_cuts --cuts 10 --seconds 5` prints it as JSON. The router and who asks
are in one network, the worker is in another, over TLS; asked is for the worker's clock, over and
over.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.bus import Alive, Mailbox, Reply, ZenohBus
from foretwin.contracts.campaign import role_files
from foretwin.contracts.fleet import ClockQuestion, far_id
from foretwin.contracts.keys import alive_key
from foretwin.contracts.setup import BusSetup, FarWorkerSetup, write_setup
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.record.machine import this_machine
from tests.chaos.link import PacketLink, own_network
from tests.chaos.outsiders import Outsider
from tests.contracts.bus_sides import DEADLINE_S
from tests.orchestrator.campaign.campaigns import campaign, now

PORT, RUN, WORKER = 7447, "r1", far_id("laptop", 0)
SLOW_S = 0.2
_ASKS_EVERY_S, _WAITS_S, _APART_S = 0.05, 0.5, 3.0


class Heard(NamedTuple):
    """When a worker was heard first after a link was back, in seconds from then."""

    token_s: float
    answer_s: float


class FarLink:
    """A worker in a network of its own, and who asks it; use it as a context."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._stack = folder, contextlib.ExitStack()

    def __enter__(self) -> FarLink:
        stack, folder = self._stack, self._folder
        near, far = (stack.enter_context(own_network()) for _ in range(2))
        self.link = PacketLink(far, f"fl{os.getpid() % 10_000}", seed=1, near=near)
        stack.callback(self.link.close)
        endpoint = f"tls/{self.link.host}:{PORT}"
        files = campaign(folder / "campaign")
        issue(files, "router", days=2, now=now(), hosts=(self.link.host,))
        issue(files, "worker-laptop", days=2, now=now())
        self._file = folder / "heard.jsonl"
        asks = (sys.executable, "-m", "tests.system.far_cuts", "--ask", endpoint,
                str(files), str(self._file))  # fmt: skip
        self._asker = Outsider("asker", ("nsenter", "-t", str(near), "-n", *asks), folder)
        stack.callback(self._asker.close)
        setup = FarWorkerSetup(
            run_id=RUN, process_id=WORKER, vehicle_id="far", log_file=str(folder / "far.jsonl"),
            bus=BusSetup(endpoint=endpoint, tls=role_files(files, "worker-laptop")),
            machine=this_machine(), cache_dir=str(folder / "worlds"),
        )  # fmt: skip
        write_setup(setup, folder / "far.json")
        plays = (sys.executable, "-m", "foretwin.sim_worker.far", "--setup",
                 str(folder / "far.json"))  # fmt: skip
        self._worker = Outsider("far", (*self.link.prefix, *plays), folder)
        stack.callback(self._worker.close)
        self.heard_after(0.0)
        return self

    def __exit__(self, *what: object) -> None:
        self._stack.close()

    @property
    def pids(self) -> list[int]:
        """Of who asks and who answers."""
        return [one.process.pid for one in (self._asker, self._worker)]

    def heard_after(self, at_s: float) -> Heard:
        """Wait until the worker was heard after a time on the monotonic clock."""
        deadline_s = time.monotonic() + DEADLINE_S
        while time.monotonic() < deadline_s:
            self._worker.look()
            self._asker.look()
            since = [one for one in self._events() if one["mono_s"] > at_s]
            answers = [one["mono_s"] for one in since if one["what"] == "answer"]
            tokens = [one["mono_s"] for one in since if one["what"] == "up"]
            if answers and tokens:
                return Heard(tokens[0] - at_s, answers[0] - at_s)
            _pause(0.1)
        screens = [one.read_text() for one in self._folder.glob("*.screen")]
        raise AssertionError(f"not heard: {self._events()[-3:]} {screens}")

    def cut(self, seconds: float) -> Heard:
        """Cut the link for a while; returns when the worker was heard again."""
        self.link.befall("cut")
        _pause(seconds)
        self.link.mend()
        heard = self.heard_after(time.monotonic())
        _pause(_APART_S)
        return heard

    def _events(self) -> list[dict[str, Any]]:
        if not self._file.exists():
            return []
        lines = self._file.read_text().splitlines(keepends=True)
        return [json.loads(line) for line in lines if line.endswith("\n")]


def _pause(seconds: float) -> None:
    until_s = time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0.0:
        time.sleep(left_s)


def ask_on(endpoint: str, files: str, out: Path) -> None:
    """Be the router, ask the worker for the time, and write down what was heard when."""
    tokens, replies = Mailbox(256), Mailbox(256)
    setup = BusSetup(endpoint=endpoint, tls=role_files(Path(files), "router"))
    with ZenohBus(setup, router=True) as bus, out.open("a") as file:
        bus.watch_alive(alive_key(run=RUN, process=WORKER), tokens)
        for item in _heard(bus, tokens, replies):
            file.write(json.dumps(item) + "\n")
            file.flush()


def _heard(bus: ZenohBus, tokens: Mailbox, replies: Mailbox) -> Iterator[dict[str, Any]]:
    while True:
        bus.request("clock", ClockQuestion(), replies, timeout_s=_WAITS_S, run=RUN, process=WORKER)
        _pause(_ASKS_EVERY_S)
        while isinstance(token := tokens.take(), Alive):
            what = "up" if token.up else "down"
            yield {"what": what, "mono_s": token.received_mono_ns * 1e-9}
        while isinstance(reply := replies.take(), Reply):
            if reply.message is not None:
                yield {"what": "answer", "mono_s": reply.received_mono_ns * 1e-9}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cuts", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--delay", action="store_true", help=f"of {SLOW_S:g} s each way")
    parser.add_argument("--ask", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.ask:
        endpoint, files, out = given.ask
        ask_on(endpoint, files, Path(out))
    with tempfile.TemporaryDirectory() as folder, FarLink(Path(folder)) as far:
        if given.delay:
            far.link.befall("delay")
        # TCP calls once a second: where in it a link is back must differ.
        parts = [number / given.cuts for number in range(given.cuts)]
        found = [far.cut(given.seconds + part) for part in parts]
        for name in Heard._fields:
            values = sorted(round(getattr(one, name), 2) for one in found)
            print(json.dumps({name: values, "median": statistics.median(values)}))
    print(json.dumps({"loads": os.getloadavg()}))


if __name__ == "__main__":
    main()
