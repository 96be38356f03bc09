"""What others wrote is shown on a terminal as it is spelt, and commands nothing there."""

from __future__ import annotations

import ast
import io
import json
import shlex
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.progress import Progress

from foretwin.contracts.terminal import command_line, console, described, plain, say, visible, words
from tests.test_layout import ROOT, tracked_files
from tests.test_mirrored import ROOMS

HOSTILE = "[/a] Lane \x1b[2J\x1b]0;title\x07 [bold]x[/bold] \u202egnirts \x9b31m :smile: \r\x7f"
SHOWN = (
    "[/a] Lane \\u001b[2J\\u001b]0;title\\u0007 [bold]x[/bold] \\u202egnirts \\u009b31m :smile: "
    "\\u000d\\u007f"
)
OURS = Path("contracts/terminal.py")


def test_commands_to_a_terminal_are_spelt_out() -> None:
    assert visible(HOSTILE) == SHOWN
    assert visible("Straße 東京, two\nlines\tof it") == "Straße 東京, two\nlines\tof it"
    assert plain("Straße\nforetwin: all is well\t!") == "Straße\\nforetwin: all is well !"


@given(st.text())
def test_nothing_is_left_that_a_terminal_obeys(text: str) -> None:
    shown = visible(text)

    assert not [c for c in shown if unicodedata.category(c) in ("Cc", "Cs") and c not in "\n\t"]
    assert not set(shown) & set("\u2028\u2029\u202a\u202e\u2066\u2069")
    assert not any(ord(c) < 32 for c in plain(text))
    shown.encode()


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_json_stays_the_same_json(text: str) -> None:
    said = json.dumps({"name": text}, ensure_ascii=False, indent=1)

    assert json.loads(visible(said)) == {"name": text}


def test_a_line_goes_where_it_belongs(capsys: pytest.CaptureFixture[str]) -> None:
    say(HOSTILE)
    say(HOSTILE, error=True)

    assert capsys.readouterr() == (SHOWN + "\n", SHOWN + "\n")


def test_a_pipe_is_as_wide_as_tables_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    assert console().width == 120
    monkeypatch.setenv("COLUMNS", "90")
    assert console().width == 90


def test_rich_takes_nothing_for_markup() -> None:
    shown, bar_shown = io.StringIO(), io.StringIO()
    made = console()
    made.file = shown
    made.print(visible(HOSTILE), soft_wrap=True)
    made.print(words(HOSTILE), soft_wrap=True)
    assert shown.getvalue() == 2 * (SHOWN + "\n")

    with Progress(described(), console=Console(file=bar_shown, width=200)) as bar:
        bar.add_task(plain(HOSTILE))
    assert SHOWN in bar_shown.getvalue()


def test_a_command_is_told_as_one_types_it() -> None:
    told = command_line("recover", Path("my runs/first"))
    assert told == "foretwin recover 'my runs/first'"
    assert shlex.split(told) == ["foretwin", "recover", "my runs/first"]
    assert command_line("repeat", "runs/x", "0a-8") == "foretwin repeat runs/x 0a-8"


WRITERS = ("print", "Console", "TextColumn", "typer.echo")


def _names_a_writer(text: str) -> bool:
    return any(name.rpartition(".")[2] in text for name in WRITERS)


def test_nobody_else_writes_to_a_terminal() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {name}"
        for path in tracked_files()
        if path.suffix == ".py"
        and path.relative_to(ROOT).parts[0] in ROOMS
        and path.relative_to(ROOT) != OURS
        and _names_a_writer(text := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and (name := ast.unparse(node.func)) in WRITERS
    ]

    assert found == [], "say it by foretwin.contracts.terminal"
