"""The router as a process of its own: it listens at once, or says why not, and ends in time."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.keys import alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process_setup import BusSetup, RouterSetup, write_setup
from foretwin.contracts.router import LISTENS
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from tests.contracts.bus_sides import DEADLINE_S, take_until

COVERS = ("foretwin.contracts.process_setup",)


def word_of(folder: Path) -> str:
    """Wait for the router's word."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not (folder / "router.word").exists():
        assert time.monotonic() < deadline_s
    return (folder / "router.word").read_text(encoding="utf-8")


@contextmanager
def router(folder: Path, endpoint: str) -> Iterator[subprocess.Popen[str]]:
    """Start a router; it is ended with the block."""
    folder.mkdir(exist_ok=True)
    (folder / "router.word").unlink(missing_ok=True)
    setup = RouterSetup(
        run_id="r1", process_id="router", vehicle_id="ego", bus=BusSetup(endpoint=endpoint),
        log_file=str(folder / "log.jsonl"), word_file=str(folder / "router.word"),
    )  # fmt: skip
    write_setup(setup, folder / "router.json")
    command = [sys.executable, "-P", "-m", "foretwin.contracts.router", "--setup"]
    with subprocess.Popen(
        [*command, str(folder / "router.json")], stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def test_clients_meet_and_the_router_ends_when_it_is_told_to(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with router(tmp_path, endpoint) as process:
        assert word_of(tmp_path) == LISTENS
        setup = BusSetup(endpoint=endpoint)
        with ZenohBus(setup) as near, ZenohBus(setup) as far:
            assert near.connected
            tokens = Mailbox(4)
            near.watch_alive(alive_key(run="r1", process="*"), tokens)
            far.declare_alive(alive_key(run="r1", process="w0"))
            assert take_until(tokens, lambda _: True).up
            process.terminate()
            assert process.wait(DEADLINE_S) == 0
            assert not take_until(tokens, lambda _: True).up
            assert not near.connected


def test_what_was_declared_holds_at_a_router_that_took_the_place_of_a_killed_one(
    tmp_path: Path,
) -> None:
    endpoint = free_endpoint()
    setup = BusSetup(endpoint=endpoint)
    tokens, questions = Mailbox(8), Mailbox(8)
    with router(tmp_path, endpoint) as first:
        assert word_of(tmp_path) == LISTENS
        near, far = ZenohBus(setup), ZenohBus(setup)
        near.watch_alive(alive_key(run="r1", process="*"), tokens)
        far.serve("prepare", questions, run="r1", process="w0")
        far.declare_alive(alive_key(run="r1", process="w0"))
        assert take_until(tokens, lambda _: True).up
        first.kill()
    with near, far, router(tmp_path, endpoint):
        assert not take_until(tokens, lambda _: True).up
        assert take_until(tokens, lambda _: True).up, "it is there again"
        replies = Mailbox(1)
        question = PrepareRequest(world_id="abc")
        near.request("prepare", question, replies, timeout_s=DEADLINE_S, run="r1", process="w0")
        asked = take_until(questions, lambda _: True)
        asked.reply(PrepareReply(world_id="abc", worker_id="w0", seconds=0.0))
        assert take_until(replies, lambda _: True).error is None


def test_a_port_that_is_taken_is_said_and_nothing_listens(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        with router(tmp_path, endpoint) as process:
            assert "in use" in word_of(tmp_path)
            assert process.wait(DEADLINE_S) == 2


def test_a_router_that_cannot_say_its_word_goes_on(tmp_path: Path) -> None:
    """Nobody waits for it where one is started again, and the disk may be full."""
    endpoint, word = free_endpoint(), tmp_path / "router.partial"
    word.mkdir()  # nothing can be written there
    with router(tmp_path, endpoint) as process:
        setup = BusSetup(endpoint=endpoint)
        with ZenohBus(setup) as near:
            assert near.connected
        assert process.poll() is None
    assert not (tmp_path / "router.word").exists()


def test_a_router_starts_without_what_it_does_not_need(tmp_path: Path) -> None:
    code = (
        "import sys, foretwin.contracts.router; "
        "print(sorted({'numpy', 'pyproj', 'scipy', 'mujoco'} & sys.modules.keys()))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout == "[]\n"


def test_a_router_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with router(tmp_path, endpoint) as process:
        assert word_of(tmp_path) == LISTENS
        process.kill()
    starts = (
        "import subprocess, sys; "
        "subprocess.Popen([sys.executable, '-P', '-m', 'foretwin.contracts.router', '--setup', "
        "sys.argv[1]]); sys.stdin.read()"
    )
    (tmp_path / "router.word").unlink()
    with subprocess.Popen(
        [sys.executable, "-c", starts, str(tmp_path / "router.json")], stdin=subprocess.PIPE
    ) as parent:
        assert word_of(tmp_path) == LISTENS
        parent.kill()
    port = int(endpoint.rsplit(":", 1)[1])
    deadline_s = time.monotonic() + DEADLINE_S
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                break
        assert time.monotonic() < deadline_s
