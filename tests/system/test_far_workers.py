"""A car, a drive and a worker in three networks, over TLS: what befalls the worker's link and the
worker costs the drive nothing."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.campaign import role_files
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.campaign.issuing import issue
from tests.chaos.link import PacketLink, own_network
from tests.chaos.outsiders import Outsider, live_car
from tests.orchestrator.campaign.campaigns import campaign, now
from tests.starvation import kept_waiting
from tests.system.foretwin_command import (
    end_process,
    environment,
    log_lines,
    run_folder,
    wait_for,
)

COVERS = ("foretwin.sim_worker.far.__main__",)

PORT = 7447
RATE_HZ = 1.0


class Fleet:
    """A drive in one network, its car in another, and workers in a third."""

    def __init__(self, folder: Path, stack: contextlib.ExitStack, rate_hz: float) -> None:
        self.folder, self._stack = folder, stack
        drive, car, far = (stack.enter_context(own_network()) for _ in range(3))
        name = f"ff{os.getpid() % 10_000}"
        self.car_link = PacketLink(car, f"{name}c", seed=1, near=drive)
        self.link = PacketLink(far, f"{name}w", seed=2, near=drive)
        for one in (self.car_link, self.link):
            stack.callback(one.close)
        # The drive listens at one address: the car reaches it through its own link.
        subprocess.run(
            ["nsenter", "-t", str(car), "-n", "ip", "route", "add", "default", "dev", f"{name}cb"],
            check=True,
        )
        self.endpoint = f"tls/{self.link.host}:{PORT}"
        self.campaign = campaign(folder / "campaign")
        issue(self.campaign, "router", days=2, now=now(), hosts=(self.link.host,))
        issue(self.campaign, "worker-laptop", days=2, now=now())
        self._in_drive = ("nsenter", "-t", str(drive), "-n")
        (folder / "config.toml").write_text(
            f"futures = 8\nfutures_per_job = 4\nrate_hz = {rate_hz}\nworkers = 1\n"
        )
        self.out = folder / "runs"
        self.drive = self._started(
            "drive", "--config", str(folder / "config.toml"), "--source", "live",
            "--secure", str(self.campaign), "--endpoint", self.endpoint, "--view", "none",
            "--tuning", "off", "--out", str(self.out), "--speed", "1", prefix=self._in_drive,
        )  # fmt: skip
        wait_for(lambda: (run := run_folder(self.out)) is not None and _listed(run), "the drive")
        self.run = run_folder(self.out)
        assert self.run is not None
        bus = BusSetup(endpoint=self.endpoint, tls=role_files(self.campaign, "car"))
        self._car = live_car(folder, self.run.name, bus, prefix=self.car_link.prefix, end_s=None)
        stack.callback(self._car.close)
        self._file = folder / "rounds.jsonl"
        watch = (*self._in_drive, sys.executable, "-m", "tests.system.round_watch", self.endpoint,
                 str(self.campaign), str(self._file))  # fmt: skip
        self._watch = Outsider("watch", watch, folder)
        stack.callback(self._watch.close)

    def worker(self, *words: str, **env: str) -> subprocess.Popen[str]:
        """Start a worker's command in its network."""
        return self._started(
            "worker", "--connect", self.endpoint, "--secure", str(self.campaign / "worker-laptop"),
            "--workers", "1", "--cache", str(self.folder / "far"), *words,
            prefix=self.link.prefix, env=env,
        )  # fmt: skip

    def _started(
        self, *words: str, prefix: tuple[str, ...], env: dict[str, str] | None = None
    ) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [*prefix, sys.executable, "-P", "-m", "foretwin", *words],
            cwd=self.folder, env=environment(self.folder / "cache") | (env or {}), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        self._stack.callback(end_process, process, within_s=40.0)
        return process

    def rounds(self) -> list[dict[str, Any]]:
        """Return the rounds so far."""
        if not self._file.exists():
            return []
        return [json.loads(line) for line in self._file.read_text().splitlines()]

    def texts(self) -> list[str]:
        """Return what the drive's log says."""
        assert self.run is not None
        return [line["text"] for line in log_lines(self.run)]

    def plays_along(self, times: int = 1) -> None:
        """Wait until the worker has joined so often."""

        def joined() -> bool:
            assert self.drive.poll() is None
            return sum("laptop-0 plays along" in text for text in self.texts()) >= times

        wait_for(joined, "the worker to join", within_s=90.0)

    def let_pass(self, seconds: float) -> float:
        """Let a time pass; returns when it began."""
        begun_s = time.monotonic()
        wait_for(lambda: time.monotonic() - begun_s > seconds, "time", within_s=seconds + 30.0)
        return begun_s

    def end(self) -> dict[str, Any]:
        """End the drive as a user does; returns its record."""
        self.drive.send_signal(signal.SIGINT)
        self.drive.communicate(timeout=60.0)
        assert self.run is not None
        record: dict[str, Any] = json.loads((self.run / "run.json").read_text())
        return record

    def players(self) -> dict[int, set[str]]:
        """Return who played each round."""
        assert self.run is not None
        table = pq.read_table(
            self.run / "results" / "futures.parquet", columns=["round_id", "worker_id"]
        )
        found: dict[int, set[str]] = {}
        for row in table.to_pylist():
            found.setdefault(row["round_id"], set()).add(row["worker_id"])
        return found


def _listed(run: Path) -> bool:
    return (run / "run.json").exists()


@pytest.fixture
def fleet(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Fleet]:
    with contextlib.ExitStack() as stack:
        try:
            made = Fleet(tmp_path, stack, getattr(request, "param", RATE_HZ))
        except OSError as error:
            pytest.skip(f"no networks of their own here: {error}")
        yield made


