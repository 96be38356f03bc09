"""What processes hold, by what a made-up /proc says."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from foretwin.orchestrator.runner.memory import (
    GROWN_MB,
    LOOK_EVERY_S,
    MOST_MB,
    SETTLED_AFTER_S,
    MemoryWatch,
)

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class House:
    """Processes that run, and a /proc."""

    def __init__(self, folder: Path) -> None:
        self.running: dict[str, int] = {}
        self.proc = folder / "proc"
        self.watch = MemoryWatch(self.proc)

    def holds(
        self, pid: int, own_mb: float, *, shared_mb: float = 0.0, name: str | None = None
    ) -> None:
        pages = round((own_mb + shared_mb) * 1e6 / PAGE_BYTES)
        entry = self.proc / str(pid)
        entry.mkdir(parents=True, exist_ok=True)
        (entry / "statm").write_text(f"{pages + 900} {pages + 300} 300 1 0 {pages} 0\n")
        alone_kb = round(own_mb * 1e6 / 1024)
        told = f"Rss: 7 kB\nShared_Dirty: 600 kB\nPrivate_Dirty:{alone_kb:8d} kB\nSwap: 0 kB\n"
        (entry / "smaps_rollup").write_text(told)
        if name is not None:
            self.running[name] = pid

    def look(self, now_s: float) -> list[str]:
        """Look until all are known: each look takes in one."""
        looks = (self.watch.look(self.running, now_s) for _ in range(len(self.running) + 1))
        return [text for look in looks for text in look]


@pytest.fixture
def house(tmp_path: Path) -> House:
    made = House(tmp_path)
    made.holds(os.getpid(), 100.0)
    made.holds(71, 50.0, name="w0")
    return made


def test_own_and_others_memory_is_known_by_name(house: House) -> None:
    house.holds(72, 7.0)  # somebody else
    assert house.look(0.0) == []
    assert house.watch.now_mb == pytest.approx({"orchestrator": 100.0, "w0": 50.0}, abs=0.01)


def test_growth_counts_from_when_a_process_has_settled(house: House) -> None:
    house.look(0.0)
    house.holds(71, 80.0)
    house.look(SETTLED_AFTER_S)
    house.holds(71, 90.0)
    house.look(SETTLED_AFTER_S + 1800.0)
    record = house.watch.record()
    assert record["w0"] == {"at_end": 90.0, "most": 90.0, "settled": 80.0, "per_hour": 20.0}
    assert record["orchestrator"]["per_hour"] == 0.0


def test_what_is_held_for_a_moment_is_no_growth(house: House) -> None:
    for second in range(0, 2400, 5):
        # A job takes 9 MB for 20 s of each minute; what stays grows by 6 MB an hour.
        house.holds(71, 80.0 + 6.0 * second / 3600.0 + 9.0 * (second % 60 >= 40))
        house.look(float(second))
    record = house.watch.record()["w0"]
    assert record["per_hour"] == pytest.approx(6.0, abs=0.3)
    assert record["at_end"] > record["settled"] + 9.0


def test_what_it_does_at_the_first_and_last_moment_is_no_growth(house: House) -> None:
    for minute in range(40):
        # It works for four minutes of six: with 12 MB more at the end than where it had settled.
        house.holds(71, 80.0 + 6.0 * minute / 60.0 + 12.0 * ((minute + 1) % 6 >= 2))
        house.look(60.0 * minute)
    assert house.watch.record()["w0"]["per_hour"] == pytest.approx(6.0, abs=4.0)


def test_who_grows_is_told_of_and_again_when_it_is_twice_as_large(house: House) -> None:
    told = []
    for minute in range(60):
        house.holds(71, 65.536 * (minute + 1))
        told += house.look(60.0 * minute)
    assert [text.split(",")[0] for text in told] == [
        "w0 holds 655 MB of memory", "w0 holds 1311 MB of memory", "w0 holds 2621 MB of memory",
    ]  # fmt: skip
    assert told[0].endswith(f", 262 MB more than {SETTLED_AFTER_S / 60:g} min after its start")
    assert GROWN_MB <= 262.0


def test_who_is_huge_at_once_is_told_of_at_once(house: House) -> None:
    house.holds(71, MOST_MB + 1.0)
    assert house.look(0.0) == [f"w0 holds {MOST_MB + 1.0:.0f} MB of memory"]


def test_one_that_was_started_again_begins_anew(house: House) -> None:
    house.look(0.0)
    (house.proc / "71" / "statm").unlink()
    house.look(10.0)
    house.holds(99, 20.0, name="w0")
    house.look(20.0)
    house.look(21.0)  # too soon: nothing is looked at
    record = house.watch.record()["w0"]
    assert (record["at_end"], record["most"], record["settled"]) == (20.0, 50.0, None)


def test_who_has_ended_keeps_what_was_known_and_is_not_told_of(house: House) -> None:
    house.holds(71, MOST_MB - 1.0)
    house.look(0.0)
    (house.proc / "71" / "statm").unlink()
    assert house.look(LOOK_EVERY_S) == []
    assert house.watch.record()["w0"]["most"] == pytest.approx(MOST_MB - 1.0, abs=0.1)


def test_each_look_asks_one_process_what_it_shares(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    alone_mb = MemoryWatch._alone_mb

    def counted(watch: MemoryWatch, pid: int) -> float:
        asked.append(pid)
        return alone_mb(watch, pid)

    monkeypatch.setattr(MemoryWatch, "_alone_mb", counted)
    house.holds(72, 20.0, name="w1")
    house.running["gone"] = 99
    for count in (1, 2, 3, 3):
        house.watch.look(house.running, 0.1 * count)
        assert len(asked) == count
    assert house.watch.now_mb.keys() == {"orchestrator", "w0", "w1"}


def test_what_a_fork_shares_at_first_is_not_its_own(house: House) -> None:
    house.holds(72, 20.0, shared_mb=130.0, name="w1")
    house.look(0.0)
    # It has written to what it shared, and holds more.
    house.holds(72, 120.0, shared_mb=50.0)
    house.look(LOOK_EVERY_S)
    assert house.watch.now_mb["w1"] == pytest.approx(40.0, abs=0.1)


def test_where_it_is_not_told_what_is_shared_all_counts(house: House) -> None:
    house.holds(72, 20.0, shared_mb=130.0, name="w1")
    (house.proc / "72" / "smaps_rollup").unlink()
    house.look(0.0)
    assert house.watch.now_mb["w1"] == pytest.approx(150.0, abs=0.1)


def test_of_a_real_fork_what_it_wrote_to_is_its_own() -> None:
    script = """
        import os, time
        from foretwin.orchestrator.runner.memory import MemoryWatch
        from foretwin.orchestrator.runner.warm_fork import forked
        held = bytearray(os.urandom(50_000_000))
        def child(written):
            said, heard = os.pipe()[::-1]
            def work():
                for place in range(0, written, 4096):
                    held[place] = 7
                os.write(said, b"1")
                time.sleep(600)
            process = forked(work)
            os.read(heard, 1)
            watch = MemoryWatch()
            for _ in range(2):  # itself, and then the other
                watch.look({"w0": process.pid}, 0.0)
            process.kill()
            return watch.now_mb["w0"]
        print(child(0) < 10.0, 20.0 <= child(20_000_000) < 30.0)
    """
    said = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], check=True, capture_output=True, text=True
    )
    assert said.stdout == "True True\n"


def test_where_there_is_no_proc_nothing_is_known(tmp_path: Path) -> None:
    house = House(tmp_path)
    assert house.look(0.0) == []
    assert house.watch.record() == {}
