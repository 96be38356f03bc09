"""What a sample costs who receives it, against one whose thread Python does not know yet."""

from __future__ import annotations

import os
import subprocess
import sys
import time

from foretwin.contracts import bus as bus_module
from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from tests.benchmarks.measuring import Measurement

SAMPLES, PAUSE_S, TURNS = 3000, 0.002, 4
KEPT, NEW = "kept", "new"
_MODULE = "tests.benchmarks.received_samples"


def measure() -> Measurement:
    """Return CPU µs of the receiving process for a sample; the baseline takes what Python knows of
    the bus's thread down after each."""
    found = {which: [_of_a_process(which) for _ in range(TURNS)] for which in (KEPT, NEW)}
    return Measurement(min(found[KEPT]), "CPU us", min(found[NEW]))


def _of_a_process(which: str) -> float:
    words = [sys.executable, "-m", _MODULE, which]
    return float(subprocess.run(words, capture_output=True, text=True, check=True).stdout)


def _receive(which: str, endpoint: str) -> float:
    if which == NEW:
        bus_module.keep_thread_state = lambda: None
    mailbox = Mailbox(2 * SAMPLES)
    with ZenohBus(BusSetup(endpoint=endpoint), router=True) as bus:
        bus.subscribe("speed", mailbox, vehicle="ego")
        began_s = time.process_time()
        subprocess.run([sys.executable, "-m", _MODULE, "send", endpoint], check=True)
        taken_s = time.process_time() - began_s
        return 1e6 * taken_s / len(mailbox)


def _send(endpoint: str) -> None:
    with ZenohBus(BusSetup(endpoint=endpoint)) as bus:
        for number in range(SAMPLES):
            bus.publish("speed", SpeedSample(stamp_ns=number, speed_mps=1.0), vehicle="ego")
            time.sleep(PAUSE_S)


if __name__ == "__main__":
    if sys.argv[1] == "send":
        _send(sys.argv[2])
    else:
        print(_receive(sys.argv[1], free_endpoint()), flush=True)
    os._exit(0)
