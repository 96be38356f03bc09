"""What processes of a run took is known by their ids, with all their lives, whatever ended them."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from foretwin.contracts import cpu_use
from foretwin.contracts.cpu_use import CpuMeter, cpu_taken_s, cpu_uses

BURNS = """
import sys, time
from pathlib import Path
from foretwin.contracts.cpu_use import CpuMeter
meter = CpuMeter(Path(sys.argv[1]), sys.argv[2])
def burn(seconds):
    until_s = time.process_time() + seconds
    while time.process_time() < until_s:
        pass
burn(0.1)
meter.ready()
burn(0.2)
meter.write()
print("written", flush=True)
sys.stdin.read()
meter.write()
"""


def live(folder: Path, process_id: str, *, kill: bool = False) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", BURNS, str(folder), process_id],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == b"written\n"
        if kill:
            process.send_signal(signal.SIGKILL)


def test_each_process_is_known_with_all_its_lives(tmp_path: Path) -> None:
    live(tmp_path, "w0")
    live(tmp_path, "w0", kill=True)
    live(tmp_path, "ros2-beside0")
    found = cpu_uses(tmp_path)

    assert list(found) == ["w0", "ros2-beside0"]
    assert (found["w0"].lives, found["ros2-beside0"].lives) == (2, 1)
    one = found["ros2-beside0"]
    assert one.starting_cpu_s >= 0.1
    assert one.cpu_s - one.starting_cpu_s == pytest.approx(0.2, abs=0.1)
    assert found["w0"].cpu_s - found["w0"].starting_cpu_s == pytest.approx(0.4, abs=0.2)
    assert one.share_of_core is not None
    assert 0.0 < one.share_of_core <= 1.05


def test_the_share_is_that_since_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = {"wall_s": 100.0, "cpu_s": 3.004}
    monkeypatch.setattr(cpu_use.time, "monotonic", lambda: clock["wall_s"])
    monkeypatch.setattr(cpu_use, "cpu_taken_s", lambda: clock["cpu_s"])
    meter = CpuMeter(tmp_path, "viewer")
    meter.write()
    assert cpu_uses(tmp_path)["viewer"].share_of_core is None
    meter.ready()
    clock.update(wall_s=110.0, cpu_s=4.12741)
    meter.write()

    use = cpu_uses(tmp_path)["viewer"]
    assert (use.cpu_s, use.starting_cpu_s, use.share_of_core, use.lives) == (
        4.13, 3.0, 0.1123, 1,
    )  # fmt: skip


def test_the_most_come_first_and_equals_by_their_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, took_s in (("w1", 2.0), ("viewer", 1.0), ("w0", 2.0)):
        monkeypatch.setattr(cpu_use.time, "process_time", lambda took_s=took_s: took_s)
        CpuMeter(tmp_path, name).write()
    assert list(cpu_uses(tmp_path)) == ["w0", "w1", "viewer"]


def test_it_is_written_now_and_then(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = time.monotonic()
    monkeypatch.setattr(cpu_use.time, "monotonic", lambda: now_s)
    meter = CpuMeter(tmp_path, "mirror")
    meter.look()
    assert cpu_uses(tmp_path) == {}
    now_s += 2.0
    meter.look()
    assert list(cpu_uses(tmp_path)) == ["mirror"]


def test_what_is_damaged_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "w1-7.cpu").write_bytes(b"")
    CpuMeter(tmp_path, "w0").write()
    assert list(cpu_uses(tmp_path)) == ["w0"]


@pytest.mark.skipif(sys.platform != "linux", reason="nobody tells of those that still run")
def test_what_a_process_started_counts_with_it_unless_it_says_so_itself(tmp_path: Path) -> None:
    burns = "import time\nwhile time.process_time() < 0.3: pass\nprint(1, flush=True)\ninput()"
    before_s = cpu_taken_s()
    with subprocess.Popen(
        [sys.executable, "-c", burns], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"1\n"
        assert cpu_taken_s() - before_s >= 0.25, "while it runs"
        own_s = time.process_time()
        CpuMeter(tmp_path, "supervisor", alone=True).write()
        said_s = cpu_uses(tmp_path)["supervisor"].cpu_s
        assert said_s == pytest.approx(own_s, abs=0.1), "said by the started one itself"
        process.communicate(b"\n")
    assert cpu_taken_s() - before_s >= 0.25, "once it has ended"
