"""The log of a run: whatever the disk does, it ends no process and holds whole lines."""

from __future__ import annotations

import errno
import json
import logging
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.contracts import log_file
from foretwin.contracts.log_file import JsonLines, LogFile
from tests.log_lines import read_log


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "log.jsonl"


@pytest.fixture
def log(file: Path) -> Iterator[logging.Logger]:
    log, handler = logging.Logger("here", logging.INFO), LogFile(file)
    handler.setFormatter(JsonLines("p0"))
    log.addHandler(handler)
    yield log
    handler.close()


def texts(file: Path) -> list[str]:
    return [json.loads(line)["text"] for line in file.read_text(encoding="utf-8").splitlines()]


def test_a_line_tells_when_who_how_bad_and_what(file: Path, log: logging.Logger) -> None:
    log.info("a %s", "b")
    try:
        raise ValueError("wrong")
    except ValueError:
        log.exception("c\nd \ud800")
    first, second = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    assert {**first, "wall_s": 0.0} == {
        "wall_s": 0.0, "process": "p0", "level": "info", "source": "here", "text": "a b",
    }  # fmt: skip
    assert first["wall_s"] > 1e9
    assert second["text"].startswith("c\nd ")
    assert "ValueError: wrong" in second["traceback"]


def test_several_append_to_one_file(file: Path, log: logging.Logger) -> None:
    other = LogFile(file)
    for number in range(3):
        log.info("ours %d", number)
        other.emit(logging.LogRecord("there", 20, "", 0, '{"text": "theirs"}', (), None))
    other.close()
    assert texts(file) == ["ours 0", "theirs", "ours 1", "theirs", "ours 2", "theirs"]


def test_a_full_disk_loses_its_lines_alone(
    file: Path, log: logging.Logger, monkeypatch: pytest.MonkeyPatch
) -> None:
    really, room = os.write, 7

    def write(descriptor: int, data: bytes) -> int:
        if not room:
            raise OSError(errno.ENOSPC, "No space left on device")
        return really(descriptor, data[:room])

    log.info("before")
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", write)
        log.info("torn")
        room = 0
        log.info("lost")
        logging.shutdown([lambda: log.handlers[0]])  # type: ignore[list-item]
    log.info("after")
    assert file.read_text(encoding="utf-8").splitlines()[1] == '{"wall_'
    lines = file.read_text(encoding="utf-8").splitlines()
    assert [json.loads(lines[number])["text"] for number in (0, 2)] == ["before", "after"]
    assert len(lines) == 3


def test_another_process_begins_a_new_line_after_a_torn_one(
    file: Path, log: logging.Logger
) -> None:
    file.write_bytes(b'{"text": "whole"}\n{"text": "to')
    log.info("after")
    found = read_log(file)
    assert [line["text"] for line in found.lines] == ["whole", "after"]
    assert found.torn == 1
    file.write_bytes(b'{"text": "whole"}\n7\n\n\xff\n{"text": "no end"}')
    assert read_log(file) == ([{"text": "whole"}], 3)


def test_no_process_fills_a_log_and_the_worst_has_room_longest(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_file, "MOST_BYTES", 3000)
    monkeypatch.setattr(log_file, "MOST_URGENT_BYTES", 4000)
    log, handler = logging.Logger("here", logging.INFO), LogFile(file)
    handler.setFormatter(JsonLines("p0"))
    log.addHandler(handler)
    for number in range(100):
        log.info("%d", number)
    size = file.stat().st_size
    assert 2800 < size <= 3000
    log.warning("not good")
    log.error("bad")
    handler.close()
    handler.close()
    lines = read_log(file).lines
    assert [line["level"] for line in lines[-3:]] == ["warning", "error", "warning"]
    assert lines[-1]["text"].startswith(f"{100 - (len(lines) - 3)} lines are left out")
    assert [line["text"] for line in lines[:-3]] == [str(n) for n in range(len(lines) - 3)]


def test_a_process_leaves_at_most_eight_megabytes_and_of_warnings_sixteen(
    file: Path, log: logging.Logger
) -> None:
    for level, most in ((logging.INFO, 8e6), (logging.WARNING, 16e6)):
        for _ in range(20):
            log.log(level, "x" * 999_000)
        assert most - 1e6 < file.stat().st_size <= most


def test_a_file_that_cannot_be_opened_ends_nothing(tmp_path: Path) -> None:
    handler = LogFile(tmp_path / "missing" / "log.jsonl")
    handler.emit(logging.LogRecord("here", 20, "", 0, "a", (), None))
    handler.close()
    handler.close()
