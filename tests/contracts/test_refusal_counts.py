"""Refusals are counted in bounds, and each process leaves its own for who asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.refusal_counts import (
    REST,
    OwnRefusals,
    RefusalCounts,
    RefusalFile,
    RefusedKind,
    refused_by,
)


def say(count: int, key: str = "a") -> RefusedKind:
    return RefusedKind(sender="worker-w0", reason="say", key=key, count=count)


def test_each_sender_reason_and_key_is_counted_and_the_first_of_both_is_told() -> None:
    counts = RefusalCounts()

    assert counts.add("worker-w0", "say", key="a")
    assert not counts.add("worker-w0", "say", key="b", count=2)
    assert counts.add("worker-w0", "ask", key="a")
    assert not counts.add("worker-w0", "say", key="a")
    assert len(counts) == 5
    assert counts.knows("worker-w0", "say")
    assert not counts.knows("worker-w1", "say")
    assert counts.kinds() == (
        RefusedKind(sender="worker-w0", reason="ask", key="a", count=1),
        say(2, "a"),
        say(2, "b"),
    )


def test_who_makes_up_keys_fills_no_memory_and_hides_nobody_else() -> None:
    counts = RefusalCounts()
    for number in range(1000):
        counts.add("worker-w0", "say", key=f"key{number}")
    assert counts.add("viewer", "say", key="end")

    own = [one for one in counts.kinds() if one.sender == "worker-w0"]
    assert len(own) == 8 + 1
    assert say(1000 - 8, REST) in own
    assert len(counts) == 1001


def test_who_makes_up_names_fills_no_memory() -> None:
    counts = RefusalCounts()
    for number in range(3000):
        counts.add(f"name{number}", "say", key="x" * 10_000)

    assert len(counts.kinds()) == 200 + 1
    assert len(counts) == 3000
    assert max(len(one.key) for one in counts.kinds()) <= 200


def test_all_lives_of_a_process_count_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for pid, counted_all in ((7, True), (8, False)):
        monkeypatch.setattr("os.getpid", lambda pid=pid: pid)
        file = RefusalFile(tmp_path, "router")
        file.write(OwnRefusals(kinds=(say(1),)))
        file.write(OwnRefusals(kinds=(say(3),), counted_all=counted_all))
    RefusalFile(tmp_path, "ros2-beside").write(OwnRefusals(kinds=(say(1),)))
    (tmp_path / "torn-9.refused").write_bytes(b"{")

    found = refused_by(tmp_path)
    assert found["router"] == OwnRefusals(kinds=(say(6),), counted_all=False)
    assert found["router"].count == 6
    assert set(found) == {"router", "ros2-beside"}


def test_nothing_is_written_where_nothing_was_refused(tmp_path: Path) -> None:
    file, counts = RefusalFile(tmp_path, "w0"), RefusalCounts()
    file.look(counts)
    file.write(OwnRefusals())
    assert refused_by(tmp_path) == {}

    counts.add("job", "no message")
    file.look(counts)
    assert refused_by(tmp_path)["w0"].count == 1
    counts.add("job", "no message")
    file.look(counts)
    assert refused_by(tmp_path)["w0"].count == 1, "not more often than each second"


def test_a_disk_that_takes_nothing_ends_no_process(tmp_path: Path) -> None:
    file = RefusalFile(tmp_path / "gone", "w0")
    file.write(OwnRefusals(kinds=(say(1),)))
    (tmp_path / "gone").mkdir()
    file.write(OwnRefusals(kinds=(say(1),)))
    assert refused_by(tmp_path / "gone")["w0"].count == 1
