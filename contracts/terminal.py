"""The one place that writes to a terminal: what others wrote cannot command it there.

Names of streets, ids and texts of logs and messages may hold anything: escape sequences that move
the cursor, brackets that rich takes for markup, marks that turn the direction of writing. They are
shown as they are spelt, in the escapes that JSON has too.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import TextColumn
    from rich.text import Text

_COMMANDS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]"
)
"""Control characters, separators of lines, marks of direction, and halves of characters."""


PLAIN_WIDTH = 120
"""Of tables in a file or a pipe."""


def visible(text: str) -> str:
    """Return a text of several lines in which nothing commands a terminal."""
    return _COMMANDS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def plain(text: str) -> str:
    """Return a text as one line in which nothing commands a terminal."""
    return visible(text).replace("\n", "\\n").replace("\t", " ")


def command_line(*words: object) -> str:
    """Return a command of foretwin as one types it: folders with spaces in them are quoted."""
    return shlex.join(["foretwin", *map(str, words)])


def say(text: object, *, error: bool = False) -> None:
    """Print a line, or several; to stderr, at once, where it is an `error` or tells of progress.

    Where nobody reads it any more, as behind `| head`, what is printed goes nowhere from then on.
    """
    stream = sys.stderr if error else sys.stdout
    try:
        print(visible(str(text)), file=stream, flush=error)
    except BrokenPipeError:
        write_nowhere(stream)


def write_nowhere(stream: TextIO) -> None:
    """Let go nowhere what waits to be written and all that follows: Python tries it at its end."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def console(*, error: bool = False) -> Console:
    """Return a console that takes nothing for markup; what it prints must be made `visible`.

    A file or a pipe has no width of its own to keep to.
    """
    from rich.console import Console

    class Piped(Console):
        def on_broken_pipe(self) -> None:
            """Say nothing more; the command goes on, which rich would end with code 1."""
            write_nowhere(sys.stderr if self.stderr else sys.stdout)

    made = Piped(stderr=error, markup=False, emoji=False, highlight=False)
    if not made.is_terminal and "COLUMNS" not in os.environ:
        made.width = PLAIN_WIDTH
    return made


def words(text: str) -> Text:
    """Return a text as rich shows it in one line: no markup, no commands."""
    from rich.text import Text

    return Text(plain(text))


def described() -> TextColumn:
    """Return the column of a progress bar that shows what a task is about."""
    from rich.progress import TextColumn

    return TextColumn("{task.description}", markup=False)
