"""The chaos that drives are put through: what is drawn, whom it finds, and what is said of it."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import textwrap
import time
from collections import Counter
from pathlib import Path

import pytest

from tests.chaos import __main__ as chaos
from tests.chaos.disk import small_disk
from tests.chaos.faults import DEADLY, LAST, OF_LINKS, OUTSIDE, STARTED_AGAIN, WEIGHTS, Case, draw
from tests.chaos.host_clock import CLOCK, HostClock
from tests.chaos.outsiders import Outsider
from tests.chaos.run_processes import MARK, Member, end_all, marked, members
from tests.chaos.table import Consequence, DriveLine, keep, kept, table_of
from tests.chaos.watcher import Seen, back_after_s
from tests.system.foretwin_command import REPOSITORY, is_running, wait_for

SEED = int(os.environ.get("FORETWIN_CHAOS_SEED", "0")) or random.SystemRandom().randrange(1, 10**6)


@pytest.mark.chaos
@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_whatever_befalls_drives_they_end_well(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with capsys.disabled():
        print(f"FORETWIN_CHAOS_SEED={SEED}")
        well = chaos.run(SEED, count=60, file=tmp_path / "drives.jsonl")
    assert well, f"FORETWIN_CHAOS_SEED={SEED} draws the same again"


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [draw(7, number) for number in range(400)]


def test_a_seed_draws_the_same_drives(cases: list[Case]) -> None:
    assert cases == [draw(7, number) for number in range(400)]
    assert cases[:9] != [draw(8, number) for number in range(9)]


def test_1000_faults_are_little_more_than_an_hour(cases: list[Case]) -> None:
    assert sum(len(case.faults) for case in cases[:75]) > 1000


def test_everything_befalls_everybody(cases: list[Case]) -> None:
    drawn = Counter((one.what, one.target) for case in cases for one in case.faults)
    started_again = {*STARTED_AGAIN, *OUTSIDE.values(), "orchestrator"}
    for what in ("kill", "segv", "memory", "stop"):
        for whom in {*started_again, "supervisor", "vehicle"}:
            assert drawn[what, whom], (what, whom)
    for what in ("term", "hup"):
        for whom in {*started_again, *LAST}:
            assert drawn[what, whom], (what, whom)
    assert {what for what, _ in drawn} == set(WEIGHTS)
    kinds = Counter((case.source, case.bus) for case in cases)
    assert set(kinds) == {
        ("standin", "socket"), ("standin", "open"), ("log", "socket"), ("log", "open"),
        ("live", "open"), ("live", "tls"),
    }  # fmt: skip
    assert min(kinds.values()) > 20


def test_what_ends_a_drive_comes_last_and_what_is_not_there_is_not_drawn(
    cases: list[Case],
) -> None:
    for case in cases:
        times = [one.at_s for one in case.faults]
        assert times == sorted(times)
        before = case.faults[:-1]
        assert not [one for one in before if one.what in DEADLY and one.target in LAST[:1]]
        assert not [one for one in before if one.what in DEADLY and one.target == "vehicle"]
        asked = ("term", "hup")
        assert not [one for one in before if one.what in asked and one.target == "orchestrator"]
        deaths = Counter(one.target for one in before if one.what in (*DEADLY, "stop"))
        assert max(deaths.values(), default=0) <= 4
        whats, targets = {one.what for one in case.faults}, {one.target for one in case.faults}
        assert case.source == "live" or not whats & OF_LINKS
        assert case.planner or "planner" not in targets
        assert ("vehicle" not in targets) if case.source == "live" else ("car" not in targets)


def test_processes_of_a_drive_are_found_by_what_it_tells(tmp_path: Path) -> None:
    mark, folder = f"chaos-test-{os.getpid()}", tmp_path / "run" / "processes"
    folder.mkdir(parents=True)
    sleep = [sys.executable, "-c", "import time; time.sleep(600)"]
    forks = """
        import os, time
        from foretwin.contracts.process_name import name_process
        for name in ("orchestrator", "w0"):
            if not os.fork():
                name_process(name)
                break
        time.sleep(600)
    """
    environment = os.environ | {MARK: mark}
    with (
        subprocess.Popen([*sleep, "--setup", str(folder / "w1.json")], env=environment) as worker,
        subprocess.Popen(sleep, env=environment) as planner,
        subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(forks)], env=environment
        ) as command,
    ):
        try:
            found: list[Member] = []

            def all_there() -> bool:
                found[:] = members(folder.parent, mark, command.pid)
                names = [one.name for one in found]
                return names == ["orchestrator", "other", "supervisor", "w0", "w1"]

            wait_for(all_there, "all of them")
            pids = {one.name: one.pid for one in found}
            assert (pids["other"], pids["w1"]) == (planner.pid, worker.pid)
            assert pids["supervisor"] == command.pid
            assert [one.kind for one in found][-2:] == ["w", "w"]
        finally:
            assert len(end_all(mark)) == 5
        wait_for(lambda: not is_running(worker.pid), "its end")
    wait_for(lambda: marked(mark) == [], "the end of all")


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("mount") is None, reason="may mount nothing")
def test_a_small_disk_is_full_when_it_is_told_to_be(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        if not disk.limited:
            pytest.skip("no disk of its own here")
        (disk.folder / "inside").mkdir()
        assert disk.fill()
        with pytest.raises(OSError, match="No space"):
            (disk.folder / "file").write_bytes(bytes(10_000))
        disk.free()
        if disk.close_folders(disk.folder / "inside"):
            with pytest.raises(PermissionError):
                (disk.folder / "inside" / "file").touch()
            disk.open_folders()
        (disk.folder / "inside" / "file").write_bytes(bytes(10_000))
    assert list((tmp_path / "disk").iterdir()) == []


def test_who_takes_part_is_started_again_when_it_dies(tmp_path: Path) -> None:
    words = [sys.executable, "-c", "import time; time.sleep(600)"]
    one = Outsider("car", words, tmp_path)
    try:
        first = one.process
        one.look()
        assert one.pid == first.pid
        first.kill()
        first.wait()
        assert one.pid is None

        def is_back() -> bool:
            one.look()
            return one.pid is not None

        wait_for(is_back, "the next one")
        assert one.pid != first.pid
    finally:
        one.close()
    assert not is_running(one.process.pid)


def test_the_clock_of_a_drive_s_host_can_be_set(tmp_path: Path) -> None:
    clock = HostClock(tmp_path / "clock")
    steps = {clock.set(number / 10) for number in range(40)}
    assert len(steps) > 4
    injected = Path(chaos.__file__).parent / "injected"
    told = subprocess.run(
        [sys.executable, "-c", "import time; print(time.time_ns(), round(1e9 * time.time()))"],
        env=os.environ | {CLOCK: str(clock.file), "PYTHONPATH": f"{injected}:{REPOSITORY}"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    for ns in told.stdout.split():
        assert abs(int(ns) - clock.offset_ns - time.time_ns()) < 20e9
    assert abs(clock.offset_ns) > 100e9
    clock.close()


def test_how_soon_somebody_is_back() -> None:
    s = 1_000_000_000
    seen = [
        Seen(1 * s, "w0", True), Seen(1 * s, "viewer", True), Seen(5 * s, "w0", False),
        Seen(6 * s, "viewer", False), Seen(7 * s, "w0", True), Seen(9 * s, "viewer", True),
    ]  # fmt: skip
    assert back_after_s(seen, "w0", 4 * s) == pytest.approx(3.0)
    assert back_after_s(seen, "viewer", 4 * s) == pytest.approx(5.0)
    assert back_after_s(seen, "router", 4 * s) == pytest.approx(3.0)
    assert back_after_s(seen, "w0", 6 * s) is None
    assert back_after_s(seen, "w1", 0) is None


def drive_line(
    number: int,
    *wrong: str,
    lost_s: float = 0.0,
    back_s: float = 1.0,
    skipped: tuple[str, ...] = (),
) -> DriveLine:
    done = [
        Consequence("kill", "w", "kill w", 3, None, back_s),
        Consequence("kill", "recorder", "kill recorder", 3, lost_s, None),
    ]
    return DriveLine(
        number=number, kind="log socket", revision="abc", code=3, wall_s=30.0, done=done,
        skipped=list(skipped), wrong=list(wrong),
    )  # fmt: skip


def test_drives_are_kept_and_the_last_of_a_number_counts(tmp_path: Path) -> None:
    file = tmp_path / "new" / "7.jsonl"
    assert kept(file) == {}
    for line in (drive_line(0, "hangs"), drive_line(1), drive_line(0)):
        keep(file, line)
    assert kept(file) == {0: drive_line(0), 1: drive_line(1)}


def test_the_table_says_what_followed_and_what_was_worst() -> None:
    drives = [
        drive_line(0, lost_s=0.25, back_s=2.5, skipped=("full disk",)),
        drive_line(1, "hangs", back_s=0.5),
    ]
    table = table_of(drives).splitlines()
    assert [line.split() for line in table[1:3]] == [
        ["kill", "recorder", "2", "3:", "2", "1", "0.25", "-"],
        ["kill", "w", "2", "3:", "2", "1", "-", "2.50"],
    ]
    assert table[-2] == "not possible at the time: {'full disk': 1}"
    assert table[-1] == "4 faults in 2 drives (abc), failed: [1]; 60 s"
