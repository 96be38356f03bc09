"""The fenced blocks of the pages, and what a hidden comment above one says of its test.

Above a block: `<!-- not run: WHY -->`, `<!-- file: NAME -->` (the block is that file of the
folder), `<!-- until: WORDS -->` (the last command goes on for ever: it is interrupted once it says
them), `<!-- exit: 3 -->`, `<!-- query: FOLDER -->` (SQL for `foretwin query`). Anywhere on a page:
`<!-- stage: map:town.osm -->`, what lies in the folder before its first command
(`tests/documents/stage.py`); `<!-- here: RUN → trial -->`, what a placeholder of the page stands
for; `<!-- beside: COMMAND → WORDS -->`, what goes on meanwhile, and says these words when it is
ready.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^(?P<indent> *)```(?P<language>[\w{}:-]*)\s*$")
COMMENT = re.compile(r"^ *<!-- (?P<key>[a-z ]+): (?P<value>.*) -->\s*$")
COMMANDS = ("sh", "console")
ABOVE = {"not run", "file", "until", "exit", "query"}


class Block(NamedTuple):
    """One fenced block: where it stands, its language, and the marks above it."""

    page: str
    line: int
    language: str
    text: str
    marks: dict[str, str]

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"

    def commands(self) -> list[str]:
        """Return its command lines; of a `console` block those behind the prompt."""
        lines = self.text.replace("\\\n", " ").splitlines()
        if self.language == "console":
            lines = [line[2:] for line in lines if line.startswith("$ ")]
        return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


class Page(NamedTuple):
    """A page: its blocks in order, what has to be there before, and its placeholders."""

    name: str
    blocks: list[Block]
    stage: tuple[str, ...]
    here: dict[str, str]
    beside: tuple[str, str] | None
    """A command that goes on while the page is played, and what it says when it is ready."""

    def in_place(self, text: str) -> str:
        """Return a text with what the placeholders of the page stand for."""
        for name, value in self.here.items():
            text = re.sub(rf"(?<![\w.]){re.escape(name)}(?!\w)", lambda _, v=value: v, text)
        return text


def pages() -> list[str]:
    """Return the pages that users read, as paths from the root."""
    found = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")]
    return sorted(str(path.relative_to(ROOT)) for path in found)


@cache
def read_page(name: str) -> Page:
    """Return a page of the repository in parts."""
    return page_of((ROOT / name).read_text(encoding="utf-8"), name)


def page_of(text: str, name: str) -> Page:
    """Return the parts of a page's text."""
    stage: list[str] = []
    here: dict[str, str] = {}
    beside = None
    blocks = []
    lines = text.splitlines()
    marks: dict[str, str] = {}
    number = 0
    while number < len(lines):
        if said := COMMENT.match(lines[number]):
            key, value = said["key"], said["value"]
            if key == "stage":
                stage.extend(value.split())
            elif key == "here":
                placeholder, _, stands_for = value.partition(" → ")
                here[placeholder] = stands_for
            elif key == "beside":
                command, _, ready = value.partition(" → ")
                beside = command, ready
            else:
                assert key in ABOVE, f"{name}:{number + 1}: nothing is called {key!r}"
                marks[key] = value
        elif opened := FENCE.match(lines[number]):
            end = number + 1
            while not re.fullmatch(r" *```\s*", lines[end]):
                end += 1
            text = "\n".join(
                line.removeprefix(opened["indent"]) for line in lines[number + 1 : end]
            )
            blocks.append(Block(name, number + 1, opened["language"], text, marks))
            number, marks = end, {}
        elif lines[number].strip():
            assert not marks, f"{name}:{number + 1}: no block below {marks}"
        number += 1
    return Page(name, blocks, tuple(stage), here, beside)


def all_blocks() -> Iterator[Block]:
    """Yield the blocks of all pages."""
    for name in pages():
        yield from read_page(name).blocks


def words_of(command: str) -> list[str]:
    """Return the words of a command line, without its comment."""
    return shlex.split(command, comments=True)
