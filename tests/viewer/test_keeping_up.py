"""A live view that falls behind says so, once, and says when it is over."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from foretwin.viewer.keeping_up import KeepingUp, WindowLag
from tests.viewer.conftest import wait_until


def test_who_is_behind_is_told_once_until_it_has_caught_up() -> None:
    keeping = KeepingUp()
    said = [keeping.look(behind_s=s, dropped=0) for s in (0.2, 2.9, 3.1, 9.0, 2.0, 1.4, 0.1, 30.0)]
    assert [[one.level for one in each] for each in said] == [
        [],
        [],
        ["warning"],
        [],
        [],
        ["info"],
        [],
        ["warning"],
    ]
    assert said[2][0].text.startswith("the live view is 3 s behind the drive")
    assert "keeps up" in said[5][0].text


def test_rows_that_were_left_out_are_told_again_when_they_have_doubled() -> None:
    keeping = KeepingUp()
    counts = (0, 1, 1, 5, 9, 10, 10)
    told = [bool(keeping.look(behind_s=0.0, dropped=count)) for count in counts]
    assert told == [False, True, False, True, False, True, False]


class Window:
    """Says that it has the recording `r` until 2 s, and another one until 90 s."""

    def get_state(self) -> Any:
        recordings = [
            SimpleNamespace(
                store_id=f"Recording:foretwin:{name}",
                timelines=[
                    SimpleNamespace(name="drive_time", end=end_ns),
                    SimpleNamespace(name="log_time", end=10**18),
                ],
            )
            for name, end_ns in (("r", 2_000_000_000), ("other", 90_000_000_000))
        ]
        return SimpleNamespace(recordings=recordings)


def test_a_window_is_asked_how_far_it_is() -> None:
    lag = WindowLag("rerun", "r", lambda: 9_500_000_000, connect=lambda _: Window())  # type: ignore
    wait_until(lambda: lag.behind_s == pytest.approx(7.5))


def test_a_window_that_is_ahead_or_has_nothing_yet_is_not_behind() -> None:
    asked: list[str] = []

    def connect(address: str) -> Any:
        asked.append(address)
        return Window()

    ahead = WindowLag("a", "r", lambda: 1_000_000_000, connect=connect)
    nothing = WindowLag("b", "none", lambda: 9_000_000_000, connect=connect)
    wait_until(lambda: sorted(asked) == ["a", "b"])
    assert (ahead.behind_s, nothing.behind_s) == (0.0, 0.0)


def test_a_page_that_answers_no_questions_is_left_alone() -> None:
    asked = []

    def connect(address: str) -> Any:
        asked.append(address)
        raise ConnectionError("Unimplemented")

    lag = WindowLag("page", "r", lambda: 9_000_000_000, connect=connect, period_s=0.0)
    wait_until(lambda: asked == ["page"])
    assert lag.behind_s == 0.0
