"""How a page is read and played: what its hidden comments say is done, and failures are noticed."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.documents.blocks import Page, page_of
from tests.documents.running import play_blocks
from tests.documents.stage import Installed


@pytest.fixture
def bare(tmp_path: Path) -> Installed:
    """An environment with nothing of its own: what the page calls is the system's."""
    return Installed(*[tmp_path / "nothing"] * 6)


def page(*lines: str) -> Page:
    return page_of("\n".join(lines), "a page")


def fenced(language: str, *lines: str) -> tuple[str, ...]:
    return (f"```{language}", *lines, "```")


def test_blocks_keep_place_language_text_and_marks() -> None:
    read = page("# A", "", "1. step", "", "   <!-- exit: 3 -->", "   ```sh", "   a", "   ```")

    (block,) = read.blocks
    assert block.place == "a page:6"
    assert (block.language, block.text, block.marks) == ("sh", "a", {"exit": "3"})


def test_commands_are_lines_without_comments_and_behind_a_prompt_without_output() -> None:
    plain, shown = page(
        *fenced("sh", "# first", "a \\", "  b", "", "c"), *fenced("console", "$ d", "$5 is output")
    ).blocks

    assert [line.split() for line in plain.commands()] == [["a", "b"], ["c"]]
    assert shown.commands() == ["d"]


def test_placeholders_are_whole_words() -> None:
    read = page("<!-- here: RUN → trial -->", "<!-- here: twin-pc → localhost -->")

    assert read.in_place("runs/RUN RUNS a.RUN tls/twin-pc:7447") == (
        "runs/trial RUNS a.RUN tls/localhost:7447"
    )


def test_a_mark_without_a_block_is_refused() -> None:
    with pytest.raises(AssertionError, match="no block below"):
        page("<!-- exit: 3 -->", "some prose")
    with pytest.raises(AssertionError, match="'not ran'"):
        page("<!-- not ran: a typing error -->", *fenced("sh", "true"))


def test_a_page_is_played_in_order_in_its_folder(tmp_path: Path, bare: Installed) -> None:
    played = play_blocks(
        page(
            "<!-- here: NAME → given -->",
            *fenced("sh", "cat later.toml > NAME.txt", "echo two >> NAME.txt"),
            "<!-- not run: it would take the machine away -->",
            *fenced("sh", "touch never"),
            *fenced("text", "touch nor-this"),
            "<!-- file: later.toml -->",
            *fenced("toml", 'name = "NAME"'),
            "<!-- exit: 3 -->",
            *fenced("sh", "exit 3"),
            *fenced("sql", "SELECT content FROM read_text('given.txt')"),
        ),
        tmp_path,
        bare,
    )

    assert played == 3
    assert (tmp_path / "given.txt").read_text() == 'name = "given"\ntwo\n'
    assert {one.name for one in tmp_path.iterdir()} == {"given.txt", "later.toml"}


def test_a_block_of_python_goes_on_with_what_those_before_it_made(
    tmp_path: Path, bare: Installed
) -> None:
    first, second = (
        fenced("python", "made = 2"),
        fenced("python", "open('it', 'w').write('x' * made)"),
    )

    assert play_blocks(page(*first, *second), tmp_path, bare) == 2

    assert (tmp_path / "it").read_text() == "xx"


@pytest.mark.parametrize(
    ("marks", "command"),
    [((), "false\ntrue"), ((), "false | true"), (("<!-- exit: 3 -->",), "true")],
    ids=["the first of two fails", "in a pipe", "no failure where one is told"],
)
def test_a_command_that_ends_otherwise_fails_the_page(
    marks: tuple[str, ...], command: str, tmp_path: Path, bare: Installed
) -> None:
    with pytest.raises(AssertionError, match="a page:"):
        play_blocks(page(*marks, *fenced("sh", command)), tmp_path, bare)


def test_what_goes_on_is_interrupted_once_it_is_ready(tmp_path: Path, bare: Installed) -> None:
    until = page("<!-- until: ready -->", *fenced("sh", "echo ready; exec tail -f /dev/null"))
    assert play_blocks(until, tmp_path, bare) == 1

    silent = page("<!-- until: ready -->", *fenced("sh", "echo something else"))
    with pytest.raises(pytest.fail.Exception, match="never said 'ready'"):
        play_blocks(silent, tmp_path, bare)


def test_what_goes_on_beside_a_page_is_there_and_then_gone(tmp_path: Path, bare: Installed) -> None:
    beside = "trap 'touch ended; exit' INT; echo $$ > pid; echo ready; tail -f /dev/null"
    read = page(f"<!-- beside: {beside} → ready -->", *fenced("sh", "kill -0 $(cat pid)"))

    assert play_blocks(read, tmp_path, bare) == 1
    assert (tmp_path / "ended").exists(), "by an interrupt, as by Ctrl-C"
    assert not Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}").exists()
