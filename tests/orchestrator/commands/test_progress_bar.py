"""Progress without a terminal: a line now and then, and every line that is said."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.commands import progress_bar as module
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.progress import Progress, untold

COVERS = ("foretwin.orchestrator.progress",)


@pytest.mark.parametrize(("period_s", "lines"), [(0.0, 3), (60.0, 0)])
def test_a_line_is_written_now_and_then_where_there_is_no_terminal(
    period_s: float,
    lines: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(module, "PLAIN_PERIOD_S", period_s)
    with progress_bar(3, "Worlds") as (advance, say):
        for name in ("n1", "n2", "n3"):
            advance(name)
        say("failed: [n2]")
    said = capsys.readouterr()
    assert said.out == ""
    *counted, last = said.err.splitlines()
    assert counted == [f"{n} of 3 Worlds, n{n}" for n in range(1, lines + 1)]
    assert last == "failed: [n2]"


@pytest.mark.parametrize("progress", [progress_bar, untold])
def test_both_take_the_same_words(progress: Progress, capsys: pytest.CaptureFixture[str]) -> None:
    with progress(3, "sections") as (advance, say):
        advance("first")
        advance("the others", by=2)
        say("a line")
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "" if progress is untold else "a line\n")
