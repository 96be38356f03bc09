"""What processes hold, by what a made-up /proc says."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from foretwin.orchestrator.runner.memory import (
    GROWN_MB,
    LOOK_EVERY_S,
    MOST_MB,
    SEEK_AT_LEAST_EVERY_S,
    SETTLED_AFTER_S,
    MemoryWatch,
)

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class House:
    """A folder of setups, and a /proc."""

    def __init__(self, folder: Path) -> None:
        self.setups, self.proc = folder / "processes", folder / "proc"
        self.setups.mkdir()
        self.watch = MemoryWatch(self.proc)

    def holds(self, pid: int, own_mb: float, *, name: str | None = None) -> None:
        own = round(own_mb * 1e6 / PAGE_BYTES)
        entry = self.proc / str(pid)
        entry.mkdir(parents=True, exist_ok=True)
        (entry / "statm").write_text(f"{own + 900} {own + 300} 300 1 0 {own} 0\n")
        if name is not None:
            setup = self.setups / f"{name}.json"
            setup.touch()
            command = ("python", "-m", "foretwin.x", "--setup", str(setup), "")
            (entry / "cmdline").write_text("\0".join(command))

    def look(self, now_s: float) -> list[str]:
        return self.watch.look(self.setups, now_s)


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
        house.holds(71, 50.0 + 50.0 * minute)
        told += house.look(60.0 * minute)
    assert [text.split(",")[0] for text in told] == [
        "w0 holds 600 MB of memory", "w0 holds 1200 MB of memory", "w0 holds 2400 MB of memory",
    ]  # fmt: skip
    assert told[0].endswith(f", 300 MB more than {SETTLED_AFTER_S / 60:g} min after its start")
    assert GROWN_MB <= 300.0


def test_who_is_huge_at_once_is_told_of_at_once(house: House) -> None:
    house.holds(71, MOST_MB + 1.0)
    assert house.look(0.0) == [f"w0 holds {MOST_MB + 1.0:.0f} MB of memory"]


def test_one_that_was_started_again_begins_anew(house: House) -> None:
    house.look(0.0)
    for file in ("statm", "cmdline"):
        (house.proc / "71" / file).unlink()
    house.look(10.0)
    house.holds(99, 20.0, name="w0")
    house.look(20.0)
    house.look(21.0)  # too soon: nothing is looked at
    record = house.watch.record()["w0"]
    assert (record["at_end"], record["most"], record["settled"]) == (20.0, 50.0, None)


def test_a_file_that_is_no_process_is_not_sought_among_all_processes_again_and_again(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    (house.setups / "standin_path.json").touch()
    walks: list[float] = []
    pids = MemoryWatch._pids

    def counted(watch: MemoryWatch, setups: Path, names: set[str]) -> dict[str, int]:
        walks.append(now_s)
        return pids(watch, setups, names)

    monkeypatch.setattr(MemoryWatch, "_pids", counted)
    now_s = 0.0
    while now_s < 600.0:
        house.look(now_s)
        now_s += LOOK_EVERY_S
    assert walks[:4] == [0.0, 5.0, 15.0, 35.0]
    assert len(walks) < 15
    # Whoever starts late is found all the same.
    house.holds(80, 30.0, name="standin_path")
    house.look(now_s + SEEK_AT_LEAST_EVERY_S)
    assert house.watch.now_mb["standin_path"] == pytest.approx(30.0, abs=0.01)


def test_where_there_is_no_proc_nothing_is_known(tmp_path: Path) -> None:
    house = House(tmp_path)
    assert house.look(0.0) == []
    assert house.watch.record()["orchestrator"]["at_end"] == 0.0