def pid_of(worker: subprocess.Popen[str]) -> int:
    """Return the process that plays for a worker's command."""
    found = subprocess.run(
        ["pgrep", "-P", str(worker.pid)], capture_output=True, text=True, check=True
    )
    return int(found.stdout.split()[0])


def longest_gap_s(times_s: list[float]) -> float:
    return max((b - a for a, b in itertools.pairwise(times_s)), default=0.0)


@pytest.mark.judge
@pytest.mark.timeout(280)
def test_what_befalls_a_worker_costs_the_drive_nothing(fleet: Fleet) -> None:
    worker = fleet.worker()
    fleet.plays_along()
    fleet.let_pass(6.0)

    killed_s = time.monotonic()
    os.kill(pid_of(worker), signal.SIGKILL)
    fleet.plays_along(2)
    back_s = time.monotonic() - killed_s
    fleet.let_pass(4.0)

    cut_s = time.monotonic()
    fleet.link.befall("cut")
    fleet.let_pass(5.0)
    mended_s = time.monotonic()
    fleet.link.mend()
    fleet.plays_along(3)
    again_s = time.monotonic() - mended_s
    fleet.let_pass(6.0)

    slow_s = time.monotonic()
    fleet.link.befall("delay")
    fleet.link.befall("loss")
    fleet.let_pass(10.0)
    fleet.link.mend()
    slow_until_s = time.monotonic()
    fleet.let_pass(3.0)
    worker.send_signal(signal.SIGTERM)
    worker.communicate(timeout=60.0)
    fleet.let_pass(2.0)
    record, rounds, players = fleet.end(), fleet.rounds(), fleet.players()

    far = [one for one in rounds if "w-laptop-0" in players.get(one["round_id"], set())]
    times = [one["mono_s"] for one in rounds]
    after_mend = [one["mono_s"] - mended_s for one in far if one["mono_s"] > mended_s]
    in_slow = [one for one in rounds if slow_s + 2.0 < one["mono_s"] < slow_until_s]
    in_cut = [one for one in rounds if cut_s < one["mono_s"] < mended_s]
    after_kill = [at_s - killed_s for at_s in times if at_s > killed_s]
    figures = {
        "rounds": len(rounds),
        "late": sum(one["late"] for one in rounds),
        "by the far worker": len(far),
        "missed": record["futures"]["missed_rounds"],
        "longest gap s": round(longest_gap_s(times), 2),
        "first round after the kill s": round(after_kill[0], 2),
        "worker back after its kill s": round(back_s, 2),
        "rounds in the cut": len(in_cut),
        "seen again after the cut s": round(again_s, 2),
        "first far result after the cut s": round(after_mend[0], 2),
        "rounds on the slow link": len(in_slow),
        "late on the slow link": sum(one["late"] for one in in_slow),
        "taken over": record["workers"]["taken_over"],
        "requeued": record["workers"]["requeued_jobs"],
        "far": record["workers"]["far"],
        "loads": os.getloadavg(),
    }
    print(json.dumps(figures, indent=1))
    period_s = 1.0 / RATE_HZ
    assert record["exit"] == "interrupted"
    assert record["dropped"]["given_up_rounds"] == 0
    assert len(far) > 5
    assert after_kill[0] < period_s + 1.0
    assert longest_gap_s(times) < 3.0 * period_s
    assert after_mend[0] < period_s + 1.0
    assert len(in_cut) >= 4.0 / period_s
    assert len(in_slow) >= 6.0 / period_s
    assert not any(one["late"] for one in (*in_cut, *in_slow))
    # A process that was killed was told of, and started again.
    assert worker.returncode == 3


@pytest.mark.judge
@pytest.mark.timeout(280)
@pytest.mark.parametrize("fleet", [2.0], indirect=True)
@pytest.mark.parametrize("more_s", [0.0, 0.1])
def test_a_worker_plays_again_within_a_second_of_a_cut(fleet: Fleet, more_s: float) -> None:
    worker = fleet.worker()
    fleet.plays_along()
    fleet.let_pass(3.0)
    mends: list[float] = []
    again: list[float] = []
    with kept_waiting(fleet.drive.pid, worker.pid) as kept:
        for number in range(5):
            fleet.link.befall("cut")
            # TCP calls once a second: where in it the link is back differs.
            fleet.let_pass(5.0 + 0.2 * number + more_s)
            mends.append(time.monotonic())
            fleet.link.mend()
            fleet.plays_along(number + 2)
            again.append(time.monotonic() - mends[-1])
            fleet.let_pass(3.0)
    worker.send_signal(signal.SIGTERM)
    worker.communicate(timeout=60.0)
    record, rounds, players = fleet.end(), fleet.rounds(), fleet.players()
    far = [one["mono_s"] for one in rounds if "w-laptop-0" in players.get(one["round_id"], set())]
    first = [
        min((at_s - mend_s for at_s in far if at_s > mend_s), default=99.0) for mend_s in mends
    ]
    figures = {
        "rounds": len(rounds),
        "by the far worker": len(far),
        "late": sum(one["late"] for one in rounds),
        "missed": record["futures"]["missed_rounds"],
        "longest gap s": round(longest_gap_s([one["mono_s"] for one in rounds]), 2),
        "plays along again s": [round(one, 2) for one in sorted(again)],
        "first far result s": [round(one, 2) for one in sorted(first)],
        "kept waiting s": round(kept.seconds, 2),
        "loads": os.getloadavg(),
    }
    print(json.dumps(figures))
    assert record["dropped"]["given_up_rounds"] == 0
    kept_s = kept.seconds / len(mends)
    assert statistics.median(again) < 0.5 + kept_s
    assert statistics.median(first) < 1.0 + kept_s
