"""Why a run's router cannot listen, in the words of who has to mend it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.zenoh_config import read_by_one_thread
from foretwin.orchestrator.drive.router_start import cannot_listen_text
from tests.contracts.bus_sides import ROUTER, python

JOINED = """
import json, os, sys, time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.drive.router_start import join_bus
lossless = sys.argv[2] == "lossless"
with join_bus(SimpleNamespace(bus=BusSetup(endpoint=sys.argv[1], lossless=lossless))):
    print("ready", flush=True)
    until_s, due = time.monotonic() + 20.0, {"app", "tx"} | ({"rx"} if lossless else set())
    names = set()
    while not due <= names and time.monotonic() < until_s:  # a thread may begin after the session
        for file in Path("/proc/self/task").glob("*/comm"):
            with suppress(OSError):
                names.add(file.read_text().split("-")[0])
    print(json.dumps([sorted(names & {"rx", "app", "tx"}), os.environ.get("ZENOH_RUNTIME")]))
    sys.stdout.flush()
    sys.stdin.read()
"""

IN_USE = "Can not create a new TCP listener bound to tcp/127.0.0.1:7447: Address already in use"


@pytest.mark.parametrize(
    ("endpoint", "word", "says"),
    [
        ("tcp/127.0.0.1:7447", IN_USE, "port 7447 is taken"),
        ("tcp/[::1]:7447?rel=1", IN_USE, "port 7447 is taken"),
        ("tcp/10.9.8.7:7447", "Cannot assign requested address", "cannot be listened on here"),
        ("tcp/127.0.0.1:7447", "", "cannot be listened on here"),
    ],
)
def test_what_is_taken_is_told_from_what_is_not_here(endpoint: str, word: str, says: str) -> None:
    text = cannot_listen_text(endpoint, word)
    assert says in text
    assert text.startswith(f"endpoint {endpoint}: ")


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are not told here")
@pytest.mark.parametrize("lossless", [True, False])
def test_live_what_waits_for_the_bus_reads_it_and_nobody_started_later_is_told(
    lossless: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ZENOH_RUNTIME", raising=False)
    endpoint = free_endpoint()
    word = "lossless" if lossless else "live"
    with python("-c", ROUTER, endpoint), python("-c", JOINED, endpoint, word) as joined:
        assert joined.stdout is not None
        threads, told = json.loads(joined.stdout.readline())
    assert threads == (["app", "rx", "tx"] if lossless else ["app", "tx"])
    assert told is None


def test_what_the_user_says_of_threads_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZENOH_RUNTIME", "(rx: (worker_threads: 3))")
    with read_by_one_thread():
        assert os.environ["ZENOH_RUNTIME"] == "(rx: (worker_threads: 3))"
    assert os.environ["ZENOH_RUNTIME"] == "(rx: (worker_threads: 3))"
