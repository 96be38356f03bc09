"""Which passes a command line asks for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.trust import nominal_passes
from tests.trust.nominal_passes import asked_passes


@pytest.mark.parametrize(
    ("words", "names", "groups"),
    [
        ([], [], ["given", "held_out"]),
        (["kitti-02", "austin"], ["kitti-02", "austin"], ["given", "held_out"]),
        (["--group", "tuned_on"], [], ["tuned_on"]),
        (["--group", "given", "--group", "tuned_on"], [], ["given", "tuned_on"]),
    ],
)
def test_names_and_groups_are_those_of_the_line(
    monkeypatch: pytest.MonkeyPatch, words: list[str], names: list[str], groups: list[str]
) -> None:
    asked: list[tuple[Any, ...]] = []

    def passes(names: list[str], groups: list[str], folder: Path, **_: Any) -> Any:
        asked.append((names, groups, folder.is_dir()))
        return iter(())

    monkeypatch.setattr(nominal_passes, "passes", passes)
    assert list(asked_passes("tests.trust.x", words, usual=("given", "held_out"))) == []
    assert asked == [(names, groups, True)]


def test_a_word_that_is_none_ends_it_before_anything_is_driven(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        asked_passes("tests.trust.x", ["--grupe", "given"])
    assert "python -m tests.trust.x" in capsys.readouterr().err
