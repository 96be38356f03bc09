"""How soon a worker or a car on another machine is heard again after its link was cut.

`python -m tests.system.far_cuts --cuts 10 --seconds 5` prints it as JSON, with `--car` of the
stand-in car. The router and who listens are in one network, who is heard in another, over TLS; a
worker is asked for its clock over and over, a car says how fast it is.
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

from foretwin.contracts.bus import Alive, Mailbox, Received, Reply, ZenohBus
from foretwin.contracts.campaign import role_files
from foretwin.contracts.fleet import ClockQuestion, far_id
from foretwin.contracts.keys import alive_key
from foretwin.contracts.setup import (
    BusSetup,
    FarWorkerSetup,
    ProcessSetup,
    StandinSetup,
    write_setup,
)
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.record.machine import this_machine
from tests.chaos.link import PacketLink, own_network
from tests.chaos.outsiders import Outsider
from tests.chaos.parts import path_file
from tests.contracts.bus_sides import DEADLINE_S
from tests.orchestrator.campaign.campaigns import campaign, now

PORT, RUN, WORKER, CAR = 7447, "r1", far_id("laptop", 0), "ego"
SLOW_S = 0.2
_ASKS_EVERY_S, _WAITS_S, _APART_S = 0.05, 0.5, 3.0


class Heard(NamedTuple):
    """When somebody was heard first after a link was back, in seconds from then: a worker by its
    answer, a car by a sample."""

    token_s: float
    answer_s: float


class FarLink:
    """A worker, or a car, in a network of its own, and who listens; use it as a context."""

    def __init__(self, folder: Path, *, car: bool = False) -> None:
        self._folder, self._stack, self._is_car = folder, contextlib.ExitStack(), car

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
        self._far = Outsider("far", (*self.link.prefix, *self._plays(endpoint, files)), folder)
        stack.callback(self._far.close)
        self.heard_after(0.0)
        return self

    def _plays(self, endpoint: str, files: Path) -> tuple[str, ...]:
        """Return the words that start who is heard."""
        role = "car" if self._is_car else "worker-laptop"
        given = {
            "run_id": RUN, "log_file": str(self._folder / "far.jsonl"),
            "bus": BusSetup(endpoint=endpoint, tls=role_files(files, role)),
        }  # fmt: skip
        setup: ProcessSetup
        if self._is_car:
            path = str(path_file(self._folder))
            setup = StandinSetup(**given, process_id=CAR, vehicle_id=CAR, path_file=path)
        else:
            cache = str(self._folder / "worlds")
            machine = this_machine()
            setup = FarWorkerSetup(
                **given, process_id=WORKER, vehicle_id="far", machine=machine, cache_dir=cache
            )
        file = self._folder / "far.json"
        write_setup(setup, file)
        module = "telemetry.standin" if self._is_car else "sim_worker.far"
        return (sys.executable, "-m", f"foretwin.{module}", "--setup", str(file))

    def __exit__(self, *what: object) -> None:
        self._stack.close()

    @property
    def pids(self) -> list[int]:
        """Of who listens and who is heard."""
        return [one.process.pid for one in (self._asker, self._far)]

    def heard_after(self, at_s: float) -> Heard:
        """Wait until somebody was heard after a time on the monotonic clock."""
        deadline_s = time.monotonic() + DEADLINE_S
        while time.monotonic() < deadline_s:
            self._far.look()
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
        """Cut the link for a while; returns when somebody was heard again."""
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
        bus.declare_alive(alive_key(run=RUN, process="orchestrator"))  # a car waits for it
        bus.watch_alive(alive_key(run=RUN, process="*"), tokens)
        bus.subscribe("speed", replies, vehicle=CAR)
        for item in _heard(bus, tokens, replies):
            file.write(json.dumps(item) + "\n")
            file.flush()


def _heard(bus: ZenohBus, tokens: Mailbox, replies: Mailbox) -> Iterator[dict[str, Any]]:
    while True:
        bus.request("clock", ClockQuestion(), replies, timeout_s=_WAITS_S, run=RUN, process=WORKER)
        _pause(_ASKS_EVERY_S)
        while isinstance(token := tokens.take(), Alive):
            if token.key.endswith("orchestrator"):
                continue
            what = "up" if token.up else "down"
            yield {"what": what, "mono_s": token.received_mono_ns * 1e-9}
        while isinstance(item := replies.take(), Reply | Received):
            if isinstance(item, Received) or item.message is not None:
                yield {"what": "answer", "mono_s": item.received_mono_ns * 1e-9}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cuts", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--delay", action="store_true", help=f"of {SLOW_S:g} s each way")
    parser.add_argument("--car", action="store_true", help="the stand-in car instead of a worker")
    parser.add_argument("--ask", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.ask:
        endpoint, files, out = given.ask
        ask_on(endpoint, files, Path(out))
    with tempfile.TemporaryDirectory() as folder, FarLink(Path(folder), car=given.car) as far:
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
