"""What the pages say of commands holds: each is run or says why not, and its options exist."""

from __future__ import annotations

import ast
import builtins
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer

from foretwin.orchestrator.commands.cli import app
from foretwin.orchestrator.commands.config import check
from tests.documents.blocks import (
    COMMANDS,
    ROOT,
    Block,
    all_blocks,
    pages,
    read_page,
    words_of,
)

NOT_RUN_AT_MOST = 10
OTHERS = "planners.toml"
"""Names a planner that its page installs before: only the page as a whole can be tried."""
LANGUAGES = {*COMMANDS, "python", "toml", "sql", "text", "ini", "yaml", "json5", "dockerfile"}
COMMAND = re.compile(r"^(\$ )?(\S*/)?(foretwin|pip3?|python3?|make|docker) ", re.MULTILINE)
IN_TEXT = re.compile(r"`(foretwin [^`]+)`")
PROGRAM_WORDS = {"foretwin", ".venv/bin/foretwin"}


@cache
def tree() -> Any:
    return typer.main.get_command(app)


def wrong_in(command: str) -> list[str]:
    """Return what the command line `foretwin …` does not know in a command."""
    found = tree()
    wrong, words = [], command.split()[1:]
    while hasattr(found, "commands") and words and not words[0].startswith("-"):
        name = words.pop(0)
        if not re.fullmatch(r"[a-z-]+(\|[a-z-]+)*", name):
            break
        known = [found.commands.get(one) for one in name.split("|")]
        if None in known:
            return [name]
        found = known[-1]
    options = {name for one in found.params for name in (*one.opts, *one.secondary_opts)}
    for word in words:
        name = word.split("=")[0].strip("[](),…")
        if re.fullmatch(r"--?[a-z][a-z-]*", name) and name not in options | {"--help", "-h"}:
            wrong.append(name)
    return wrong


def foretwin_lines(block: Block) -> list[str]:
    """Return the calls of foretwin among a block's commands."""
    return [
        " ".join(words)
        for line in block.commands()
        if (words := words_of(line)) and words[0] in PROGRAM_WORDS
    ]


def unknown_names(program: str) -> set[str]:
    """Return the names that a program uses and nothing in it makes."""
    nodes = list(ast.walk(ast.parse(program)))
    made = {one.id for one in nodes if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
    made |= {one.arg for one in nodes if isinstance(one, ast.arg)}
    made |= {one.name for one in nodes if isinstance(one, ast.FunctionDef | ast.ClassDef)}
    for one in nodes:
        if isinstance(one, ast.Import | ast.ImportFrom):
            made |= {(name.asname or name.name).partition(".")[0] for name in one.names}
    used = {one.id for one in nodes if isinstance(one, ast.Name)}
    return used - made - set(dir(builtins))


@pytest.mark.parametrize("name", pages())
def test_the_python_of_a_page_uses_what_the_page_has_made(name: str) -> None:
    blocks = [one.text for one in read_page(name).blocks if one.language == "python"]

    for count in range(1, len(blocks) + 1):
        assert unknown_names("\n".join(blocks[:count])) == set()


def test_a_name_that_nobody_made_is_seen() -> None:
    assert unknown_names("import a.b\nc = a.b\nd(c)") == {"d"}


def test_every_block_says_what_it_is() -> None:
    strange = [
        one.place
        for one in all_blocks()
        if one.language not in LANGUAGES and not one.language.startswith("{")
    ]

    assert strange == []


def test_no_command_hides_in_a_block_that_is_not_run() -> None:
    hiding = [
        one.place
        for one in all_blocks()
        if one.language in ("", "text") and COMMAND.search(one.text)
    ]

    assert hiding == []


def test_few_blocks_are_not_run_and_each_says_why() -> None:
    reasons = {one.place: one.marks["not run"] for one in all_blocks() if "not run" in one.marks}

    assert len(reasons) <= NOT_RUN_AT_MOST
    assert all(len(reason.split()) >= 4 for reason in reasons.values())


@pytest.mark.parametrize("name", pages())
def test_commands_and_options_of_a_page_exist(name: str) -> None:
    page = read_page(name)
    lines = [
        line
        for block in page.blocks
        if block.language in COMMANDS
        for line in foretwin_lines(block)
    ]
    prose = IN_TEXT.findall(" ".join((ROOT / name).read_text(encoding="utf-8").split()))

    wrong = {line: found for line in (*lines, *prose) if (found := wrong_in(line))}
    assert wrong == {}


def test_what_does_not_exist_is_seen() -> None:
    assert wrong_in("foretwin drvie --map x") == ["drvie"]
    assert wrong_in("foretwin drive --mop x") == ["--mop"]
    assert wrong_in("foretwin secure init|add|shw") == ["init|add|shw"]
    assert wrong_in("foretwin map get BBOX --out x.osm") == []


@pytest.mark.parametrize(
    "block", [b for b in all_blocks() if b.language == "toml"], ids=lambda block: block.place
)
def test_a_block_of_toml_can_be_read(block: Block) -> None:
    assert tomllib.loads(block.text)


@pytest.mark.parametrize(
    "block",
    [b for b in all_blocks() if b.language == "toml" and b.marks.get("file", OTHERS) != OTHERS],
    ids=lambda block: block.place,
)
def test_a_file_of_a_page_is_one_that_foretwin_takes(block: Block, tmp_path: Path) -> None:
    """Without what the page asks of a network; the other blocks of TOML are parts of files."""
    file = tmp_path / block.marks["file"]
    file.write_text(block.text, encoding="utf-8")

    check(file, kind=None)


@pytest.mark.parametrize(
    "block", [b for b in all_blocks() if b.language == "python"], ids=lambda block: block.place
)
def test_a_block_of_python_compiles(block: Block) -> None:
    compile(block.text, block.place, "exec")
