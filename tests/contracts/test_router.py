"""The router as a process of its own: it listens at once, or says why not, and ends in time."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.access import BusMember, access_control
from foretwin.contracts.bus import BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.credentials import (
    USERS,
    Credentials,
    credentials_file,
    make_credentials,
    read_credentials,
)
from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.keys import alive_key, key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process_setup import Admission, BusSetup, RouterSetup, write_setup
from foretwin.contracts.refusal_counts import OwnRefusals, refused_by
from foretwin.contracts.router import LISTENS
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from foretwin.contracts.tuning import SetRequest
from tests.contracts.bus_sides import DEADLINE_S, take_until

COVERS = ("foretwin.contracts.process_setup",)


def word_of(folder: Path) -> str:
    """Wait for the router's word."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not (folder / "router.word").exists():
        assert time.monotonic() < deadline_s
    return (folder / "router.word").read_text(encoding="utf-8")


@contextmanager
def router(
    folder: Path, endpoint: str, admits: Admission | None = None
) -> Iterator[subprocess.Popen[str]]:
    """Start a router; it is ended with the block."""
    folder.mkdir(exist_ok=True)
    (folder / "router.word").unlink(missing_ok=True)
    setup = RouterSetup(
        run_id="r1", process_id="router", vehicle_id="ego",
        bus=BusSetup(endpoint=endpoint, admits=admits),
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


MEMBERS = (
    BusMember("worker-w0", "worker", "w0"),
    BusMember("car-vehicle", "car", vehicle_id="ego"),
    BusMember("viewer", "viewer", "viewer"),
)


@contextmanager
def guarded(folder: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Start a router that knows MEMBERS by their passwords; yields its endpoint too."""
    make_credentials(folder, [one.name for one in MEMBERS])
    access = access_control(MEMBERS, subject="usernames", run_id="r1")
    admits = Admission(users_file=str(folder / USERS), access=json.dumps(access))
    endpoint = f"unixsock-stream/{folder}/bus"
    with router(folder, endpoint, admits) as process:
        assert word_of(folder) == LISTENS
        yield process, endpoint


def as_member(folder: Path, endpoint: str, name: str) -> ZenohBus:
    return ZenohBus(BusSetup(endpoint=endpoint, credentials=str(credentials_file(folder, name))))


def counted(folder: Path) -> dict[tuple[str, str, str], int]:
    kinds = refused_by(folder).get("router", OwnRefusals()).kinds
    return {(one.sender, one.reason, one.key): one.count for one in kinds}


def wait_for_count(folder: Path, count: int) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while sum(counted(folder).values()) < count:
        assert time.monotonic() < deadline_s, counted(folder)


def test_what_the_rules_refuse_is_counted_by_name_and_key(tmp_path: Path) -> None:
    """With Zenoh's own words: another version's may differ."""
    with guarded(tmp_path) as (process, endpoint):
        with as_member(tmp_path, endpoint, "car-vehicle") as car:
            for number in range(5):
                car.publish("speed", SpeedSample(stamp_ns=number, speed_mps=1.0), vehicle="ego")
            with as_member(tmp_path, endpoint, "worker-w0") as worker:
                worker.declare_alive(alive_key(run="r1", process="w0"))
                assert counted(tmp_path) == {}
                worker.declare_alive(alive_key(run="r1", process="w1"))
                for name in ("mirror", "event"):
                    full_key = key(name, run="r1")
                    for _ in range(3):
                        worker._session.put(full_key, b"1")
                worker._session.delete(key("round", run="r1"))
                replies = Mailbox(1)
                question = SetRequest(key="role.ego", value="ghost")
                worker.request("set", question, replies, timeout_s=1.0, run="r1")
                served = worker._session.declare_queryable(key("set", run="r1"), print)
                heard = worker._session.declare_subscriber("**", print)
                wait_for_count(tmp_path, 11)
                served.undeclare()
                heard.undeclare()
        process.terminate()
        assert process.wait(DEADLINE_S) == 0
    run = "foretwin/v1/run/r1"
    assert counted(tmp_path) == {
        ("worker-w0", "say", f"{run}/event"): 3,
        ("worker-w0", "say", f"{run}/mirror"): 3,
        ("worker-w0", "delete", f"{run}/round"): 1,
        ("worker-w0", "ask", f"{run}/set"): 1,
        ("worker-w0", "serve", f"{run}/set"): 1,
        ("worker-w0", "hear", "**"): 1,
        ("worker-w0", "be alive as", f"{run}/alive/w1"): 1,
    }
    assert refused_by(tmp_path)["router"].counted_all


def test_who_shows_no_or_a_wrong_password_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    with guarded(tmp_path) as (_, endpoint):
        worker = read_credentials(credentials_file(tmp_path, "worker-w0"))
        shown = {
            "a wrong password": Credentials(user="car-vehicle", password=worker.password),
            "an unknown name": Credentials(user="car", password=worker.password),
        }
        for why, credentials in shown.items():
            file = tmp_path / f"{why}.shown"
            file.touch(0o600)
            file.write_bytes(msgspec.json.encode(credentials))
            with pytest.raises(BusUnreachable):
                ZenohBus(BusSetup(endpoint=endpoint, credentials=str(file)))
        with pytest.raises(BusUnreachable):
            ZenohBus(BusSetup(endpoint=endpoint))
        deadline_s = time.monotonic() + DEADLINE_S
        while {why for _, why, _ in counted(tmp_path)} != {*shown, "no password"}:
            assert time.monotonic() < deadline_s, counted(tmp_path)


def test_who_hangs_up_is_not_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A member whose time to connect is over before the router gets a processor."""
    with guarded(tmp_path) as (process, endpoint):
        with monkeypatch.context() as hasty:
            hasty.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
            process.send_signal(signal.SIGSTOP)
            with pytest.raises(BusUnreachable):
                as_member(tmp_path, endpoint, "worker-w0")
            process.send_signal(signal.SIGCONT)
        with as_member(tmp_path, endpoint, "worker-w0") as worker:
            worker._session.put(key("mirror", run="r1"), b"1")  # what is counted comes last
            wait_for_count(tmp_path, 1)
        assert {why for _, why, _ in counted(tmp_path)} == {"say"}


def test_a_flood_of_what_is_refused_fills_nothing_and_holds_up_nobody(tmp_path: Path) -> None:
    with guarded(tmp_path) as (process, endpoint):
        heard = Mailbox(2000)
        with (
            as_member(tmp_path, endpoint, "viewer") as viewer,
            as_member(tmp_path, endpoint, "car-vehicle") as car,
            as_member(tmp_path, endpoint, "worker-w0") as worker,
        ):
            viewer.subscribe("speed", heard, vehicle="ego")
            put = worker._session.declare_publisher(key("speed", vehicle="ego")).put
            for number in range(50):
                car.publish("speed", SpeedSample(stamp_ns=number, speed_mps=1.0), vehicle="ego")
                for _ in range(2000):
                    put(b"x" * 50)
            last = take_until(heard, lambda item: item.message().stamp_ns == 49)
            assert last.message().speed_mps == 1.0
            wait_for_count(tmp_path, 1)
        process.terminate()
        said = process.communicate(timeout=DEADLINE_S)[1]
        assert process.returncode == 0
    assert counted(tmp_path).keys() == {("worker-w0", "say", key("speed", vehicle="ego"))}
    assert len(said) < 10_000
    assert sum(file.stat().st_size for file in tmp_path.iterdir() if file.is_file()) < 50_000


def test_a_port_that_is_taken_is_said_and_nothing_listens(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        endpoint = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        with router(tmp_path, endpoint) as process:
            assert "in use" in word_of(tmp_path)
            assert process.wait(DEADLINE_S) == 2


def test_a_router_that_cannot_say_its_word_goes_on(tmp_path: Path) -> None:
    """Nobody waits for it where one is started again, and the disk may be full."""
    endpoint, word = free_endpoint(), tmp_path / "router.word.partial"
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
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("FORETWIN_STARTED_BY", "1")  # who died before it could be asked for
        with router(tmp_path, endpoint) as process:
            assert process.wait(DEADLINE_S) == 0
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
