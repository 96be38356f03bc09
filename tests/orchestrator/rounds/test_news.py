"""What happens again and again is told once."""

from __future__ import annotations

import logging
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.rounds.news import RoundNews
from foretwin.orchestrator.runner.open_rounds import RoundDone
from tests.orchestrator.futures_rounds import round_done, straight

ORDER = round_done(straight()).order


def test_a_reason_for_giving_up_is_told_once_and_always_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    told: list[Notice] = []
    news = RoundNews(told.append)
    with caplog.at_level(logging.WARNING):
        for reason in ("no path", "no disk", "no path"):
            news.given_up(ORDER, reason)
    assert [one.text for one in told] == [
        "round 0 is given up: no path", "round 0 is given up: no disk",
    ]  # fmt: skip
    assert len(caplog.records) == 3


def test_reasons_that_are_always_new_are_not_told_for_ever() -> None:
    told: list[Notice] = []
    news = RoundNews(told.append)
    for number in range(1000):
        news.given_up(ORDER, f"at 0x{number:x}")
    assert len(told) == 16


def test_who_is_sick_is_told_when_it_begins_and_when_it_is_over() -> None:
    told: list[Notice] = []
    news = RoundNews(told.append)
    for sick in ({"w0": "no disk"}, {"w0": "no memory"}, {}, {"w0": "no disk"}):
        news.health(sick)
    assert [(one.level, one.text.split(",")[0]) for one in told] == [
        ("warning", "w0 is sick"), ("info", "w0 is given jobs again"), ("warning", "w0 is sick"),
    ]  # fmt: skip


def test_that_somebody_acts_for_a_planner_is_told_once_for_each() -> None:
    told: list[Notice] = []
    news = RoundNews(told.append)
    done = round_done(straight())
    planner = done.order.futures[0].planner
    count = len(done.results[0].future_indices)

    def said(**words: tuple[str, ...]) -> RoundDone:
        outcome = msgspec.structs.replace(done.results[0].outcome, **words)
        return replace(done, results=(msgspec.structs.replace(done.results[0], outcome=outcome),))

    news.planners(done)
    assert told == []
    for words in (said(remarks=("slow",) * count), said(failures=("gone",) * count)):
        news.planners(words)
    assert [one.text for one in told] == [f"a future driven by {planner}: slow"]


def test_the_first_word_of_a_slow_machine_is_a_warning_and_the_next_ones_are_news() -> None:
    told: list[Notice] = []
    news = RoundNews(told.append)
    for short_of in ("48 of 64 futures", "32 of 64 futures", ""):
        news.pace(short_of, rate_hz=2.0)
    assert [(one.level, one.text.partition(" from")[0]) for one in told] == [
        ("warning", "48 of 64 futures"),
        ("info", "32 of 64 futures"),
        ("info", "the machine keeps up: all futures in every round again"),
    ]


def test_of_each_planner_it_is_its_own_word_that_is_told() -> None:
    """Futures are counted on from one job to the next; a failure says more than a remark."""
    done = round_done(np.concatenate([straight()] * 2), np.concatenate([straight()] * 3))
    names = iter("abcde")
    jobs = tuple(
        msgspec.structs.replace(
            job,
            futures=tuple(msgspec.structs.replace(f, planner=next(names)) for f in job.futures),
        )
        for job in done.order.jobs
    )
    words = (
        {"remarks": ("", "b is slow")},
        {"failures": ("c is gone", "", ""), "remarks": ("c is slow", "", "e is slow")},
    )
    results = tuple(
        msgspec.structs.replace(result, outcome=msgspec.structs.replace(result.outcome, **said))
        for result, said in zip(done.results, words, strict=True)
    )
    told: list[Notice] = []
    RoundNews(told.append).planners(
        replace(done, order=replace(done.order, jobs=jobs), results=results)
    )
    assert [one.text.removeprefix("a future driven by ") for one in told] == [
        "b: b is slow", "c: c is gone", "e: e is slow",
    ]  # fmt: skip
