"""Plays the table of rogues on the bus of a drive, and looks whether each was refused."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import zenoh

from foretwin.contracts.access import role_of
from foretwin.contracts.router_log import UNFINISHED
from tests.contracts.bus_sides import DEADLINE_S
from tests.system.foretwin_command import Finished, Pause, log_lines, run_folder
from tests.system.rogues import (
    ROGUE,
    STRANGERS,
    Counted,
    Rogue,
    Transport,
    rogues_over,
)

AGAIN_S = 5.0


class Bus(NamedTuple):
    """How rogues and strangers come to a bus: Zenoh configurations."""

    transport: Transport
    as_member: Any
    """Called with a rogue."""
    as_stranger: Any
    """Called with what a stranger shows."""


def expected(transport: Transport, run: str) -> dict[Counted, str]:
    """Return what a record must count after all of them have been there, and of whom."""
    by_name = {one.name: one for one in rogues_over(transport)}
    return {
        row: name
        for name, one in by_name.items()
        for row in one.counted(run, one.role if transport == "tls" else one.user)
    } | {
        Counted("refused_by_router", "", one.counted_as): one.shows
        for one in STRANGERS
        if one.over == transport
    }


def counted_in(record: dict[str, Any]) -> dict[Counted, int]:
    """Return all refusals that a record counts."""
    rows = record["refused_by_router"]["by_role"]
    assert all(row["role"] == role_of(row["name"]) for row in rows)
    by_router = {
        Counted("refused_by_router", row["name"], row["kind"], row["key"]): row["count"]
        for row in rows
    }
    by_guard = {
        Counted("refused", row["sender"], row["reason"]): row["count"]
        for row in record["refused"]["by_sender"]
    }
    return by_router | by_guard


def told(row: Counted, lines: Iterable[str]) -> int:
    """Return how many of a log's lines tell of such a refusal: of a name and what it may not do."""
    if row.part == "refused":
        # The reason stands there in more words; the sender's keys differ.
        return sum(f"refused: {row.who}: " in one for one in lines)
    if row.who:
        return sum(f"refused: {row.who} may not {row.what} " in one for one in lines)
    return sum(f"refused: the router did not let in somebody: {row.what};" in one for one in lines)


def begun(out: Path) -> bool:
    """Whether the drive below `out` has a World."""
    folder = run_folder(out)
    return folder is not None and any(
        line["text"].startswith("world ") for line in log_lines(folder)
    )


def texts_of(run: Path) -> list[str]:
    """Return what the orchestrator has logged."""
    return [line["text"] for line in log_lines(run) if line["process"] == "orchestrator"]


def play(bus: Bus, run: Path) -> dict[str, Any]:
    """Let all of them try; returns what each rogue heard back."""
    for stranger in STRANGERS:
        if stranger.over == bus.transport:
            with pytest.raises(zenoh.ZError):
                zenoh.open(bus.as_stranger(stranger.shows))

    def tries(rogue: Rogue) -> Any:
        """Try until it is told: a link that is too slow for a rogue may be closed, and a message
        that is lost shows nothing."""
        rows = [row for row in rogue.counted(run.name, "") if row.part == "refused"]
        before = {row: told(row, texts_of(run)) for row in rows}
        deadline_s = time.monotonic() + DEADLINE_S
        with zenoh.open(bus.as_member(rogue)) as session:
            heard, again_s = rogue.act(session, run.name), time.monotonic() + AGAIN_S
            while any(told(row, texts_of(run)) == before[row] for row in rows):
                assert time.monotonic() < deadline_s, rogue.name
                if time.monotonic() > again_s:
                    rogue.act(session, run.name)
                    again_s = time.monotonic() + AGAIN_S
                Pause()()
        return heard

    return {rogue.name: tries(rogue) for rogue in rogues_over(bus.transport)}


def assert_all_were_refused(done: Finished, transport: Transport, heard: dict[str, Any]) -> None:
    """Each is counted and told once, nobody else is, and the drive is what it would have been."""
    assert done.run is not None
    record, lines = done.record(), log_lines(done.run)
    assert (done.code, record["exit"]) == (130, "interrupted"), done.screen

    wanted, counted = expected(transport, done.run.name), counted_in(record)
    uncounted = [(name, row) for row, name in wanted.items() if row not in counted]
    assert uncounted == [], uncounted
    others = [row for row in counted if row not in wanted and row.what != UNFINISHED]
    assert others == [], others
    assert record["refused_by_router"]["counted_all"]
    texts = texts_of(done.run)
    reasons = Counter(row.who for row in counted if row.part == "refused")
    for row, name in wanted.items():
        times = reasons[row.who] if row.part == "refused" else 1
        assert told(row, texts) == times, (name, row)

    # What a role may not say came nowhere: no sample of it, no token, no word, no change.
    telemetry, rounds, jobs = (record["ledger"][name] for name in ("telemetry", "rounds", "jobs"))
    assert telemetry["lost_by"]["never_came"] == 0
    assert telemetry["published"] == telemetry["recorded"] + telemetry["lost"]
    assert rounds["due"] == sum(count for name, count in rounds.items() if name != "due")
    assert jobs["given"] == jobs["results"] + jobs["refused"] + jobs["lost"]
    assert record["workers"]["strangers"] == record["workers"]["restarted"] == 0
    assert record["changes"] == []
    for unheard in ("a viewer changes the drive", "an operator drives on a recorded car"):
        assert heard[unheard] == []
    (answer,) = heard["an operator names a path"]
    assert "etc/passwd" in bytes((answer.ok or answer.err).payload).decode(errors="replace")
    told_of = [line["text"] for line in lines if ROGUE in line["text"]]
    assert [text for text in told_of if "refused: " not in text] == []
    assert not [line for line in lines if "traceback" in line]
    assert done.rows("rounds")
