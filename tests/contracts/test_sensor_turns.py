"""Turns that were told and passed over: left by the process, read for the record and the line."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.sensor_turns import SensorTurns, TurnsFile, passed_over_text, read_turns


def test_a_process_that_is_started_again_counts_on(tmp_path: Path) -> None:
    assert read_turns(tmp_path) == {}
    TurnsFile(tmp_path).write({"a": SensorTurns(told=5, passed_over=1), "b": SensorTurns(told=2)})
    again = TurnsFile(tmp_path)
    again.write({"a": SensorTurns(told=7, passed_over=2)})
    turns = read_turns(tmp_path)

    assert turns == {"a": SensorTurns(told=12, passed_over=3), "b": SensorTurns(told=2)}
    assert passed_over_text(turns) == "turns passed over: 3 of 15 of a"
    both = turns | {"b": SensorTurns(told=1, passed_over=1)}
    assert passed_over_text(both) == "turns passed over: 3 of 15 of a, 1 of 2 of b"
    assert passed_over_text({"b": SensorTurns(told=2)}) == ""


def test_it_is_written_once_a_second_and_a_full_disk_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [10.0]
    monkeypatch.setattr("foretwin.contracts.sensor_turns.time.monotonic", lambda: now_s[0])
    file = TurnsFile(tmp_path)
    for told in (1, 2, 3):
        file.look({"a": SensorTurns(told=told)})
        now_s[0] += 0.5
    assert read_turns(tmp_path) == {"a": SensorTurns(told=3)}
    TurnsFile(tmp_path / "gone").write({"a": SensorTurns()})
    (tmp_path / "sensors.turns").write_text("{")
    assert read_turns(tmp_path) == {}
