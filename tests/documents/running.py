"""Plays the blocks of a page in their order, as a reader would who types them."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import duckdb
import pytest

from tests.documents.blocks import COMMANDS, Block, Page, read_page
from tests.documents.stage import Installed, names_in, set_stage

BLOCK_S = 600.0
"""The longest that a block may take, of a machine with other work."""


def play_page(name: str, folder: Path, installed: Installed) -> int:
    """Run all that is to be run of a page; returns how many blocks that were.

    Fails with the place and what was printed where a command ends otherwise than the page says.
    """
    page = read_page(name)
    return play_blocks(page._replace(here=with_names(page.here, installed.run)), folder, installed)


def play_blocks(page: Page, folder: Path, installed: Installed) -> int:
    """Run all that is to be run of a page whose placeholders are filled in."""
    set_stage(folder, tuple(page.in_place(item) for item in page.stage), installed)
    for block in page.blocks:
        if "file" in block.marks:
            target = folder / block.marks["file"]
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(page.in_place(block.text) + "\n", encoding="utf-8")
    with going_on(page, folder, installed):
        return sum(play(block, page, folder, installed) for block in page.blocks)


@contextmanager
def going_on(page: Page, folder: Path, installed: Installed) -> Iterator[None]:
    """Have the command of a page that goes on beside it, if it has one, from when it is ready."""
    if page.beside is None:
        yield
        return
    command, ready = page.beside
    process = start(command, folder, installed)
    try:
        said = []
        for line in _lines_of(process):
            said.append(line)
            if ready in line:
                break
        else:
            pytest.fail(f"{page.name}: {command} never said {ready!r}:\n{''.join(said)}")
        yield
        os.killpg(process.pid, signal.SIGINT)
        process.wait(timeout=BLOCK_S)
    finally:
        _end(process)


def with_names(here: dict[str, str], run: Path) -> dict[str, str]:
    """Return placeholders with `{future}`, `{world}` and `{run}` as they are in a run."""
    names = names_in(run)
    filled = {}
    for key, value in here.items():
        for name, of_the_run in names.items():
            value = value.replace(name, of_the_run)
        filled[key] = value
    return filled


def play(block: Block, page: Page, folder: Path, installed: Installed) -> bool:
    """Run a block; False where there is nothing to run."""
    if "not run" in block.marks or "file" in block.marks:
        return False
    text = page.in_place(block.text)
    if block.language in COMMANDS:
        commands = "\n".join(page.in_place(line) for line in block.commands())
        run_shell(commands, block, folder, installed)
    elif block.language == "python":
        # A block goes on with what those before it on the page have made, as in a notebook.
        with (folder / "page.py").open("a", encoding="utf-8") as program:
            program.write(text + "\n")
        run_shell("python page.py", block, folder, installed)
    elif runs := block.marks.get("query"):
        for question in filter(str.strip, text.split(";")):
            run_shell(shlex.join(["foretwin", "query", question, runs]), block, folder, installed)
    elif block.language == "sql":
        with pytest.MonkeyPatch.context() as elsewhere:
            elsewhere.chdir(folder)
            duckdb.connect().execute(text)
    elif block.language == "toml":
        tomllib.loads(text)
        return False
    else:
        return False
    return True


def start(commands: str, folder: Path, installed: Installed) -> subprocess.Popen[str]:
    """Start lines in one shell that ends at the first that fails."""
    return subprocess.Popen(
        ["bash", "-e", "-o", "pipefail", "-c", commands],
        cwd=folder,
        env=installed.environment(folder),
        text=True,
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def run_shell(commands: str, block: Block, folder: Path, installed: Installed) -> None:
    """Run lines, and fail where they end otherwise than their block says."""
    wanted = int(block.marks.get("exit", "0"))
    process = start(commands, folder, installed)
    said: list[str] = []
    try:
        if words := block.marks.get("until"):
            for line in _lines_of(process):
                said.append(line)
                if words in line:
                    break
            else:
                pytest.fail(f"{block.place}: never said {words!r}:\n{''.join(said)}")
            os.killpg(process.pid, signal.SIGINT)
        rest, _ = process.communicate(timeout=BLOCK_S)
        said.append(rest)
    except subprocess.TimeoutExpired:
        pytest.fail(f"{block.place}: longer than {BLOCK_S} s:\n{commands}\n{''.join(said)}")
    finally:
        _end(process)
    if not words:
        assert process.returncode == wanted, f"{block.place}:\n{commands}\n{''.join(said)}"


def _lines_of(process: subprocess.Popen[str]) -> Iterator[str]:
    assert process.stdout is not None
    yield from iter(process.stdout.readline, "")


def _end(process: subprocess.Popen[str]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
